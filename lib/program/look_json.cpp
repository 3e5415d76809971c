// The JSON of forceserver watch and clients: SI units, and names as in the headers.
#include "json.h"
#include "look.h"
#include "words.h"

namespace {

// The report's name is "client/object". Only a scene's own objects have names without a client, and this program has
// no objects of its own.
Json to_json(const fs_report& report) {
  const std::string name = report.name;
  const std::size_t slash = name.find('/');
  return {{"client", name.substr(0, slash)},
          {"name", slash == name.npos ? "" : name.substr(slash + 1)},
          {"primitive", word_of(fs_primitive_name(report.primitive))},
          {"state", word_of(fs_object_state_name(report.state))},
          {"revision", report.revision},
          {"weight", report.weight},
          {"distance", report.distance},
          {"point", to_json(report.point)},
          {"force", to_json(report.wrench.force)},
          {"torque", to_json(report.wrench.torque)},
          {"stiffness_wanted", report.stiffness_wanted},
          {"stiffness_applied", report.stiffness_applied},
          {"shares_with", report.shares_with}};
}

Json to_json(const fs_event& event) {
  return {{"kind", word_of(fs_event_kind_name(event.kind))},
          {"time", event.time},
          {"status", fs_status_name(event.status)},
          {"value", event.value},
          {"name", event.name},
          {"text", event.text}};
}

Json fault_words(std::uint32_t faults) {
  Json words = Json::array();
  for (; faults; faults &= faults - 1) words.push_back(word_of(fs_fault_name(faults)));
  return words;
}

Json to_json(const fs_servo_stats& s, const Ticks& ticks) {
  return {{"rate", s.rate},
          {"ticks", s.ticks},
          {"misses", s.misses},
          {"guarded", s.guarded},
          {"device_errors", s.device_errors},
          {"new_ticks", ticks.all},
          {"new_misses", ticks.missed},
          {"new_guarded", ticks.guarded},
          {"late_p50", s.late_p50},
          {"late_p99", s.late_p99},
          {"late_max", s.late_max},
          {"compute_p50", s.compute_p50},
          {"compute_p99", s.compute_p99},
          {"compute_max", s.compute_max},
          {"max_stiffness", s.max_stiffness},
          {"delay", s.delay},
          {"link_delay_p50", s.link_delay_p50},
          {"link_delay_p99", s.link_delay_p99},
          {"link_rate", s.link_rate},
          {"link_loss", s.link_loss},
          {"enabled", s.enabled != 0},
          {"faults", fault_words(s.faults)}};
}

}  // namespace

Json to_json(const fs_vec3& v) { return {v.x, v.y, v.z}; }

Json to_json(const fs_client& client, double now) {
  const bool is_server = client.name == std::string_view("server");
  return {{"name", client.name},
          {"process", client.process},
          {"user", client.user},
          {"connected_for", is_server ? Json(nullptr) : Json(now - client.connected)},
          {"objects", client.objects},
          {"force", to_json(client.wrench.force)},
          {"torque", to_json(client.wrench.torque)},
          {"force_limit", client.force_limit},
          {"limited", client.limited},
          {"moves", client.moves},
          {"changes", client.changes},
          {"refused", client.refused},
          {"shape_bytes", client.shape_bytes}};
}

std::string dump(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);  // a driver's text may not be UTF-8
}

std::string to_json(const Look& now, const Look& before) {
  Json clients = Json::array(), objects = Json::array(), events = Json::array();
  for (const fs_client& client : now.clients) {
    Json entry = to_json(client, now.time);
    const Rates rates = rates_of(client, now, before);
    entry["moves_per_second"] = rates.moves;
    entry["changes_per_second"] = rates.changes;
    clients.push_back(std::move(entry));
  }
  for (const fs_report& report : now.objects) objects.push_back(to_json(report));
  for (const fs_event& event : now.events) events.push_back(to_json(event));
  const fs_quat& q = now.hand.pose.orientation;
  return dump({{"endpoint", now.endpoint},
               {"time", now.time},
               {"device", {{"name", now.device.name}, {"force_max", now.device.force_max}}},
               {"hand",
                {{"position", to_json(now.hand.pose.position)},
                 {"orientation", {q.w, q.x, q.y, q.z}},
                 {"velocity", to_json(now.hand.twist.linear)},
                 {"buttons", now.hand.buttons},
                 {"ready", (now.hand.flags & FS_STATE_READY) != 0}}},
               {"sent",
                {{"force", to_json(now.sent.force)},
                 {"torque", to_json(now.sent.torque)},
                 {"guarded", (now.response.flags & FS_RESPONSE_GUARDED) != 0}}},
               {"servo", to_json(now.servo, ticks_of(now, before))},
               {"clients", clients},
               {"objects", objects},
               {"events", events}});
}
