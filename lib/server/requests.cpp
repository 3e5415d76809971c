#include "server/requests.h"

#include <unistd.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "server/clients.h"
#include "server/foreign.h"
#include "server/lists.h"
#include "transfer/records.h"

namespace fs {
namespace {

// Calls f(target). Where that finds no such object, the error says the object's whole name.
template <class F>
void with_object(const TargetObject& target, F&& f) {
  try {
    f(target);
  } catch (const Error& error) {
    if (error.status != FS_ERROR_NOT_FOUND) throw;
    throw Error{error.status, "name is '" + target.full_name() + "': there is no such object"};
  }
}

}  // namespace

void Requests::add_to(Claim& claim, const Change& request) {
  using namespace wire;
  switch (request.type) {
    case type_reports:
    case type_motions:
    case type_motions_since:
    case type_clients:
    case type_views: claim.is_about_all = true; break;
    case type_get:
    case type_report:
    case type_view: {
      const std::string target = text_of(request.as<Target>().name);
      claim.others.emplace(target.substr(0, target.find('/')));
      break;
    }
    default: break;
  }
}

void Requests::handle(const Request& request) {
  try {
    answer(request);
  } catch (const NotOffered& error) {
    client_.refused += request.content.is_foreign();
    client_.answers.refuse(request.serial, error.status, error.text, wire::reason_not_offered);
  } catch (const Error& error) {
    refuse(request, error);
  }
}

void Requests::refuse(const Request& request, const Error& error) {
  client_.refused += request.content.is_foreign();
  client_.answers.refuse(request.serial, error.status, error.text);
}

void Requests::answer(const Request& request) {
  using namespace wire;
  const Host& host = client_.host;
  switch (request.content.type) {
    case type_sync: return syncs_.add(request.serial);
    case type_pull: return pull(request);
    case type_fetch: return fetch(request);
    case type_change:
    case type_place:
    case type_remove: return change_foreign(request);
    case type_get: return get(request);
    case type_report: return report(request);
    case type_reports: return answer_reports(client_, request.serial);
    case type_clients: return answer_clients(client_, request.serial);
    case type_views: return answer_views(client_, request.serial);
    case type_view: return view(request);
    case type_motions: return answer_motions(client_, request.serial, text_of(request.as<Target>().name));
    case type_motions_since: return answer_motions_since(client_, request.serial, request.as<Since>());
    case type_stats: {
      fs_servo_stats stats = fs_servo_stats_init();
      host.servo().get_stats(stats);
      return client_.answers.send_record(request.serial, stats);
    }
    case type_device: {
      fs_device_info info = fs_device_info_init();
      host.servo().get_device_info(info);
      return client_.answers.send_record(request.serial, info);
    }
    case type_record: return answer_record(client_, request.serial, request.as<After>().number);
    case type_stop_force: return stop_force(request);
    case type_resume_force: return resume_force(request);
    default: return;
  }
}

void Requests::stop_force(const Request& request) {
  const Host& host = client_.host;
  if (host.settings().is_force_kept) {
    client_.tell_server(FS_ERROR_DENIED, "wanted to stop all force, which this server does not let it");
    fail(FS_ERROR_DENIED, "this server does not let a client end the force");
  }
  host.servo().set_enabled(false);
  tell_all("stopped all force");
  client_.answers.send(request.serial);
}

void Requests::resume_force(const Request& request) {
  if (client_.peer.user != geteuid() && client_.peer.user != 0) {
    fail(FS_ERROR_DENIED, "this server is user %s's, who alone lets the force return", name_of_user(geteuid()).c_str());
  }
  Servo& servo = client_.host.servo();
  fs_servo_stats before = fs_servo_stats_init();
  servo.get_stats(before);
  servo.set_enabled(true);
  if (!before.enabled || before.faults) tell_all("let the force return");
  client_.answers.send(request.serial);
}

void Requests::tell_all(const char* text) const noexcept {
  const fs_event event = client_.what_it_did(FS_OK, text);
  client_.host.servo().scene()->note(event);
  client_.host.clients().for_each([&](const std::shared_ptr<Client>& client) { client->push_event(event); });
}

// ------------------------------------------------------------------------------------------------- objects of others

void Requests::change_foreign(const Request& request) {
  with_object(find_foreign(client_, request.content.name()), [&](const TargetObject& target) {
    ForeignGroup group(target);
    group.add(client_, request.content, target.name);
    group.commit();
    group.tell(client_);
  });
  client_.answers.send(request.serial);
}

// Gives the object as it is felt, without changes of a group that is open in its scene.
void Requests::get(const Request& request) {
  with_object(find_target(client_, text_of(request.as<wire::Target>().name)), [&](const TargetObject& target) {
    if (target.owner) target.owner->take_moves();
    fs_object object;
    const Ref<const Object> kept = target.scene->get(target.name.c_str(), object, false);
    client_.answers.send_record(request.serial, client_.assets.offer(object));
  });
}

void Requests::report(const Request& request) {
  with_object(find_target(client_, text_of(request.as<wire::Target>().name)), [&](const TargetObject& target) {
    fs_report report = target.owner ? target.owner->report(target.name) : target.scene->report(target.name.c_str(), false);
    if (target.owner.get() != &client_) {
      report = seen_from(report, target.scene->view(false).frame, client_.scene->view(false).frame);
      put_text(report.name, target.full_name());
    }
    client_.answers.send_record(request.serial, report);
  });
}

void Requests::view(const Request& request) {
  const std::shared_ptr<Client> owner = find_client(client_, text_of(request.as<wire::Target>().name));
  client_.answers.send_record(request.serial, view_seen_by(client_, owner.get()));
}

// -------------------------------------------------------------------------------------------- what the client must know

// Tells one thing of which the client may believe something else than what is there.
void Requests::pull(const Request& request) {
  Names& names = client_.names;
  const ParkedBatches& parked = client_.parked;
  wire::PullAnswer out{};
  out.slot = wire::no_slot;
  const std::string asked = text_of(request.as<wire::Target>().name);
  client_.take_moves();
  if (!asked.empty()) {
    if (parked.holds_up(asked)) {
      out.state = wire::pulled_waiting;
      put_text(out.object.name, asked);
      client_.note_untold(asked);
    } else {
      tell_object(asked, out);
      names.note_told(asked);
    }
  } else if (const uint64_t refused = client_.assets.take_refused()) {
    out.state = wire::pulled_asset;
    out.object.shape = refused;
  } else if (!parked.holds_up_view() && std::exchange(client_.is_view_untold, false)) {
    out.state = wire::pulled_view;
    out.frame.frame = client_.scene->get_frame(nullptr);
    const std::vector<Vec3> points = client_.scene->get_tool();
    out.tool_radius.radius = client_.scene->get_tool_radius();
    out.tool.count = points.size();
    std::copy(points.begin(), points.end(), out.tool.points);
  } else if (const std::string* const next = names.next_untold(parked)) {
    const std::string name = *next;
    tell_object(name, out);
    names.note_told(name);
  }
  const bool is_view_told = !client_.is_view_untold || parked.holds_up_view();
  if (!client_.assets.has_refused() && is_view_told && !names.next_untold(parked)) {
    told_ = client_.outbox->news.load(std::memory_order_relaxed);
  }
  out.news = told_;
  client_.answers.send_record(request.serial, out);
}

// Tells an object as it is now, or that there is none.
void Requests::tell_object(const std::string& name, wire::PullAnswer& out) {
  const NameRecord* const record = client_.names.find(name);
  if (!record || !record->is_there) {
    const bool is_refused = record && record->absent && record->absent->state == FS_OBJECT_REFUSED;
    out.state = is_refused ? wire::pulled_refused : wire::pulled_absent;
    put_text(out.object.name, name);
    return;
  }
  fs_object object;
  const Ref<const Object> kept = client_.scene->get(name.c_str(), object);
  out.object = client_.assets.offer(object);
  out.motion = to_record(client_.scene->movement(name.c_str()).motion);
  out.slot = record->slot;
  out.state = wire::pulled_present;
}

// A worker packs it: copying a mesh takes a while.
void Requests::fetch(const Request& request) {
  const Asset* const found = client_.assets.find_offer(request.as<wire::Fetch>().id & ~wire::of_server);
  if (!found) fail(FS_ERROR_NOT_FOUND, "the shape, curve or surface no longer exists");
  struct Outcome {
    PackedAsset packed;
    Error error{FS_OK, ""};
  };
  const auto outcome = std::make_shared<Outcome>();
  auto work = [outcome, asset = *found](StopToken&) {
    try {
      outcome->packed = pack(asset);
      outcome->packed.id() |= wire::of_server;
    } catch (Error& error) {
      outcome->error = std::move(error);
    } catch (...) {
      outcome->error.status = FS_ERROR_MEMORY;
    }
  };
  client_.host.start_job(client_, found->bytes(), std::move(work), [this, serial = request.serial, outcome] {
    const PackedAsset& packed = outcome->packed;
    const auto& [status, text] = outcome->error;
    if (status == FS_OK) {
      client_.answers.send(serial, packed.record(), packed.content.get());
    } else {
      client_.answers.refuse(serial, status, text.empty() ? "the server has not enough memory for the shape" : text);
    }
  });
}

}  // namespace fs
