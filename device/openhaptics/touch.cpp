#include "device/openhaptics/touch.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "base/futex.h"
#include "device/openhaptics/scheduler.h"
#include "device/support/clock.h"
#include "device/support/refusal.h"
#include "device/support/rotation.h"
#include "device/support/usb_seen.h"

namespace fs::openhaptics {
namespace {

constexpr uint16_t usb_vendor = 0x2988;
constexpr double period = 1e-3;        // s, of the callback
constexpr double command_age = 0.02;   // s, after which a force counts no more
constexpr double state_within = 0.015; // s, that receive waits
constexpr double silent_after = 0.5;   // s without a cycle: the thread of OpenHaptics has stopped
constexpr uint32_t lost_after = 50;    // cycles in which the device could not be reached
constexpr double look_every = 0.1;     // s, at the temperature
constexpr double update_every = 1;     // s, a calibration that fails is tried again
constexpr double error_counts = 0.5;   // s, for which an error that ends the force keeps it off
constexpr double largest_box = 5000;   // mm, a side of the workspace
constexpr double torque_max = 0.1;     // N m, of a handle with motors: CHAI3D states 0.188 for a Premium 6DOF
constexpr double farthest = 1;         // m, along each axis, of a position that can be

// x of OpenHaptics points to the right, its y up, its z to the user.
fs_vec3 to_device(double x, double y, double z) { return {x, -z, y}; }

std::string text_of(const char* text) { return text ? text : ""; }

// What a person looks at when a device does not open.
std::string advice() {
  std::string text = "; its name must be one that the maker's Touch_Setup has written into $GTDD_HOME or ~/.3dsystems";
  const std::vector<UsbSeen> seen = usb_seen(usb_vendor);
  if (seen.empty()) text += ", and no device of 3D Systems is on the USB";
  else if (!seen.front().may_open) text += ", and this user may not open it: " + usb_rule_advice("ATTR{idVendor}==\"2988\"");
  return text;
}

bool pushes(const fs_wrench& wrench) {
  const fs_vec3 f = wrench.force, t = wrench.torque;
  return f.x != 0 || f.y != 0 || f.z != 0 || t.x != 0 || t.y != 0 || t.z != 0;
}

}  // namespace

// ------------------------------------------------------------------------------------------------------------------- opening

Touch::Touch(const Address& address) : api_(load_api(address.text("library"))) {
  attach(api_, *this, [&] { initialise(address.place()); });
  heard_ = steady_now();
}

bool Touch::end() noexcept {
  is_ending_ = true;
  detach(api_, *this);
  return !is_in_run_;
}

// Called while the thread of OpenHaptics stands still.
void Touch::initialise(const std::string& name) {
  const std::string called = name.empty() ? "the default device of OpenHaptics" : "the device '" + name + "' of OpenHaptics";
  ErrorInfo error{};
  api_.take_errors(error);  // of others
  error = {};
  const char* const defaults[] = {nullptr, "Default Device", "Default PHANToM"};  // versions differ in what they take
  for (const char* each : defaults) {
    error = {};
    handle_ = api_.hdInitDevice(name.empty() ? each : name.c_str());
    const bool has_failed = api_.take_errors(error) > 0 || handle_ == no_handle;
    if (!has_failed) break;
    handle_ = no_handle;
    if (!name.empty() || error.code == already_initiated) break;
  }
  if (error.code == already_initiated || (handle_ != no_handle && is_attached(handle_))) {
    refuse(FS_ERROR_IO, "%s is in use by this program", called.c_str());
  }
  if (handle_ == no_handle) {
    refuse(FS_ERROR_NOT_FOUND, "%s cannot be opened: %s%s", called.c_str(), words_of(error).c_str(), advice().c_str());
  }
  api_.hdMakeCurrentDevice(handle_);
  name_ = text_of(api_.hdGetString(model_type));
  serial_ = text_of(api_.hdGetString(serial_number));
  double box[6] = {};
  int axes = 0;
  api_.hdGetDoublev(max_force, &force_max_);
  api_.hdGetDoublev(usable_workspace, box);
  api_.hdGetIntegerv(output_axes, &axes);
  api_.hdGetIntegerv(calibration_style, &style_);
  std::copy(box, box + 3, low_);
  std::copy(box + 3, box + 6, high_);
  has_torque_ = axes >= 6;
  api_.hdEnable(force_output);
  api_.hdEnable(force_clamping);
  bool is_box = true;
  for (int i = 0; i < 3; ++i) is_box = is_box && high_[i] - low_[i] > 1 && high_[i] - low_[i] < largest_box;  // NaN is none
  if (api_.take_errors(error) > 0 || !(force_max_ > 0 && force_max_ < 1000) || !is_box) {
    api_.hdDisableDevice(handle_);
    refuse(FS_ERROR_IO, "%s does not tell what it is: force %g N, %s", called.c_str(), force_max_,
           error.code ? words_of(error).c_str() : "no error");
  }
}

void Touch::get_info(fs_device_info& out) const {
  std::snprintf(out.name, sizeof out.name, "%s", name_.empty() ? "device of OpenHaptics" : name_.c_str());
  std::snprintf(out.serial, sizeof out.serial, "%s", serial_.c_str());
  out.force_axes = 3;
  out.torque_axes = has_torque_ ? 3 : 0;
  out.workspace_radius = 0.5e-3 * std::min(high_[0] - low_[0], high_[2] - low_[2]);
  out.workspace_height = 1e-3 * (high_[1] - low_[1]);
  out.workspace_angle = 1;
  out.force_max = force_max_;
  out.torque_max = has_torque_ ? torque_max : 0;
  out.rate = 1 / period;
  out.delay = 0.001;
}

// ------------------------------------------------------------------------------------------------ in the thread of OpenHaptics

bool Touch::run(bool may_push) noexcept {
  is_in_run_ = true;
  const bool goes_on = run_cycle(may_push);
  is_in_run_ = false;
  return goes_on;
}

bool Touch::run_cycle(bool may_push) noexcept {
  const bool is_last = is_ending_;
  const double begin = steady_now();
  api_.hdMakeCurrentDevice(handle_);
  look_around(begin);
  api_.hdBeginFrame(handle_);
  now_.state = {};
  now_.state.time = steady_now();
  read_pose(now_.state);
  ErrorInfo error{};
  const bool had_error = api_.take_errors(error) > 0;
  if (had_error) now_.error = error;
  if (had_error && ends_force(error.code)) (error.code == max_velocity ? fast_until_ : stopped_until_) = begin + error_counts;
  now_.errors_in_a_row = had_error && !ends_force(error.code) ? now_.errors_in_a_row + 1 : 0;
  const uint32_t why = reason(begin);
  now_.state.flags = why ? why : uint32_t{FS_STATE_READY};
  state_.write(now_);
  number_.fetch_add(1, std::memory_order_release);
  wake_waiters(number_);

  Command command;
  const bool is_heard = command_.read(command) && command.answers >= interrupted_at_;
  if (is_heard) interrupted_at_ = 0;
  const bool has_command = may_push && !is_last && is_heard && steady_now() - command.time <= command_age;
  if (!has_command) {
    command = {};
    // The servo must hear of it from a state, so that its force begins from 0 again.
    if (has_force_) interrupted_at_ = steady_now();
  }
  has_force_ = pushes(command.wrench);
  write_force(command);
  api_.hdEndFrame(handle_);
  const bool is_new = command.answers > 0 && command.time != answered_time_;
  now_.answered = is_new ? steady_now() - command.answers : 0;
  answered_time_ = command.time;
  return !is_last;
}

// Outside of a frame: is it calibrated, and now and then, how warm are its motors?
void Touch::look_around(double time) noexcept {
  const bool is_asked = wants_calibration_.exchange(false);
  const int style = is_asked ? by_reset : is_in_inkwell_ ? by_inkwell : style_ & by_itself;  // that may be used now
  now_.calibration = api_.hdCheckCalibration();
  const bool is_due = is_asked || (now_.calibration == needs_update && time - updated_at_ > update_every);
  if (is_due && style) {
    updated_at_ = time;
    api_.hdUpdateCalibration(static_cast<unsigned>(style));
    now_.calibration = api_.hdCheckCalibration();
  }
  if (time - looked_at_ < look_every) return;
  looked_at_ = time;
  double temperatures[6] = {};
  api_.hdGetDoublev(motor_temperature, temperatures);
  now_.temperature = static_cast<float>(*std::max_element(temperatures, temperatures + 6));
}

void Touch::read_pose(fs_state& out) noexcept {
  double t[16] = {};  // column by column
  int pressed = 0;
  api_.hdGetDoublev(transform, t);
  api_.hdGetIntegerv(buttons, &pressed);
  unsigned char is_in_inkwell = 0;
  api_.hdGetBooleanv(inkwell_switch, &is_in_inkwell);
  is_in_inkwell_ = style_ & by_inkwell && is_in_inkwell;
  const double x = t[12] - 0.5 * (low_[0] + high_[0]), y = t[13] - 0.5 * (low_[1] + high_[1]),
               z = t[14] - 0.5 * (low_[2] + high_[2]);
  const fs_vec3 p = to_device(x, y, z);
  out.pose.position = {1e-3 * p.x, 1e-3 * p.y, 1e-3 * p.z};
  const double frame[3][3] = {{t[0], t[4], t[8]}, {t[1], t[5], t[9]}, {t[2], t[6], t[10]}};
  const fs_quat q = quaternion_of(frame);
  const fs_vec3 v = to_device(q.x, q.y, q.z);
  out.pose.orientation = {q.w, v.x, v.y, v.z};
  out.buttons = static_cast<uint32_t>(pressed);
}

void Touch::write_force(const Command& command) const noexcept {
  const fs_vec3 f = command.wrench.force, t = command.wrench.torque;
  const double force[3] = {f.x, f.z, -f.y};
  api_.hdSetDoublev(current_force, force);
  if (!has_torque_) return;
  const double torque[3] = {1e3 * t.x, 1e3 * t.z, -1e3 * t.y};  // mN m
  api_.hdSetDoublev(current_torque, torque);
}

// Why there is no force, as a bit of fs_state.flags; 0: there is.
uint32_t Touch::reason(double time) const noexcept {
  if (now_.errors_in_a_row > 0 || interrupted_at_ > 0) return FS_STATE_CONNECTING;
  if (now_.calibration != calibrated) return FS_STATE_NOT_HOMED;
  if (is_in_inkwell_) return FS_STATE_IN_HOLDER;
  if (time < fast_until_) return FS_STATE_TOO_FAST;
  return time < stopped_until_ ? uint32_t{FS_STATE_STOPPED} : 0;
}

// --------------------------------------------------------------------------------------------------------------- for the servo

fs_status Touch::receive(fs_state& out) noexcept {
  const double until = steady_now() + state_within;
  uint32_t newest;
  while ((newest = number_.load(std::memory_order_acquire)) == seen_) {
    const double now = steady_now();
    if (now - heard_ > silent_after) return fs_fail(FS_ERROR_DISCONNECTED, "the thread of OpenHaptics has stopped");
    if (now >= until) return FS_ERROR_TIMEOUT;
    wait_for_change(number_, newest, until);
  }
  State state;
  if (!state_.read(state)) return FS_ERROR_TIMEOUT;
  seen_ = newest;
  heard_ = steady_now();
  if (state.answered > 0) meter_.note_delay(state.answered);
  if (state.errors_in_a_row > 0) {
    const bool is_lost = is_unreachable(state.error.code) && state.errors_in_a_row > lost_after;
    return fs_fail(is_lost ? FS_ERROR_DISCONNECTED : FS_ERROR_IO, words_of(state.error).c_str());
  }
  const fs_vec3 p = state.state.pose.position;
  const bool is_position = std::fabs(p.x) < farthest && std::fabs(p.y) < farthest && std::fabs(p.z) < farthest;  // NaN is none
  if (!is_position || !is_rotation(state.state.pose.orientation)) {
    return fs_fail(FS_ERROR_IO, "OpenHaptics gave a pose that no device has");
  }
  out = state.state;
  pose_time_ = out.time;
  meter_.note_state(out.time, period);
  return FS_OK;
}

fs_status Touch::send(const fs_wrench& wrench) noexcept {
  command_.write({wrench, steady_now(), pose_time_});
  pose_time_ = 0;
  ++sent_;
  return FS_OK;
}

fs_status Touch::get_link(fs_link& out) noexcept { return meter_.tell(steady_now(), {seen_, sent_, sent_}, out); }

// ------------------------------------------------------------------------------------------------------------------ requests

std::string Touch::control(const std::string& request) {
  if (request == "home") return home();
  if (request == "status") return status();
  refuse(FS_ERROR_UNSUPPORTED, "a device of OpenHaptics has no request '%s'; its requests are: home, status",
         shortened(request).c_str());
}

// Which motion calibrates it: that of a person, as no such device moves by itself.
std::string Touch::home() {
  if (style_ & by_inkwell) return "put the stylus into the inkwell, and take it out again";
  if (style_ & by_itself) return "move the handle through its workspace: it calibrates by itself";
  wants_calibration_ = true;
  for (int i = 0; i < 100 && wants_calibration_; ++i) pause(5e-3);
  if (wants_calibration_.exchange(false)) refuse(FS_ERROR_TIMEOUT, "the thread of OpenHaptics does not calibrate within 0.5 s");
  return "calibrated for the pose that it has now, which must be that of the maker's manual: all joints in the middle";
}

std::string Touch::status() const {
  State state;
  if (!state_.read(state)) return "no state has come yet";
  const double silence = steady_now() - state.state.time;
  std::string text = state.state.flags & FS_STATE_READY ? "ready" : std::string(fs_state_reason(state.state.flags));
  if (silence > silent_after) text = "the thread of OpenHaptics has stopped";
  if (state.calibration == needs_update) text += ": it needs to be calibrated, see the request home";
  if (state.calibration == needs_hand) text += ": it must be calibrated by hand, see the request home";
  if (state.error.code) text += "; last error " + words_of(state.error);
  char warmth[64];
  std::snprintf(warmth, sizeof warmth, "; motors at %.0f %% of their largest warmth", 100.0 * state.temperature);
  return text + warmth + "; " + api_.path;
}

void list_touches(fs_device_entry* out, size_t capacity, size_t* count) {
  load_api({});
  *count = usb_seen(usb_vendor).empty() ? 0 : 1;
  if (*count == 0 || capacity == 0) return;
  std::snprintf(out->uri, sizeof out->uri, "openhaptics:");
  std::snprintf(out->label, sizeof out->label, "the default device of OpenHaptics");
}

}  // namespace fs::openhaptics
