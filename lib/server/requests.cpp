// What a client asks, and what it is told of others.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <deque>

#include "base/error.h"
#include "scene/moment.h"
#include "server/list.h"
#include "server/session.h"

namespace fs {
namespace {

// A report as another scene sees it: the place in that scene's frame, the force in newtons at the device along its axes.
fs_report seen_from(const fs_report& report, const fs_frame& owner, const fs_frame& viewer) {
  fs_report out = report;
  if (!std::isfinite(report.distance)) return out;
  const Quat to_device = owner.pose.orientation, from_device = conjugate(viewer.pose.orientation);
  const Vec3 at = owner.pose.position + rotate(to_device, (1 / owner.scale) * report.point);
  out.point = viewer.scale * rotate(from_device, at - viewer.pose.position);
  const Vec3 force = owner.force_scale * rotate(to_device, report.wrench.force);
  const Vec3 torque = (owner.force_scale / owner.scale) * rotate(to_device, report.wrench.torque);
  out.wrench = {rotate(from_device, force), rotate(from_device, torque)};
  out.distance = report.distance * viewer.scale / owner.scale;
  return out;
}

// Of an object that is not in the scene.
fs_report report_of(const std::string& name, fs_primitive primitive, fs_object_state state) {
  fs_report out{};
  put_text(out.name, name);
  out.primitive = primitive;
  out.state = state;
  out.distance = never;
  return out;
}

}  // namespace

void Session::send_reply(uint64_t serial, fs_status status, const std::string& text, std::span<const std::byte> body,
                         int descriptor) {
  const wire::Header header{wire::type_reply, 0, serial};
  wire::Reply reply{};
  reply.status = status;
  put_text(reply.text, text);
  const std::span<const std::byte> parts[] = {bytes_of(&header, 1), bytes_of(&reply, 1), body};
  const std::span<const int> descriptors(&descriptor, descriptor >= 0 ? 1 : 0);
  // Data are memory and a descriptor on their way: not much of it for a client that does not read.
  constexpr size_t most_unread = 16384;
  if (descriptor >= 0 && unread(socket_) > most_unread) {
    return send_reply(serial, FS_ERROR_FULL, "this client has not read the answers before", {}, -1);
  }
  const Transfer transfer = send_message(socket_, parts, descriptors);
  if (transfer == Transfer::again && descriptor >= 0) {  // perhaps others of this user have too many on their way
    return send_reply(serial, FS_ERROR_FULL, "the system takes no more descriptors on their way now", {}, -1);
  }
  if (transfer != Transfer::done) drop(server_.settings().lease);
}

void Session::reply(uint64_t serial, std::span<const std::byte> body, int descriptor) {
  if (!is_gone_) send_reply(serial, FS_OK, "", body, descriptor);
}

void Session::reply_failure(uint64_t serial, fs_status status, const std::string& text) {
  if (!is_gone_) send_reply(serial, status, text, {}, -1);
}

LocalScene& Session::target(const wire::Target& name, bool is_to_change, Session*& owner, std::string& object) const {
  const std::string text = text_of(name.name);
  const size_t slash = text.find('/');
  const std::string client = slash == std::string::npos ? name_ : text.substr(0, slash);
  owner = client == "server" ? nullptr : server_.find(client);
  if (client != "server" && !owner) {
    fail(FS_ERROR_NOT_FOUND, "name is '%.120s': no client '%.60s' is connected", text.c_str(), client.c_str());
  }
  object = slash == std::string::npos ? text : text.substr(slash + 1);
  if (is_to_change && owner == this) {  // then two would keep account of them
    fail(FS_ERROR_INVALID, "name is '%.120s', must be another client's: its own objects a client changes itself",
         text.c_str());
  }
  if (is_to_change && server_.settings().is_locked) {
    fail(FS_ERROR_DENIED, "name is '%.120s': this server lets a client change its own objects only", text.c_str());
  }
  return owner ? *owner->scene_ : *server_.servo().scene();
}

void Session::request(const Message& message) {
  using namespace wire;
  const uint64_t serial = message.header.serial;
  Session* owner = nullptr;
  std::string name;  // of the object that is asked for, when there is such a client
  try {
    switch (message.header.type) {
      case type_sync: {
        constexpr size_t most = 64;
        if (syncs_.size() >= most) fail(FS_ERROR_FULL, "%zu calls wait for this client already", syncs_.size());
        syncs_.push_back({serial, false, 0, {}});
        return;
      }
      case type_pull: return pull(message);
      case type_fetch: return fetch(message);
      case type_edit:
      case type_move_other:
      case type_remove_other:
        if (must_wait(message)) {
          constexpr size_t most = 64;
          if (waiting_requests_.size() >= most) fail(FS_ERROR_FULL, "%zu changes of this client wait already", most);
          waiting_requests_.push_back(message);
          return;
        }
        return edit(message, owner, name);
      case type_get: {
        LocalScene& scene = target(message.as<Target>(), false, owner, name);
        if (owner) owner->take_moves();
        const Foreign other(nullptr, Ref<LocalScene>::share(&scene));  // without a group that is open there
        fs_object object;
        const Ref<const ::fs::Object> kept = scene.get(other.draft, name.c_str(), object);
        const wire::Object record = offer(object);
        return reply(serial, bytes_of(&record, 1));
      }
      case type_report: {
        LocalScene& scene = target(message.as<Target>(), false, owner, name);
        fs_report report = owner ? owner->own_report(name) : scene.report(name.c_str());
        if (owner != this) {
          report = seen_from(report, scene.get_frame(nullptr), scene_->get_frame(nullptr));
          put_text(report.name, (owner ? owner->name_ : "server") + "/" + name);
        }
        return reply(serial, bytes_of(&report, 1));
      }
      case type_reports: return tell_reports(message);
      case type_clients: {
        const std::vector<fs_client> list = server_.describe();
        const Descriptor blob = make_blob({bytes_of(list.data(), list.size())});
        const Count count{list.size()};
        return reply(serial, bytes_of(&count, 1), blob.get());
      }
      case type_view: return tell_view(message);
      case type_motions: return tell_motions(message);
      case type_stats: {
        fs_servo_stats stats = fs_servo_stats_init();
        server_.servo().get_stats(stats);
        return reply(serial, bytes_of(&stats, 1));
      }
      case type_device: {
        fs_device_info info = fs_device_info_init();
        server_.servo().get_device_info(info);
        return reply(serial, bytes_of(&info, 1));
      }
      default: return;
    }
  } catch (const Error& error) {
    const uint32_t type = message.header.type;
    refused_ += type == type_edit || type == type_move_other || type == type_remove_other;
    if (error.status == FS_ERROR_NOT_FOUND && !name.empty()) {
      const std::string client = owner ? owner->name_ : "server";
      return reply_failure(serial, error.status, "name is '" + client + "/" + name + "': there is no such object");
    }
    reply_failure(serial, error.status, error.text);
  }
}

// Whether a change of another client's object has to wait: for a shape that came with it, or behind a group that waits.
bool Session::must_wait(const Message& message) const {
  static_assert(offsetof(wire::Edit, target) == 0 && offsetof(wire::MoveOther, target) == 0);  // each begins with its target
  if (held_.has(text_of(message.as<wire::Target>().name))) return true;
  if (message.header.type != wire::type_edit) return false;
  const wire::Object& object = message.as<wire::Edit>().object;
  const std::initializer_list<uint64_t> ids = {object.shape, object.front.curve, object.back.curve};
  return std::any_of(ids.begin(), ids.end(), [this](uint64_t id) {
    const auto found = uploads_.find(id);
    return found != uploads_.end() && !found->second.is_ready;
  });
}

void Session::retry_requests() {
  const std::vector<Message> waiting = std::exchange(waiting_requests_, {});
  for (const Message& message : waiting) request(message);
  tell_settled();
}

// A change of another client's object.
void Session::edit(const Message& message, Session*& owner, std::string& name) {
  LocalScene& scene = target(message.as<wire::Target>(), true, owner, name);
  if (owner) owner->take_moves();  // what it has moved before
  // Not as part of a group that the server's application has open: that may be cancelled.
  Foreign other(owner ? owner->shared_from_this() : nullptr, Ref<LocalScene>::share(&scene));
  change_foreign(other, message, name);
  scene.take(other.draft);
  tell_edit(scene, owner, name, message.header.type == wire::type_remove_other);
  reply(message.header.serial);
}

const Session::Offer* Session::find_offer(uint64_t number) const noexcept {
  const auto found = std::find_if(offered_.begin(), offered_.end(), [number](const Offer& o) { return o.number == number; });
  return found == offered_.end() ? nullptr : &*found;
}

void Session::tell_edit(LocalScene& scene, Session* owner, const std::string& name, bool is_removed) {
  ++changes_;
  server_.note_activity();
  if (!owner) {
    scene.note_edit(name.c_str(), name_.c_str());
  } else if (owner != this) {
    owner->note_edit(name, name_, is_removed);
  }
}

// One thing of which the client may believe something else than what is there. Where a change of its own waits, that comes
// first.
void Session::pull(const Message& message) {
  wire::Pulled out{};
  out.slot = wire::no_slot;
  const std::string asked = text_of(message.as<wire::Target>().name);
  take_moves();
  const auto is_told = [this](const auto& edit) { return !held_.has(edit.first); };
  const auto next = std::find_if(edited_.begin(), edited_.end(), is_told);
  if (!asked.empty()) {
    if (held_.has(asked)) {
      out.state = wire::pulled_waiting;
      note_untold(asked);
    } else {
      tell_object(asked, out);
      edited_.erase(asked);
    }
  } else if (!refused_uploads_.empty()) {
    out.state = wire::pulled_data;
    out.object.shape = *refused_uploads_.begin();
    refused_uploads_.erase(refused_uploads_.begin());
  } else if (is_view_edited_ && held_.view == 0 && held_.all == 0) {
    out.state = wire::pulled_view;
    out.frame.frame = scene_->get_frame(nullptr);
    const std::vector<Vec3> points = scene_->get_tool();
    out.tool.count = points.size();
    std::copy(points.begin(), points.end(), out.tool.points);
    is_view_edited_ = false;
  } else if (next != edited_.end()) {
    tell_object(next->first, out);
    edited_.erase(next);
  }
  const bool is_all_told = refused_uploads_.empty() && (!is_view_edited_ || held_.view > 0 || held_.all > 0) &&
                           std::none_of(edited_.begin(), edited_.end(), is_told);
  if (is_all_told) edits_told_ = outbox_->edits.load(std::memory_order_relaxed);
  out.edits = edits_told_;
  reply(message.header.serial, bytes_of(&out, 1));
}

// An object as it is now, or that there is none.
void Session::tell_object(const std::string& name, wire::Pulled& out) {
  const auto found = objects_.find(name);
  if (found == objects_.end()) {
    const auto absent = absent_.find(name);
    const bool is_refused = absent != absent_.end() && absent->second.state == FS_OBJECT_REFUSED;
    out.state = is_refused ? wire::pulled_refused : wire::pulled_absent;
    put_text(out.object.name, name);
    return;
  }
  fs_object object;
  const Ref<const Object> kept = scene_->get(name.c_str(), object);
  out.object = offer(object);
  out.movement = to_record(scene_->movement(name.c_str()).motion);
  out.slot = found->second;
  out.state = wire::pulled_present;
}

// The record of an object with the numbers of its shape and curves: the client's own, or the server's, which it can fetch
// until it was told of some more.
wire::Object Session::offer(const fs_object& object) {
  constexpr size_t most_offered = 8;
  wire::Object out = to_record(object);
  const auto id_of = [this](const fs_shape* shape, const fs_curve* curve) -> uint64_t {
    if (!shape && !curve) return 0;
    const auto own = upload_of_.find(shape ? static_cast<const void*>(shape) : curve);
    if (own != upload_of_.end()) return own->second;
    const uint64_t serial = shape ? shape->serial : curve->serial;
    if (!find_offer(serial)) {
      if (offered_.size() == most_offered) offered_.pop_front();
      offered_.push_back({serial, Ref<const Shape>::share(shape), Ref<const Curve>::share(curve)});
    }
    return serial | wire::of_server;
  };
  out.shape = id_of(object.shape, nullptr);
  out.front.curve = id_of(nullptr, object.front.curve);
  out.back.curve = id_of(nullptr, object.back.curve);
  return out;
}

// Copying a mesh takes a while: not on this thread.
void Session::fetch(const Message& message) {
  const Offer* const found = find_offer(message.as<wire::Fetch>().id & ~wire::of_server);
  if (!found) fail(FS_ERROR_NOT_FOUND, "the shape or curve is not there any more");
  struct Made {
    wire::Shape shape;
    wire::Curve curve;
    Descriptor data;
    fs_status status = FS_OK;
    std::string text;
  };
  const auto made = std::make_shared<Made>();
  auto work = [made, shape = found->shape, curve = found->curve](Wanted&) {
    try {
      if (shape) {
        made->shape = to_record(*shape, made->data);
        made->shape.id |= wire::of_server;
      } else {
        made->curve = to_record(*curve, made->data);
        made->curve.id |= wire::of_server;
      }
    } catch (Error& error) {
      made->status = error.status;
      made->text = std::move(error.text);
    } catch (...) {
      made->status = FS_ERROR_MEMORY;
    }
  };
  const bool is_shape = bool(found->shape);
  const auto& [number, shape, curve] = *found;
  const uint64_t bytes = shape            ? shape->points.size() * sizeof(Vec3) + shape->triangles.size() * sizeof(uint32_t)
                         : curve->table() ? curve->table()->size() * sizeof(double)
                                          : 0;
  server_.worker(bytes).add(id_, {std::move(work), [server = &server_, session = id_, serial = message.header.serial, made,
                                               is_shape] {
    const std::shared_ptr<Session> found = server->find(session);
    if (!found) return;
    if (made->status == FS_OK) {
      found->reply(serial, is_shape ? bytes_of(&made->shape, 1) : bytes_of(&made->curve, 1), made->data.get());
    } else {
      found->reply_failure(serial, made->status,
                           made->text.empty() ? "the server has not enough memory for the shape" : made->text);
    }
    found->finish_job();
  }});
  ++jobs_;
  regulate();
}

// Answers once ticks have used every scene's changes: a client may have edited any of them.
void Session::settle_syncs() {
  if (syncs_.empty() || !parked_.empty() || !waiting_requests_.empty()) return;
  std::vector<Sync> syncs = std::exchange(syncs_, {});
  for (Sync& sync : syncs) {
    if (first_refused_) {
      const auto [status, text] = *std::exchange(first_refused_, std::nullopt);
      reply_failure(sync.serial, status, text);
      continue;
    }
    const LocalScene& own = *server_.servo().scene();
    const auto is_applying = [](const auto& session) { return session->is_applying_; };
    const bool are_all_posted = std::none_of(server_.sessions().begin(), server_.sessions().end(), is_applying);
    if (!sync.has_begun && !(are_moves_taken_ && are_all_posted)) {  // what came before it is not in the snapshots yet
      syncs_.push_back(std::move(sync));
      continue;
    }
    if (!std::exchange(sync.has_begun, true)) {
      sync.own = own.sequence();
      for (const std::shared_ptr<Session>& other : server_.sessions()) {
        if (!other->is_gone_ && other->scene_) sync.wanted.emplace_back(other, other->scene_->sequence());
      }
    }
    std::erase_if(sync.wanted, [](const auto& wanted) {
      const std::shared_ptr<const Session> other = wanted.first.lock();
      return !other || other->is_gone_ || other->scene_->output->used.load(std::memory_order_acquire) >= wanted.second;
    });
    if (sync.wanted.empty() && own.output->used.load(std::memory_order_acquire) >= sync.own) {
      reply(sync.serial);
    } else {
      syncs_.push_back(std::move(sync));
    }
  }
}

// ----------------------------------------------------------------------------------------------------------- reports

fs_report Session::own_report(const std::string& name) const {
  const auto absent = absent_.find(name);
  if (absent != absent_.end()) return report_of(name, absent->second.primitive, absent->second.state);
  return scene_->report(name.c_str());
}

// What became of all objects, those of one client first.
class ReportList final : public List {
 public:
  struct Part {
    Part(std::string the_prefix, const Ref<LocalScene>& scene) : prefix(std::move(the_prefix)), moment(scene, false) {}
    const std::string prefix;  // empty: the client's own
    const LocalScene::Moment moment;
    std::vector<fs_report> absent;  // by bare names
  };
  std::deque<Part> parts;
  fs_frame frame;  // of the client

  size_t most() const override {
    size_t sum = 0;
    for (const Part& part : parts) sum += part.moment.most() + part.absent.size();
    return sum;
  }

 private:
  void write() override {
    for (const Part& part : parts) {
      const auto add = [&](const fs_report& report) {
        if (part.prefix.empty()) return add_record(report);
        fs_report seen = seen_from(report, part.moment.frame(), frame);
        put_text(seen.name, part.prefix + report.name);
        add_record(seen);
      };
      part.moment.for_each_report(add);
      for (const fs_report& report : part.absent) add(report);
    }
  }
  void release() override { parts.clear(); }
};

void Session::tell_reports(const Message& message) {
  const auto list = std::make_shared<ReportList>();
  const auto add = [&](const std::string& prefix, const Session& session) {
    ReportList::Part& part = list->parts.emplace_back(prefix, session.scene_);
    for (const auto& [name, absent] : session.absent_) {
      part.absent.push_back(report_of(name, absent.primitive, absent.state));
    }
  };
  list->frame = scene_->get_frame(nullptr);
  add("", *this);
  list->parts.emplace_back("server/", server_.servo().scene());
  for (const std::shared_ptr<Session>& other : server_.sessions()) {
    if (other.get() != this && !other->is_gone_ && other->scene_) add(other->name_ + "/", *other);
  }
  tell_list(message.header.serial, list);
}

fs_client Session::describe() const {
  fs_client out{};
  put_text(out.name, name_);
  out.process = static_cast<uint32_t>(peer_.process);
  out.user = peer_.user;
  out.objects = static_cast<uint32_t>(objects_.size());
  out.connected = connected_;
  out.force_limit = server_.settings().limits.force;
  out.wrench = channel_->wrench();
  out.moves = moves_;
  out.changes = changes_;
  out.refused = refused_;
  out.limited = channel_->limited();
  out.shape_bytes = shape_bytes_->load();
  return out;
}

}  // namespace fs
