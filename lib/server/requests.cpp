// What a client asks, and what it is told of others.
#include <unistd.h>

#include <algorithm>
#include <cstring>

#include "base/error.h"
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
  // It does not read: it cannot be told anything any more. Data are memory and a descriptor on their way, so not much of it.
  constexpr size_t most_unread = 8192;
  const bool is_deaf = descriptor >= 0 && unread(socket_) > most_unread;
  const Transfer transfer = is_deaf ? Transfer::closed : send_message(socket_, parts, descriptors);
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
  object = slash == std::string::npos ? text : text.substr(slash + 1);
  owner = client == "server" ? nullptr : server_.find(client);
  if (client != "server" && !owner) {
    fail(FS_ERROR_NOT_FOUND, "name is '%.120s': no client '%.60s' is connected", text.c_str(), client.c_str());
  }
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
      case type_edit: return edit(message);
      case type_get: {
        LocalScene& scene = target(message.as<Target>(), false, owner, name);
        if (owner) owner->take_moves();
        fs_object object;
        const Ref<const ::fs::Object> kept = scene.get(name.c_str(), object);
        const wire::Object record = offer(object);
        return reply(serial, bytes_of(&record, 1));
      }
      case type_move_other: {
        const MoveOther& move = message.as<MoveOther>();
        LocalScene& scene = target(move.target, true, owner, name);
        if (owner) owner->take_moves();  // what it has moved before
        scene.move(name.c_str(), move.pose, move.has_twist ? &move.twist : nullptr, move.time);
        tell_edit(scene, owner, name, false);
        return reply(serial);
      }
      case type_remove_other: {
        LocalScene& scene = target(message.as<Target>(), true, owner, name);
        if (owner) owner->take_moves();
        scene.remove(name.c_str());
        tell_edit(scene, owner, name, true);
        return reply(serial);
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
      case type_reports: {
        const std::vector<fs_report> list = reports();
        const Descriptor blob = make_blob({bytes_of(list.data(), list.size())});
        const Count count{list.size()};
        return reply(serial, bytes_of(&count, 1), blob.get());
      }
      case type_clients: {
        const std::vector<fs_client> list = server_.describe();
        const Descriptor blob = make_blob({bytes_of(list.data(), list.size())});
        const Count count{list.size()};
        return reply(serial, bytes_of(&count, 1), blob.get());
      }
      case type_view: {
        const std::string client = text_of(message.as<Target>().name);
        owner = server_.find(client);
        if (!owner && client != "server") {
          fail(FS_ERROR_NOT_FOUND, "client is '%.80s': no client of that name is connected", client.c_str());
        }
        Frame frame{(owner ? *owner->scene_ : *server_.servo().scene()).get_frame(nullptr)};
        if (owner == this) {  // as it was said, where that waits for a shape still
          for (const Unit& unit : parked_) {
            for (const Message& waiting : unit.messages) {
              if (waiting.header.type == type_frame) frame = waiting.as<Frame>();
            }
          }
        }
        return reply(serial, bytes_of(&frame, 1));
      }
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
    refused_ += message.header.type == type_move_other || message.header.type == type_remove_other;
    if (error.status == FS_ERROR_NOT_FOUND && !name.empty()) {
      const std::string client = owner ? owner->name_ : "server";
      return reply_failure(serial, error.status, "name is '" + client + "/" + name + "': there is no such object");
    }
    reply_failure(serial, error.status, error.text);
  }
}

// Parts of another client's object. It waits until shapes that came with it are built.
void Session::edit(const Message& message) {
  const wire::Edit& edit = message.as<wire::Edit>();
  try {
    for (const uint64_t id : {edit.object.shape, edit.object.front.curve, edit.object.back.curve}) {
      const auto found = uploads_.find(id);
      if (found == uploads_.end() || found->second.is_ready) continue;
      constexpr size_t most = 64;
      if (waiting_edits_.size() >= most) fail(FS_ERROR_FULL, "%zu changes of this client wait for shapes already", most);
      waiting_edits_.push_back(message);
      return;
    }
    Session* owner;
    std::string name;
    LocalScene& scene = target(edit.target, true, owner, name);
    if (owner) owner->take_moves();
    if (edit.parts > UINT32_MAX) {
      fail(FS_ERROR_INVALID, "parts is 0x%llx, must be of the fs_part bits", static_cast<unsigned long long>(edit.parts));
    }
    const auto parts = static_cast<uint32_t>(edit.parts);
    fs_object present;
    const Ref<const Object> kept = scene.get(name.c_str(), present);
    fs_object object = resolve(edit.object, parts, &present);
    put_text(object.name, name);
    scene.change(object, parts);
    tell_edit(scene, owner, name, false);
    reply(message.header.serial);
  } catch (const Error& error) {
    ++refused_;
    reply_failure(message.header.serial, error.status, error.text);
  }
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

// What it sent and was refused, one by one; then the next of its own objects that others have changed. Where changes of
// its own wait, they come first.
void Session::pull(const Message& message) {
  take_moves();
  wire::Pulled out{};
  const auto is_told = [this](const auto& edit) { return held_.all == 0 && !held_.slots.contains(edit.first); };
  if (!refused_uploads_.empty()) {
    out.state = 3;
    out.object.shape = *refused_uploads_.begin();
    refused_uploads_.erase(refused_uploads_.begin());
    out.edits = edits_told_;
    return reply(message.header.serial, bytes_of(&out, 1));
  }
  if (const auto next = std::find_if(edited_.begin(), edited_.end(), is_told); next != edited_.end()) {
    out.slot = next->first;
    edited_.erase(next);
    const std::string& name = slots_[out.slot].name;
    if (name.empty()) {
      out.state = 2;
    } else {
      fs_object object;
      const Ref<const Object> kept = scene_->get(name.c_str(), object);
      out.object = offer(object);
      out.state = 1;
    }
  }
  if (std::none_of(edited_.begin(), edited_.end(), is_told)) edits_told_ = outbox_->edits.load(std::memory_order_relaxed);
  out.edits = edits_told_;
  reply(message.header.serial, bytes_of(&out, 1));
}

// The record of an object with the numbers of its shape and curves: the client's own, or the server's, which it can fetch
// until it is told of the next object.
wire::Object Session::offer(const fs_object& object) {
  offered_.clear();
  wire::Object out = to_record(object);
  const auto id_of = [this](const fs_shape* shape, const fs_curve* curve) -> uint64_t {
    if (!shape && !curve) return 0;
    for (const auto& [id, upload] : uploads_) {
      if (shape ? upload.shape.get() == shape : upload.curve.get() == curve) return id;
    }
    const uint64_t serial = shape ? shape->serial : curve->serial;
    offered_[serial] = {Ref<const Shape>::share(shape), Ref<const Curve>::share(curve)};
    return serial | wire::of_server;
  };
  out.shape = id_of(object.shape, nullptr);
  out.front.curve = id_of(nullptr, object.front.curve);
  out.back.curve = id_of(nullptr, object.back.curve);
  return out;
}

// Copying a mesh takes a while: not on this thread.
void Session::fetch(const Message& message) {
  const auto found = offered_.find(message.as<wire::Fetch>().id & ~wire::of_server);
  if (found == offered_.end()) fail(FS_ERROR_NOT_FOUND, "the shape or curve is not there any more");
  struct Made {
    wire::Shape shape;
    wire::Curve curve;
    Descriptor data;
    fs_status status = FS_OK;
    std::string text;
  };
  const auto made = std::make_shared<Made>();
  auto work = [made, shape = found->second.first, curve = found->second.second](Wanted&) {
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
  const bool is_shape = bool(found->second.first);
  const auto& [shape, curve] = found->second;
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

// Answers those who wait until a tick has used all that they did: of whatever scene, so of all.
void Session::settle_syncs() {
  if (syncs_.empty() || !parked_.empty() || !waiting_edits_.empty()) return;
  std::vector<Sync> syncs = std::exchange(syncs_, {});
  for (Sync& sync : syncs) {
    if (first_refused_) {
      const auto [status, text] = *std::exchange(first_refused_, std::nullopt);
      reply_failure(sync.serial, status, text);
      continue;
    }
    const LocalScene& own = *server_.servo().scene();
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

std::vector<fs_report> Session::own_reports() const {
  std::vector<fs_report> out = scene_->reports();
  for (const auto& [slot, absent] : absent_) out.push_back(report_of(absent.name, absent.primitive, absent.state));
  return out;
}

fs_report Session::own_report(const std::string& name) const {
  if (!slot_of_.contains(name)) {
    for (const auto& [slot, absent] : absent_) {
      if (absent.name == name) return report_of(name, absent.primitive, absent.state);
    }
  }
  return scene_->report(name.c_str());
}

// Of all objects, its own first.
std::vector<fs_report> Session::reports() {
  std::vector<fs_report> out = own_reports();
  const fs_frame here = scene_->get_frame(nullptr);
  const auto add = [&](const std::string& client, const std::vector<fs_report>& reports, const fs_frame& frame) {
    for (const fs_report& report : reports) {
      fs_report seen = seen_from(report, frame, here);
      put_text(seen.name, client + "/" + report.name);
      out.push_back(seen);
    }
  };
  const Ref<LocalScene>& own = server_.servo().scene();
  add("server", own->reports(), own->get_frame(nullptr));
  for (const std::shared_ptr<Session>& other : server_.sessions()) {
    if (other.get() == this || other->is_gone_ || !other->scene_) continue;
    add(other->name_, other->own_reports(), other->scene_->get_frame(nullptr));
  }
  return out;
}

fs_client Session::describe() const {
  fs_client out{};
  put_text(out.name, name_);
  out.process = static_cast<uint32_t>(peer_.process);
  out.user = peer_.user;
  out.objects = static_cast<uint32_t>(slot_of_.size());
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
