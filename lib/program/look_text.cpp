// The text of forceserver watch, for people.
#include <algorithm>
#include <ctime>

#include "look.h"
#include "words.h"

namespace {

std::string time_of_day() {
  const std::time_t now = std::time(nullptr);
  char text[16];
  std::strftime(text, sizeof text, "%T", std::localtime(&now));
  return text;
}

std::string rate(double per_second) { return format(per_second < 99.95 ? "%.1f" : "%.0f", per_second); }

std::string stiffness(const fs_report& report) {
  if (report.state == FS_OBJECT_PENDING || report.state == FS_OBJECT_REFUSED) return "-";
  if (!std::isfinite(report.stiffness_wanted)) {
    return std::isfinite(report.stiffness_applied) ? format("%.4g of infinite", report.stiffness_applied) : "jumps";
  }
  return is_capped(report) ? format("%.4g of %.4g", report.stiffness_applied, report.stiffness_wanted)
                           : format("%.4g", report.stiffness_wanted);
}

std::string state(const fs_report& report) {
  const bool is_over = report.state == FS_OBJECT_FADING && report.weight == 0;
  return is_over ? "expired" : word_of(fs_object_state_name(report.state));
}

std::string name_of(const std::string& endpoint) { return endpoint.substr(endpoint.find(':') + 1); }  // of the server

std::vector<std::string> head(const Look& now, const Look& before) {
  const fs_vec3 &x = now.hand.pose.position, &v = now.hand.twist.linear, &f = now.sent.force;
  const fs_servo_stats& s = now.servo;
  const Ticks ticks = ticks_of(now, before);
  using Count = unsigned long long;
  std::vector<std::string> lines;
  lines.push_back(format("%s  %s, which can give %g N  %s", now.endpoint.c_str(), now.device.name, now.device.force_max,
                         time_of_day().c_str()));
  lines.push_back(format("hand   %7.1f %7.1f %7.1f mm, %.0f mm/s%s", x.x * 1e3, x.y * 1e3, x.z * 1e3, length(v) * 1e3,
                         now.hand.flags & FS_STATE_READY ? "" : "; NOT READY"));
  std::string force = format("force  %7.2f %7.2f %7.2f N, %.2f N", f.x, f.y, f.z, length(f));
  if (ticks.guarded > 0) {
    force += format("; the servo changed it in %llu of %llu ticks%s", Count(ticks.guarded), Count(ticks.all),
                    now.response.flags & FS_RESPONSE_GUARDED ? ", also now" : "");
  }
  lines.push_back(force);
  const std::string stopped = s.enabled ? "" : "no force: it was stopped; " + how_to_resume(name_of(now.endpoint)) + "; ";
  lines.push_back("servo  " + stopped + "faults: " + fault_names(s.faults) +
                  format("; %.0f Hz, late p99 %.0f us, max %.0f us; %llu of %llu ticks missed", s.rate, s.late_p99 * 1e6,
                         s.late_max * 1e6, Count(ticks.missed), Count(ticks.all)));
  return lines;
}

std::vector<std::string> client_lines(const Look& now, const Look& before) {
  Table table({"client", "objects", "wants N", "moves/s", "changes/s", "refused", "limited"});
  for (const fs_client& client : now.clients) {
    const Rates rates = rates_of(client, now, before);
    table.add({client.name, std::to_string(client.objects), format("%.2f", length(client.wrench.force)), rate(rates.moves),
               rate(rates.changes), std::to_string(client.refused), std::to_string(client.limited)});
  }
  return table.lines();
}

std::vector<std::string> object_lines(const Look& now) {
  Table table({"object", "primitive", "state", "weight", "distance mm", "force N", "slope N/m", "shared with"});
  for (const fs_report& report : now.objects) {
    const bool is_near = std::isfinite(report.distance);
    table.add({report.name, word_of(fs_primitive_name(report.primitive)), state(report), format("%.2f", report.weight),
               is_near ? format("%.1f", report.distance * 1e3) : "-", is_near ? format("%.2f", length(report.wrench.force)) : "-",
               stiffness(report), report.shares_with});
  }
  return table.lines();
}

std::string event_line(const fs_event& event) {
  if (event.kind == FS_EVENT_DEVICE && event.status == FS_OK) return format("the device %s is ready", event.name);
  if (event.kind == FS_EVENT_DEVICE) {
    return format("the force stopped (%s): %s", event.name, stop_reason(event).c_str());
  }
  if (event.kind == FS_EVENT_OVERFLOW) return format("%.0f older events were dropped", event.value);
  return format("%s: %s %s", word_of(fs_event_kind_name(event.kind)).c_str(), event.name, event.text);
}

}  // namespace

std::vector<std::string> to_text(const Look& now, const Look& before) {
  std::vector<std::string> lines = head(now, before);
  for (const fs_event& event : now.events) lines.push_back(event_line(event));
  for (const auto& part : {client_lines(now, before), object_lines(now)}) {
    lines.push_back("");
    lines.insert(lines.end(), part.begin(), part.end());
  }
  return lines;
}
