#include "device/dhd/arm.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <utility>

#include "device/support/clock.h"
#include "device/support/refusal.h"
#include "device/support/rotation.h"

namespace fs::dhd {
namespace {

constexpr unsigned char watchdog_units = 160;  // in units of 125 us: 20 ms
constexpr double pose_within = 0.008;         // s, for a pose that is new
constexpr double ask_again_after = 2e-4;      // s, when the SDK gave a pose a second time
constexpr double longest_call = 0.003;        // s, for a pose whose time is known well enough to tell a speed by
constexpr double look_every = 0.02;           // s, at the status
constexpr double rest_after_brake = 1;        // s, until a device that was too fast gets its force again
constexpr double silent_after = 0.2;          // s without a look at the status: the SDK does not answer
constexpr double lost_after = 0.5;            // s, in which every call has failed
constexpr double farthest = 1;                // m, along each axis, of a position that can be
constexpr double homing_pause = 0.005;        // s, between two states of a device that homes
constexpr double gripper_range = 0.5;         // rad, about: the SDK does not tell how far one opens
constexpr double wrist_range = 1;             // rad, about: nor how far a wrist turns
constexpr double height_of_radius = 1.4;      // of the workspace: the makers' figures are 1.47 (omega) and 1.3 (delta)

// x of the SDK points to the user, and its y to his right.
fs_vec3 to_device(double x, double y, double z) { return {y, -x, z}; }

fs_quat to_device(fs_quat q) {
  const fs_vec3 v = to_device(q.x, q.y, q.z);
  return {q.w, v.x, v.y, v.z};
}

// What is known of devices that this process has had, by their serial numbers.
struct Known {
  bool was_lost = false;            // it does not home by itself when it comes back, as it would move in somebody's hand
  double mass = 0, resolution = 0;  // kg, m, as first measured: they must not change while it is open
};
class KnownDevices {
 public:
  Known get(const std::string& serial) noexcept {
    const std::lock_guard lock(mutex_);
    const auto found = all_.find(serial);
    return found == all_.end() ? Known{} : found->second;
  }
  void measured(const std::string& serial, double mass, double resolution) {
    if (serial.empty()) return;  // of a device that does not tell it
    const std::lock_guard lock(mutex_);
    all_[serial].mass = mass;
    all_[serial].resolution = resolution;
  }
  void homed(const std::string& serial) {
    const std::lock_guard lock(mutex_);
    all_[serial].was_lost = false;
  }
  void lost(const std::string& serial, const std::string& place) noexcept {
    const std::lock_guard lock(mutex_);
    try {
      all_[serial].was_lost = true;
      if (!serial.empty()) lost_at_[place] = serial;
    } catch (...) {  // there is no memory: another device may be taken for it, until the library compares them
    }
  }
  // The device that is meant by a place: where one was lost that one, even if the SDK counts otherwise by now.
  std::string meant_by(const std::string& place) {
    const std::lock_guard lock(mutex_);
    const auto found = lost_at_.find(place);
    return found == lost_at_.end() ? place : found->second;
  }
  void is_back(const std::string& place) {
    const std::lock_guard lock(mutex_);
    lost_at_.erase(place);
  }

 private:
  std::mutex mutex_;
  std::map<std::string, Known> all_;
  std::map<std::string, std::string> lost_at_;  // serial numbers, by the place at which each was open
};
KnownDevices& known_devices() {
  static auto* const devices = new KnownDevices;  // never destroyed, as devices may be closed when the process ends
  return *devices;
}

}  // namespace

Arm::Arm(const Address& address)
    : place_(address.place()), period_(1 / address.number("rate", 100, 4000).value_or(1000)),
      api_(load_api(address.text("library"))),
      session_(api_, known_devices().meant_by(place_), address.choice("falcon", {"no", "yes"}).value_or(0) == 1),
      id_(session_.id()), limits_(limits_of(session_.type())) {
  const bool homes = address.choice("home", {"no", "yes"}).value_or(0) == 1;
  has_wrist_ = api_.dhdHasWrist(id_);
  has_torque_ = limits_.torque > 0 && api_.dhdHasActiveWrist(id_);
  has_gripper_ = api_.dhdHasGripper(id_);
  const double set_by_user = api_.dhdGetMaxForce ? api_.dhdGetMaxForce(id_) : -1;
  force_max_ = set_by_user > 0 ? std::min(set_by_user, limits_.force) : limits_.force;
  if (has_gripper_ && api_.dhdEmulateButton) api_.dhdEmulateButton(1, id_);
  static std::mutex expert_mutex;  // the mode is that of the process
  std::unique_lock expert(expert_mutex);
  api_.dhdEnableExpertMode();
  has_watchdog_ = api_.dhdSetWatchdog(watchdog_units, id_) >= 0;
  measure_mechanism();
  known_devices().measured(session_.serial(), mass_, resolution_);
  api_.dhdDisableExpertMode();
  expert.unlock();
  is_initialized_ = api_.drdIsInitialized(id_);
  take_commands();
  look_at_status(steady_now());
  if (homes && !is_initialized_ && !known_devices().get(session_.serial()).was_lost) home();
  known_devices().is_back(place_);
}

Arm::~Arm() {
  send({});
  api_.dhdStop(id_);
}

// The SDK may keep the newest command, and give it when the motors are switched on.
bool Arm::end_force() noexcept { return api_.dhdSetForceAndTorqueAndGripperForce(0, 0, 0, 0, 0, 0, 0, id_) >= 0; }

// Switches the motors on, and lets the SDK carry the weight of the device.
void Arm::take_commands() {
  end_force();
  if (api_.dhdEnableForce(1, id_) >= 0 && api_.dhdSetGravityCompensation(1, id_) >= 0) return;
  const std::string why = api_.last_error();
  api_.dhdStop(id_);
  refuse(FS_ERROR_IO, "the device does not take commands: %s", why.c_str());
}

// What the SDK knows of the mechanism at the centre of the workspace: the mass that is felt, and the longest way of the handle in a
// step of an encoder.
void Arm::measure_mechanism() noexcept {
  const Known known = known_devices().get(session_.serial());
  mass_ = known.mass;
  resolution_ = known.resolution;
  if (resolution_ > 0) return;
  int e[3] = {};
  if (!api_.dhdDeltaPositionToEncoder || api_.dhdDeltaPositionToEncoder(0, 0, 0, &e[0], &e[1], &e[2], id_) < 0) return;
  fs_vec3 centre{};
  if (api_.dhdDeltaEncoderToPosition &&
      api_.dhdDeltaEncoderToPosition(e[0], e[1], e[2], &centre.x, &centre.y, &centre.z, id_) >= 0) {
    for (int i = 0; i < 3; ++i) {
      fs_vec3 p = centre;
      ++e[i];
      api_.dhdDeltaEncoderToPosition(e[0], e[1], e[2], &p.x, &p.y, &p.z, id_);
      --e[i];
      const double step = std::hypot(p.x - centre.x, p.y - centre.y, p.z - centre.z);
      if (step < 1e-3) resolution_ = std::max(resolution_, step);
    }
  }
  double angles[joints] = {}, inertia[6][6] = {};
  if (!api_.dhdDeltaEncodersToJointAngles || !api_.dhdJointAnglesToInertiaMatrix) return;
  if (api_.dhdDeltaEncodersToJointAngles(e[0], e[1], e[2], &angles[0], &angles[1], &angles[2], id_) < 0) return;
  if (api_.dhdJointAnglesToInertiaMatrix(angles, inertia, id_) < 0) return;
  const double least = std::min({inertia[0][0], inertia[1][1], inertia[2][2]});
  if (least > 0.01 && least < 10) mass_ = least;
}

void Arm::get_info(fs_device_info& out) const {
  const char* const name = api_.dhdGetSystemName(id_);
  std::snprintf(out.name, sizeof out.name, "Force Dimension %s", name ? name : "device");
  std::snprintf(out.serial, sizeof out.serial, "%s", session_.serial().c_str());
  out.force_axes = 3;
  out.torque_axes = has_torque_ ? 3 : 0;
  out.workspace_radius = limits_.radius;
  out.workspace_height = height_of_radius * limits_.radius;
  out.workspace_angle = has_wrist_ ? wrist_range : 0;
  out.force_max = force_max_;
  out.torque_max = has_torque_ ? limits_.torque : 0;
  out.resolution = resolution_;
  out.rate = 1 / period_;
  out.delay = 0.001;
  out.mass = mass_;
  out.watchdog = has_watchdog_ ? watchdog_units * 125e-6 : -1;
}

// ------------------------------------------------------------------------------------------------------------------- running

// A call of the SDK has failed.
fs_status Arm::failed(const char* what) noexcept {
  const double now = steady_now();
  if (failing_since_ == 0) failing_since_ = now;
  const bool is_lost = api_.dhdErrorGetLast() == error_of_communication || now - failing_since_ > lost_after;
  if (is_lost) known_devices().lost(session_.serial(), place_);
  char words[256];
  const char* const reason = api_.dhdErrorGetLastStr();
  std::snprintf(words, sizeof words, "%s: %s", what, reason ? reason : "the SDK does not say why");
  return fs_fail(is_lost ? FS_ERROR_DISCONNECTED : FS_ERROR_IO, words);
}

// At most once in 20 ms: a force that the device has switched off is not felt, and one that is switched on must begin from 0.
void Arm::look_at_status(double time) noexcept {
  if (time - looked_at_ < look_every) return;
  StatusArray status{};
  if (api_.dhdGetStatus(status.data(), id_) < 0) {
    status_ = {};  // that of a device which is not connected: its force begins from 0 when it is known again
    return;
  }
  looked_at_ = time;
  status_ = status;
  is_initialized_ = api_.drdIsInitialized(id_);
  if (const std::unique_lock lock(told_mutex_, std::try_to_lock); lock) {
    told_ = {status, is_initialized_, looked_at_, commands_, saturated_};
  }
  const uint32_t reason = reason_of(status, is_initialized_);
  if (reason != FS_STATE_TOO_FAST) braked_at_ = 0;
  else if (braked_at_ == 0) braked_at_ = time;
  const bool has_rested = reason == FS_STATE_TOO_FAST && time - braked_at_ > rest_after_brake;
  const auto cause = static_cast<Cause>(status[status_cause]);
  const bool was_unheard = reason == FS_STATE_STOPPED && (cause == Cause::watchdog || cause == Cause::usb);
  if (has_rested || was_unheard) {
    end_force();
    api_.dhdSetBrakes(0, id_);
    api_.dhdEnableForce(1, id_);
  }
}

fs_status Arm::receive(fs_state& out) noexcept {
  const double begin = steady_now();
  if (begin < next_) pause(next_ - begin);
  const std::unique_lock own(mutex_, std::try_to_lock);
  if (!own) {  // it homes
    pause(homing_pause);
    out.flags = FS_STATE_NOT_HOMED;
    return FS_OK;
  }
  look_at_status(steady_now());
  const fs_status status = read(out);
  next_ = std::max(next_ + period_, steady_now() - period_);
  return status;
}

// The SDK gives the same pose again and again.
fs_status Arm::without_pose(double time) noexcept {
  if (failing_since_ == 0) failing_since_ = time;
  if (time - failing_since_ < lost_after) return FS_ERROR_TIMEOUT;
  known_devices().lost(session_.serial(), place_);
  return fs_fail(FS_ERROR_DISCONNECTED, "the SDK gives no new pose");
}

fs_status Arm::read(fs_state& out) noexcept {
  double x = 0, y = 0, z = 0, frame[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, before = 0;
  const double latest = steady_now() + pose_within;
  for (bool is_new = false; !is_new;) {
    before = steady_now();
    if (before > latest) return without_pose(before);
    const int answer = api_.dhdGetPositionAndOrientationFrame(&x, &y, &z, frame, id_);
    if (answer < 0) return failed("the pose cannot be read");
    if (answer == is_cached) pause(ask_again_after);
    // Of a call that hung nobody knows when the pose was measured: the next one counts. Where all calls are slow, they count.
    const bool was_slow = std::exchange(is_slow_, steady_now() - before > longest_call);
    is_new = answer != is_cached && (was_slow || !is_slow_);
  }
  const bool is_position = std::fabs(x) < farthest && std::fabs(y) < farthest && std::fabs(z) < farthest;  // NaN is none
  const fs_quat turned = has_wrist_ ? quaternion_of(frame) : fs_quat{1, 0, 0, 0};
  if (!is_position || !is_rotation(turned)) return fs_fail(FS_ERROR_IO, "the SDK gave a pose that no device has");
  failing_since_ = 0;
  ++poses_;
  const double time = 0.5 * (before + steady_now());
  meter_.note_state(time, period_);
  out.time = measured_ = time;
  out.pose.position = to_device(x, y, z);
  out.pose.orientation = to_device(turned);
  out.buttons = api_.dhdGetButtonMask(id_);
  double angle = 0;
  if (has_gripper_ && api_.dhdGetGripperAngleRad(&angle, id_) >= 0 && std::isfinite(angle))
    out.grip = std::clamp(std::fabs(angle) / gripper_range, 0.0, 1.0);
  const uint32_t reason = reason_of(status_, is_initialized_);
  out.flags = reason ? reason : uint32_t{FS_STATE_READY};
  return FS_OK;
}

fs_status Arm::send(const fs_wrench& wrench) noexcept {
  const std::unique_lock own(mutex_, std::try_to_lock);
  const fs_vec3 f = wrench.force, t = wrench.torque;
  if (!own) return FS_OK;  // it homes, so there has been no force to send
  const int answer = api_.dhdSetForceAndTorqueAndGripperForce(-f.y, f.x, f.z, -t.y, t.x, t.z, 0, id_);
  if (answer < 0) return failed("the force cannot be sent");
  ++commands_;
  if (answer == is_saturated) ++saturated_;
  if (measured_ > 0) meter_.note_delay(steady_now() - measured_);
  measured_ = 0;
  return FS_OK;
}

fs_status Arm::get_link(fs_link& out) noexcept { return meter_.tell(steady_now(), {poses_, commands_, commands_}, out); }

// ------------------------------------------------------------------------------------------------------------------ requests

std::string Arm::control(const std::string& request) {
  if (request == "home") return home();
  if (request == "status") return status();
  refuse(FS_ERROR_UNSUPPORTED, "a device of Force Dimension has no request '%s'; its requests are: home, status",
         request.c_str());
}

std::string Arm::home() {
  if (is_homing_.exchange(true)) refuse(FS_ERROR_STATE, "the device homes already");
  const std::lock_guard own(mutex_);
  const struct Ends {
    std::atomic<bool>& is_homing;
    ~Ends() { is_homing = false; }
  } ends{is_homing_};
  StatusArray status{};
  if (api_.dhdGetStatus(status.data(), id_) < 0) refuse(FS_ERROR_IO, "the device has not homed: %s", api_.last_error().c_str());
  if (!api_.drdIsSupported(id_)) refuse(FS_ERROR_UNSUPPORTED, "this device cannot home by itself: its maker's page tells how");
  const bool has_homed = end_force() && api_.drdAutoInit(id_) >= 0 && api_.drdStop(true, id_) >= 0;
  if (!has_homed) {
    const std::string why = api_.last_error();
    api_.drdStop(false, id_);
    api_.dhdStop(id_);
    refuse(FS_ERROR_IO, "the device has not homed: %s", why.c_str());
  }
  take_commands();
  known_devices().homed(session_.serial());
  looked_at_ = 0;
  look_at_status(steady_now());
  return "the device has homed";
}

std::string Arm::status() {
  Told told;
  {
    const std::lock_guard lock(told_mutex_);
    told = told_;
  }
  const bool is_silent = steady_now() - told.time > silent_after;
  const std::string trouble = is_homing_  ? "the device homes"
                              : is_silent ? "the SDK does not answer"
                                          : words_of(told.status, told.is_initialized);
  std::string text = trouble.empty() ? "ready" : trouble;
  text += "; SDK " + api_.version + " (" + api_.path + ")";
  text += has_watchdog_ ? "; the device itself ends the force 20 ms after the last command"
                        : "; NO WATCHDOG: its firmware has none, so a force stays when this program dies";
  text += told.status[status_gravity] ? "; its weight is carried" : "; its weight is NOT carried";
  text += mass_ > 0 ? "; mass by its inertia matrix" : "; mass not known";
  return text + "; " + std::to_string(told.saturated) + " of " + std::to_string(told.commands) +
         " forces were more than its motors give";
}

}  // namespace fs::dhd
