// What concerns other clients: their objects, reports and events. What is asked of the server: asking.cpp.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>
#include <utility>

#include "base/error.h"
#include "client/remote_scene.h"

namespace fs {
namespace {

template <class List, class Thing>
uint64_t number_of(const List& list, const Thing* thing) {  // the server's; 0: it is not its
  const auto found = std::find_if(list.begin(), list.end(), [&](const auto& e) { return e.second.get() == thing; });
  return found == list.end() ? 0 : found->first;
}

// The object's own name, for checks: without its client's.
void put_bare_name(fs_object& object) {
  const std::string name = text_of(object.name);
  put_text(object.name, name.substr(name.find('/') + 1));
}

}  // namespace

wire::Target RemoteScene::to_target(const char* name, const char* field) {
  wire::Target out{};
  const size_t size = strnlen(name, sizeof out.name);
  if (size == sizeof out.name) {
    fail(FS_ERROR_NOT_FOUND, "%s is '%.80s...': there is none of such a long name", field, name);
  }
  std::memcpy(out.name, name, size);
  return out;
}

// -------------------------------------------------------------------------------------------------- their objects

// As an open group has it, else as the server has it. Its name is the one it was asked by, so that it can be changed as it
// is.
Ref<const Object> RemoteScene::get_other(Call& call, const char* name, fs_object& out) {
  const auto not_found = [name] { fail(FS_ERROR_NOT_FOUND, "name is '%.128s': there is no such object", name); };
  if (group_) {
    if (const auto known = group_->others.find(std::string_view(name)); known != group_->others.end()) {
      if (!known->second.kept) not_found();
      out = known->second.object;
      return known->second.kept;
    }
  }
  const wire::Target target = to_target(name, "name");
  for (int i = 1;; ++i) {
    const auto record = request(call, wire::type_get, bytes_of(&target, 1)).as<wire::Object>();
    try {
      const Received received = receive(call, record);
      Ref<const Object> object = parse_object(received.object, nullptr, false).object;
      out = received.object;
      put_text(out.name, name);
      return object;
    } catch (const Error& error) {  // it was changed before all of it was fetched
      if (error.status != FS_ERROR_NOT_FOUND || i == most_tries) throw;
    }
  }
}

// The object as the open group has it, which from now on changes it. May wait: then the group may have gone.
RemoteScene::Other& RemoteScene::join_group(Call& call, const char* name) {
  if (connection_.welcome().is_locked) {
    fail(FS_ERROR_DENIED, "name is '%.128s': this server lets a client change its own objects only", name);
  }
  Other other;
  other.kept = get_other(call, name, other.object);
  if (!group_) fail(FS_ERROR_STATE, "the group was closed by another thread");
  require_room(*group_, 0);
  return group_->others.insert_or_assign(name, std::move(other)).first->second;
}

void RemoteScene::change_other(Call& call, const fs_object& object, uint32_t parts) {
  const std::string name = text_of(object.name);
  wire::Edit edit{to_target(name.c_str(), "name"), parts, to_record(object)};
  if (parts == 0) {  // whether it is there
    fs_object present;
    get_other(call, name.c_str(), present);
    return;
  }
  if ((parts & FS_PART_POSE) && edit.object.time == 0) edit.object.time = now();
  if (group_) {
    Other& other = join_group(call, name.c_str());
    fs_object whole = merge_parts(other.object, object, parts);
    put_bare_name(whole);
    const Ref<const Object> parsed = parse_object(whole, nullptr, false).object;
    if (parts & FS_PART_SHAPE) edit.object.shape = object.shape ? object.shape->serial : 0;
    if (parts & FS_PART_PROFILES) {
      edit.object.front.curve = object.front.curve ? object.front.curve->serial : 0;
      edit.object.back.curve = object.back.curve ? object.back.curve->serial : 0;
    }
    add(*group_, wire::type_edit, name.c_str(), bytes_of(&edit, 1));
    group_->changes.back().parts = parts;
    group_->changes.back().object = parsed;
    put_text(whole.name, name);
    other.object = whole;
    other.kept = parsed;
    return;
  }
  // While it is asked for, what it brings is in use.
  struct Pins {
    RemoteScene& scene;
    std::vector<uint64_t> ids;
    ~Pins() {
      for (const uint64_t id : ids) {
        const auto found = scene.data_.find(id);
        if (found == scene.data_.end() || --found->second.uses > 0) continue;
        try {
          scene.maybe_unused_[id] = scene.connection_.last_serial();
        } catch (const std::bad_alloc&) {  // the server keeps it longer than it must
        }
      }
    }
  };
  // What came from the server goes back by its number; unless it has let go of it, then it is sent as a new one.
  for (const bool may_refer : {true, false}) {
    bool refers = false;
    Pins pins{*this, {}};
    const auto id_of = [&](const auto* thing, const auto& fetched) -> uint64_t {
      const uint64_t number = may_refer && thing ? number_of(fetched, thing) : 0;
      refers = refers || number;
      if (number || !thing) return number;
      pins.ids.reserve(3);
      while (!upload(thing)) pause(call, true);
      ++data_.at(thing->serial).uses;
      pins.ids.push_back(thing->serial);
      return thing->serial;
    };
    if (parts & FS_PART_SHAPE) edit.object.shape = id_of(object.shape, fetched_shapes_);
    if (parts & FS_PART_PROFILES) {
      edit.object.front.curve = id_of(object.front.curve, fetched_curves_);
      edit.object.back.curve = id_of(object.back.curve, fetched_curves_);
    }
    try {
      request(call, wire::type_edit, bytes_of(&edit, 1));
      return;
    } catch (const Error& error) {
      if (!refers || error.status != FS_ERROR_STATE || error.text != wire::not_offered) throw;
    }
  }
}

void RemoteScene::move_other(Call& call, const char* name, const Pose& pose, const fs_twist* twist, double time) {
  const wire::MoveOther move{to_target(name, "name"), twist != nullptr, pose, twist ? *twist : fs_twist{}, time};
  if (!group_) {
    request(call, wire::type_move_other, bytes_of(&move, 1));
    return;
  }
  Other& other = join_group(call, name);
  add(*group_, wire::type_move_other, name, bytes_of(&move, 1));
  other.object.pose = pose;
  other.object.twist = twist ? *twist : fs_twist{};
  other.object.time = time;
}

void RemoteScene::remove_other(Call& call, const char* name) {
  const wire::Target target = to_target(name, "name");
  if (!group_) {
    request(call, wire::type_remove_other, bytes_of(&target, 1));
    return;
  }
  Other& other = join_group(call, name);
  add(*group_, wire::type_remove_other, name, bytes_of(&target, 1));
  other.kept = nullptr;
}

// ------------------------------------------------------------------------------------------------- reports and events

// A report of an own object in an open group: what it is, as the group has it; what became of it, as the server tells,
// if it knows it.
fs_report RemoteScene::in_group(const fs_report& ours, const fs_report* theirs) {
  if (!theirs) return ours;
  fs_report out = *theirs;
  out.primitive = ours.primitive;
  out.stiffness_wanted = ours.stiffness_wanted;
  out.stiffness_applied = ours.stiffness_applied;
  fs_object object;
  replica_->get(ours.name, object);
  if (out.state == FS_OBJECT_REFUSED) return out;
  if (out.weight > 0) {
    out.state = out.weight < 1 ? FS_OBJECT_FADING : FS_OBJECT_FELT;
  } else if (!object.enabled) {
    out.state = FS_OBJECT_DISABLED;
  } else if (out.state != FS_OBJECT_PENDING) {
    out.state = FS_OBJECT_FADING;
  }
  return out;
}

fs_report RemoteScene::report(const char* given) {
  Call call = enter();
  const char* name = own_name(given);
  fs_report ours{};
  if (name) {
    catch_up(call, name);
    ours = replica_->report(name);  // NOT_FOUND
  }
  const wire::Target target = to_target(name ? name : given, "name");
  try {
    const auto theirs = request(call, wire::type_report, bytes_of(&target, 1)).as<fs_report>();
    return name && group_ ? in_group(ours, &theirs) : theirs;
  } catch (const Error& error) {
    if (!name || !group_ || error.status != FS_ERROR_NOT_FOUND) throw;
    return in_group(ours, nullptr);
  }
}

std::vector<fs_report> RemoteScene::reports() {
  Call call = enter();
  catch_up(call, "");
  std::vector<fs_report> out = request(call, wire::type_reports).list<fs_report>();
  if (!group_) return out;
  NameMap<fs_report> theirs;  // of its own objects; those of others have a '/'
  std::erase_if(out, [&](const fs_report& report) {
    const std::string name = text_of(report.name);
    const bool is_own = name.find('/') == std::string::npos;
    if (is_own) theirs[name] = report;
    return is_own;
  });
  std::vector<fs_report> own = replica_->reports();
  for (fs_report& report : own) {
    const auto found = theirs.find(text_of(report.name));
    report = in_group(report, found == theirs.end() ? nullptr : &found->second);
  }
  out.insert(out.begin(), own.begin(), own.end());
  return out;
}

std::vector<fs_client> RemoteScene::clients() {
  Call call = enter();
  look();
  return request(call, wire::type_clients).list<fs_client>();
}

// The oldest event that is there; false: none. After the last of a server that is gone comes its end.
bool RemoteScene::take_event(fs_event& out) {
  const char* loss = connection_.loss();  // before its last events are looked at
  if (!loss) {
    try {
      look();
    } catch (const Error&) {  // whatever it is, the next call is told
    }
  }
  if (events_.read(*connection_.outbox(), out)) {
    if (out.kind == FS_EVENT_OVERFLOW) out.time = now();
    return true;
  }
  if (!loss) return false;
  if (std::exchange(is_end_told_, true)) throw Error{FS_ERROR_DISCONNECTED, loss};
  out.kind = FS_EVENT_DISCONNECTED;
  out.status = FS_ERROR_DISCONNECTED;
  out.time = now();
  put_text(out.text, loss);
  return true;
}

fs_event RemoteScene::next_event(double timeout) {
  check_timeout(timeout);
  const double start = steady_now();
  for (;;) {
    if (connection_.is_forked()) connection_.check();
    {
      const Lock lock(mutex_);
      fs_event event;
      if (take_event(event)) return event;
    }
    const double rest = timeout - (steady_now() - start);
    if (!(rest > 0)) return {};
    std::this_thread::sleep_for(std::chrono::duration<double>(std::fmin(rest, 2e-3)));
  }
}

}  // namespace fs
