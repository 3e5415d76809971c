#include "device/haply/inverse.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>

#include "device/support/clock.h"
#include "device/support/refusal.h"

namespace fs::haply {
namespace {

constexpr double open_within = 2;      // s, for each of the first two messages
constexpr double answer_within = 0.018;  // s: receive returns within 20 ms
constexpr double take_within = 0.003;    // s: send returns within 5 ms
constexpr double quiet_after = 0.2;      // s without a state: status says so
constexpr double send_zero_again_after = 0.2;  // s: long enough for a slow service to take one message
constexpr double silent_after = 1;       // s without a state that can be used: the device is lost, and opened again
constexpr double end_within = 0.25;     // s, for the answer to the last force, which is 0
constexpr double farthest = 1, fastest = 20;  // m, m/s: what is beyond is not believed

double norm(fs_vec3 v) { return std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z); }
bool is_none(fs_vec3 v) { return v.x == 0 && v.y == 0 && v.z == 0; }

std::string ids_of(const auto& devices) {
  std::string text;
  for (const auto& device : devices) text += (text.empty() ? "'" : ", '") + device.id.substr(0, 40) + "'";
  return text.empty() ? "none" : text.substr(0, 300);
}

// The index that a short number means; nothing: it is none.
std::optional<size_t> index_of(const std::string& text) {
  size_t index = 0;
  const char* const end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, index);
  return parsed.ec == std::errc() && parsed.ptr == end ? std::optional(index) : std::nullopt;
}

void append_filter(std::string& out, const char* name, const std::optional<double>& value) {
  char text[60];
  std::snprintf(text, sizeof text, "%s%s %.4g", out.empty() ? "" : ", ", name, value.value_or(0));
  if (value) out += text;
}

}  // namespace

Message inventory_of(Service& service) {
  std::string_view text;
  const fs_status status = service.receive(open_within, text);
  if (status != FS_OK) refuse(FS_ERROR_IO, "the Haply Inverse Service does not tell within 2 s which devices it has");
  Message inventory;
  if (const char* const trouble = read_message(text, inventory)) refuse(FS_ERROR_IO, "the Haply Inverse Service: %s", trouble);
  return inventory;
}

void ForceCheck::note(double now, fs_vec3 sent, fs_vec3 told) noexcept {
  constexpr double span = 0.5, least = 0.2;  // s, N: below that, rounding counts
  sent_ = {sent_.x + sent.x, sent_.y + sent.y, sent_.z + sent.z};
  told_ = {told_.x + told.x, told_.y + told.y, told_.z + told.z};
  ++count_;
  if (now - since_ < span) return;
  const fs_vec3 difference{sent_.x - told_.x, sent_.y - told_.y, sent_.z - told_.z};
  differs_ = norm(difference) > 0.2 * std::max(norm(sent_), least * count_);
  since_ = now;
  sent_ = told_ = {};
  count_ = 0;
}

// ------------------------------------------------------------------------------------------------------------------ opening

Inverse::Inverse(const Address& address)
    : force_max_(address.number("force", 0.1, 20).value_or(5)), period_(1 / address.number("rate", 100, 4000).value_or(1000)),
      host_(address.text("host").value_or(default_host)), port_(std::to_string(address.whole("port", 1, 65535).value_or(10001))) {
  const auto dialect = address.choice("dialect", {"3.4", "3.5"});
  version_ = version_in(version_answer(host_, port_));
  dialect_ = dialect ? (*dialect == 0 ? Dialect::values : Dialect::vector) : dialect_of_version(version_);
  service_.emplace(host_, port_);
  const Message inventory = inventory_of(*service_);
  orientation_.w = 1;
  choose_arm(inventory, address.place());
  choose_grip(inventory, address);
  set_up();
}

void Inverse::choose_arm(const Message& inventory, const std::string& place) {
  const Arm* chosen = nullptr;
  for (const Arm& arm : inventory.arms) {
    if (arm.id == place) chosen = &arm;
  }
  if (const auto index = index_of(place); !chosen && index && *index < inventory.arms.size()) chosen = &inventory.arms[*index];
  if (!chosen) {
    refuse(FS_ERROR_NOT_FOUND, "the Haply Inverse Service has no device '%.60s'; it has: %s", place.c_str(),
           ids_of(inventory.arms).c_str());
  }
  if (chosen->is_in_use.value_or(false)) {
    refuse(FS_ERROR_IO, "the Haply device '%.60s' is in use by another session of the service; end that first",
           chosen->id.c_str());
  }
  id_ = chosen->id;
  kind_ = chosen->kind;
  check_frame(*chosen);
  note_filters(*chosen);
}

void Inverse::choose_grip(const Message& inventory, const Address& address) {
  const auto wanted = address.text("grip");
  if (!wanted && inventory.grips.size() == 1) grip_id_ = inventory.grips[0].id;
  if (!wanted) return;
  for (const Grip& grip : inventory.grips) {
    if (grip.id == *wanted) grip_id_ = grip.id;
  }
  if (grip_id_.empty()) {
    refuse(FS_ERROR_NOT_FOUND, "grip is '%.60s', but the Haply Inverse Service has no such grip; it has: %s", wanted->c_str(),
           ids_of(inventory.grips).c_str());
  }
}

// Asks for the origin in the middle of the workspace, and looks at what came of it.
void Inverse::set_up() {
  std::string_view text;
  fs_status status = service_->send(set_up_message(dialect_, id_), open_within);
  if (status == FS_OK) status = service_->receive(open_within, text);
  if (status != FS_OK) refuse(FS_ERROR_IO, "the Haply Inverse Service does not answer the first message within 2 s");
  fs_state state{};
  if (const char* const trouble = read_state(text, state)) refuse(FS_ERROR_IO, "the Haply Inverse Service: %s", trouble);
  for (const Arm& arm : message_.arms) {
    if (arm.id != id_) continue;
    check_frame(arm);
    note_filters(arm);
  }
  good_at_ = steady_now();
}

// Positions and forces must be those of the device.
void Inverse::check_frame(const Arm& arm) const {
  const auto check_scale = [](const char* name, const std::optional<fs_vec3>& scale) {
    if (!scale) return;
    const double off = std::max({std::fabs(scale->x - 1), std::fabs(scale->y - 1), std::fabs(scale->z - 1)});
    if (off > 1e-6) {
      refuse(FS_ERROR_UNSUPPORTED, "the scale of the device's %s is %.6g, %.6g, %.6g, must be 1: set it in Haply's dashboard",
             name, scale->x, scale->y, scale->z);
    }
  };
  check_scale("transform", arm.transform_scale);
  check_scale("mount", arm.mount_scale);
  if (!arm.basis.empty() && arm.basis != "XYZ") {
    refuse(FS_ERROR_UNSUPPORTED, "the basis of the device is '%.20s', must be XYZ: set it in Haply's dashboard",
           arm.basis.c_str());
  }
  if (const auto& turn = arm.transform_rotation; turn && std::fabs(turn->w) < 1 - 1e-6) {
    refuse(FS_ERROR_UNSUPPORTED, "the transform of the device is rotated (w is %.6g), must not be: set it in Haply's dashboard",
           turn->w);
  }
}

void Inverse::note_filters(const Arm& arm) {
  std::string text;
  if (arm.damping.value_or(0) != 0) append_filter(text, "damping", arm.damping);
  if (arm.force_scale.value_or(1) != 1) append_filter(text, "force scale", arm.force_scale);
  append_filter(text, "force gate", arm.force_gate);
  if (!text.empty()) filters_ = text;
}

Inverse::~Inverse() {
  const double until = steady_now() + end_within;
  sent_at_ = 0;  // so that 0 is sent even if it was sent a moment ago
  fs_status status = FS_OK;
  do status = ask({});
  while (status == FS_ERROR_TIMEOUT && steady_now() < until);  // the message before is still on its way
  std::string_view text;
  if (status == FS_OK) await_answers(until, text);
}

void Inverse::get_info(fs_device_info& out) const {
  const bool is_small = kind_ == "minverse";
  std::snprintf(out.name, sizeof out.name, "Haply %s", kind_.empty() || kind_ == "inverse3" ? "Inverse3" : kind_.c_str());
  std::snprintf(out.serial, sizeof out.serial, "%s", id_.c_str());
  out.force_axes = 3;
  out.workspace_radius = is_small ? 0.04 : 0.1;  // of the sphere in Haply's tutorials
  out.workspace_height = 2 * out.workspace_radius;
  out.force_max = force_max_;
  out.mass = 0.1;           // assumed, rather too small: a lighter handle is granted less stiffness
  out.resolution = 2e-5;    // assumed
  out.rate = 1 / period_;
  out.delay = 0.001;
}

// --------------------------------------------------------------------------------------------------------- states and forces

// While an answer is late nothing is sent but force 0, where a force must end, so that no messages queue. As nobody knows whether a
// service that does not answer has taken the 0, it is sent again from time to time.
fs_status Inverse::ask(fs_vec3 force) {
  const double now = steady_now();
  const bool is_zero_sent = is_none(sent_force_) && now - sent_at_ < send_zero_again_after;
  if (outstanding_ > 0 && (!is_none(force) || is_zero_sent)) return FS_ERROR_TIMEOUT;
  write_force(command_, dialect_, id_, force);
  const fs_status status = service_->send(command_, take_within);
  if (status != FS_OK) return status;
  ++outstanding_;
  ++sent_;
  sent_at_ = now;
  sent_force_ = force;
  return FS_OK;
}

fs_status Inverse::send(const fs_wrench& wrench) {
  const bool is_late = outstanding_ > 0;
  const fs_status status = ask(wrench.force);
  if (status == FS_OK || (is_late && is_none(wrench.force) && is_none(sent_force_))) return FS_OK;
  if (status == FS_ERROR_DISCONNECTED) return lost();
  return fs_fail(status, "the Haply Inverse Service has not yet answered the last force");
}

// Until each message has its answer: text is the newest.
fs_status Inverse::await_answers(double until, std::string_view& text) {
  do {
    const fs_status status = service_->receive(std::max(0.0, until - steady_now()), text);
    if (status != FS_OK) return status;
    ++answers_;
    outstanding_ = std::max(0, outstanding_ - 1);
  } while (outstanding_ > 0);
  return FS_OK;
}

// The state that answers the last force counts if the next one is due by then. Otherwise it would be old when it is used: another message
// asks for a new one when that is due. So a fast service does not take a whole processor, and a slow one is not asked twice.
fs_status Inverse::receive(fs_state& out) {
  const double until = steady_now() + answer_within;
  std::string_view text;
  fs_status status = outstanding_ > 0 ? await_answers(until, text) : FS_OK;
  if (const double rest = next_ - steady_now(); status == FS_OK && (text.empty() || rest > 0)) {
    if (rest > 0) pause(std::min(rest, period_));
    status = ask(sent_force_);
    if (status == FS_OK) status = await_answers(until, text);
  }
  const double now = steady_now();
  next_ = std::max(next_, now - period_) + period_;
  if (status != FS_OK) return without_answer(status, now);
  round_trip_ = now - sent_at_;
  meter_.note_state(now - round_trip_ / 2, period_);
  meter_.note_delay(round_trip_);
  const char* const trouble = read_state(text, out);
  if (trouble) return fs_fail(now - good_at_ > silent_after ? FS_ERROR_DISCONNECTED : FS_ERROR_IO, trouble);
  good_at_ = now;
  out.time = now - round_trip_ / 2;
  out.flags = flags();
  tell(out);
  return FS_OK;
}

fs_status Inverse::lost() {
  char text[300];
  std::snprintf(text, sizeof text, "the Haply Inverse Service is gone: %.200s", service_->trouble().c_str());
  return fs_fail(FS_ERROR_DISCONNECTED, text);
}

fs_status Inverse::without_answer(fs_status status, double now) {
  if (status == FS_ERROR_DISCONNECTED) return lost();
  if (now - good_at_ > silent_after) return fs_fail(FS_ERROR_DISCONNECTED, "the Haply Inverse Service does not answer");
  return status;
}

// Returns what is wrong, in words; null: nothing.
const char* Inverse::read_state(std::string_view text, fs_state& out) {
  if (const char* const trouble = read_message(text, message_)) return trouble;
  for (const Arm& arm : message_.arms) {
    if (arm.id == id_) return take_arm(arm, out);
  }
  return "the Haply Inverse Service no longer tells of this device";
}

const char* Inverse::take_arm(const Arm& arm, fs_state& out) {
  if (!arm.position) return "a state has no cursor_position of three finite numbers";
  if (norm(*arm.position) > farthest) return "the position of the device is not believed: it is more than 1 m from the origin";
  if (arm.velocity && norm(*arm.velocity) > fastest) return "the velocity of the device is not believed: it is above 20 m/s";
  const auto is_off = [](double scale) { return std::fabs(scale - 1) > 1e-6; };
  if (const auto& scale = arm.transform_scale; scale && (is_off(scale->x) || is_off(scale->y) || is_off(scale->z))) {
    return "the scale of the device's transform is no longer 1";
  }
  if (arm.transform_rotation && std::fabs(arm.transform_rotation->w) < 1 - 1e-6) {
    return "the transform of the device is rotated by now, which turns its forces";
  }
  is_calibrated_ = arm.is_calibrated.value_or(is_calibrated_);
  is_ready_ = arm.is_ready.value_or(is_ready_);
  has_power_ = arm.has_power.value_or(has_power_);
  if (arm.force) check_.note(steady_now(), sent_force_, *arm.force);
  out.pose.position = *arm.position;
  take_grip(out);
  return nullptr;
}

// A grip that is silent keeps its orientation: one that jumped would move the tool. Its buttons are released.
void Inverse::take_grip(fs_state& out) {
  has_grip_ = false;
  for (const Grip& grip : message_.grips) {
    if (grip_id_.empty() || grip.id != grip_id_) continue;
    has_grip_ = grip.orientation.has_value();
    orientation_ = grip.orientation.value_or(orientation_);
    buttons_ = grip.buttons;
  }
  out.pose.orientation = orientation_;
  out.buttons = has_grip_ ? buttons_ : 0;
}

uint32_t Inverse::flags() const noexcept {
  if (!has_power_) return FS_STATE_STOPPED;
  if (!is_calibrated_) return FS_STATE_NOT_HOMED;
  return is_ready_ ? FS_STATE_READY : FS_STATE_CONNECTING;
}

// Each message is answered by a state.
fs_status Inverse::get_link(fs_link& out) noexcept { return meter_.tell(steady_now(), {answers_, sent_, answers_}, out); }

// ----------------------------------------------------------------------------------------------------------------- requests

void Inverse::tell(const fs_state& state) {
  const std::unique_lock lock(told_mutex_, std::try_to_lock);
  if (lock) now_ = {state.flags, has_grip_, check_.differs(), round_trip_, state.time};
}

std::string Inverse::control(const std::string& request) {
  if (request != "status") {
    refuse(FS_ERROR_UNSUPPORTED, "a Haply Inverse3 has no request '%.60s'; its requests are: status", request.c_str());
  }
  Told told;
  {
    const std::lock_guard lock(told_mutex_);
    told = now_;
  }
  const char* condition = "it does not answer yet";
  if (told.flags & FS_STATE_READY) condition = "ready";
  if (told.flags & FS_STATE_STOPPED) condition = "its motors have no power";
  if (told.flags & FS_STATE_NOT_HOMED) condition = "not calibrated";
  if (told.flags & FS_STATE_CONNECTING && told.time > 0) condition = "the service says that the device is not ready";
  if (told.time > 0 && steady_now() - told.time > quiet_after) condition = "the service has fallen silent";
  const std::string grip = grip_id_.empty() ? "no grip" : "grip " + grip_id_ + (told.has_grip ? "" : " (silent)");
  char text[500];
  std::snprintf(text, sizeof text, "%s; service %.20s, messages of %s; %.20s %.40s, %.60s; round trip %.0f us; filters: %.100s%s",
                condition, version_.empty() ? "of unknown version" : version_.c_str(),
                dialect_ == Dialect::values ? "3.4" : "3.5", kind_.empty() ? "device" : kind_.c_str(), id_.c_str(), grip.c_str(),
                1e6 * told.round_trip, filters_.empty() ? "none are told" : filters_.c_str(),
                told.differs ? "; the force that the device gives differs from the force sent by more than a fifth" : "");
  return text;
}

}  // namespace fs::haply
