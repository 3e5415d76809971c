#include "driver/device.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "base/clock.h"
#include "base/error.h"
#include "base/text.h"
#include "driver/call_driver.h"
#include "driver/open_devices.h"
#include "driver/registry.h"

namespace fs {
namespace {

// What stands before the first ':', unless a '?' comes first; empty where there is none.
std::string scheme_of(const char* uri) {
  const char* const end = std::strpbrk(uri, ":?");
  return end && *end == ':' ? std::string(uri, end) : "";
}

const fs_driver& driver_of(const char* uri) {
  const std::string scheme = scheme_of(uri);
  const std::string quoted = shortened(uri);
  if (scheme.empty()) fail(FS_ERROR_INVALID, "device '%s' has no scheme, such as sim: or falcon:0", quoted.c_str());
  if (const fs_driver* driver = find_driver(scheme)) return *driver;
  std::string schemes;
  for (const std::string& known : all_schemes()) schemes += (schemes.empty() ? "" : ", ") + known;
  if (schemes.empty()) schemes = "none";
  if (!is_scheme(scheme)) {
    fail(FS_ERROR_NOT_FOUND, "device '%s': the name of a driver is 1..%zu of a-z and 0-9; the drivers are: %s", quoted.c_str(),
         scheme_length_max, schemes.c_str());
  }
  fail(FS_ERROR_NOT_FOUND, "device '%s': there is no driver '%s', and no module %s/%s.so; the drivers are: %s", quoted.c_str(),
       scheme.c_str(), module_folder().c_str(), scheme.c_str(), schemes.c_str());
}

void check_info(const fs_device_info& info, const char* scheme) {
  // exception: a value outside of the bounds that is good, too, such as "0 or ".
  const auto check = [&](double value, double low, double high, const char* field, const char* exception = "") {
    if (!(value >= low && value <= high)) {
      fail(FS_ERROR_INVALID, "driver '%s': info.%s is %.9g, must be %swithin %.9g..%.9g", scheme, field, value, exception, low,
           high);
    }
  };
  const auto check_text = [&](const char (&text)[64], const char* field) {
    if (!std::memchr(text, 0, sizeof text)) {
      fail(FS_ERROR_INVALID, "driver '%s': info.%s does not end within %zu bytes", scheme, field, sizeof text);
    }
  };
  // The upper bounds are generous: they catch garbage and wrong units, not large devices.
  check(info.force_axes, 0, 3, "force_axes");
  check(info.torque_axes, 0, 3, "torque_axes");
  check_text(info.name, "name");
  check_text(info.serial, "serial");
  check(info.workspace_radius, 0, 1000, "workspace_radius");
  check(info.workspace_height, 0, 1000, "workspace_height");
  check(info.workspace_angle, 0, 1000, "workspace_angle");
  check(info.force_max, info.force_axes ? 1e-6 : 0, 1e6, "force_max");
  check(info.torque_max, info.torque_axes ? 1e-6 : 0, 1e6, "torque_max");
  check(info.resolution, 0, 1, "resolution");
  check(info.rate, 100, 20000, "rate");
  check(info.delay, 0, 10, "delay");
  check(info.damping, 0, 1e6, "damping");
  check(info.mass, 0, 1e6, "mass");
  if (info.link_rate != 0) check(info.link_rate, 1, 1e6, "link_rate", "0 or ");
  if (info.controller_rate != 0) check(info.controller_rate, 100, 1e6, "controller_rate", "0 or ");
  check(info.controller_delay, 0, 10, "controller_delay");
  check(info.controller_damping, 0, 1e6, "controller_damping");
  if (info.watchdog != -1) check(info.watchdog, 0, 10, "watchdog", "-1 or ");
}

Vec3 limited(Vec3 v, uint32_t axes, double max) {
  if (axes < 3) v.z = 0;
  if (axes < 2) v.y = 0;
  if (axes < 1) v.x = 0;
  return norm(v) > max ? (max * (1 - 1e-15)) * normalized(v) : v;  // slightly less, so that rounding never exceeds max
}

constexpr double close_within = 1;  // s: a driver that hangs longer is left behind

double distance(Vec3 a, Vec3 b) { return norm(a - b); }
bool is_zero(const Twist& t) { return t.linear == Vec3{} && t.angular == Vec3{}; }
bool is_zero(const Mat3& m) { return m == Mat3{}; }
bool is_zero(const Wrench& w) { return w.force == Vec3{} && w.torque == Vec3{}; }

void pause(double time) noexcept { sleep_until(steady_now() + time); }  // s

// Normalizes q; 0, from a device without orientation, becomes the identity. False when q is finite and neither 0 nor
// within 1e-3 of unit length.
bool repair_orientation(Quat& q) {
  const double length = norm(q);
  if (length == 0) {
    q = identity_quat();
  } else if (std::fabs(length - 1) <= 1e-3) {
    q = normalized(q);
  } else if (is_finite(q)) {
    return false;
  }
  return true;
}

}  // namespace
}  // namespace fs

fs_device::fs_device(const char* uri) : driver_(fs::driver_of(uri)), info_(fs_device_info_init()) {
  const std::string address = std::strchr(uri, ':') + 1;  // not null: the scheme was found
  auto opened = std::make_shared<fs::Opened>(driver_, address);
  fs::ask_driver(driver_, "get_info", [&] { return driver_.get_info(opened->self(), &info_); });
  info_.struct_size = sizeof info_;
  info_.reserved = 0;
  fs::check_info(info_, driver_.scheme);
  velocity_ = fs::VelocityEstimator(info_.resolution);
  if (!driver_.write_model) info_.controller_rate = info_.controller_delay = info_.controller_damping = 0;
  if (driver_.receive) {
    thread_ = fs::make_ref<fs::DriverThread>(driver_, address, std::move(opened), info_);
    fs::DriverThread::start(thread_);
  } else {
    self_ = opened->self();
    opened_ = std::move(opened);
  }
  try {
    fs::add_open_device(*this);
  } catch (...) {
    close(fs::steady_now() + fs::close_within);
    throw;
  }
  fs::guard_process_end();
}

fs_device::~fs_device() {
  if (!is_of_this_process()) return;
  silence();
  fs::remove_open_device(*this);
  close(fs::steady_now() + fs::close_within);
}

// At the end of the process, and when the last handle is given back.
void fs_device::close(double deadline) noexcept {
  if (thread_) thread_->end(deadline);
  opened_ = nullptr;
  is_closed_ = true;
}

void fs_device::acquire(int priority, bool has_thread, double period) {
  if (!is_of_this_process()) fs::fail(FS_ERROR_STATE, "device was opened by the parent of this process; open it here");
  const std::lock_guard lock(mutex);
  if (owned_.exchange(true)) fs::fail(FS_ERROR_STATE, "device has a servo already; stop it first");
  if (thread_) thread_->begin_servo(priority, has_thread, period);
}

void fs_device::release_ownership() noexcept {
  if (thread_) thread_->end_servo();
  is_silent_.store(false);
  owned_.store(false, std::memory_order_release);
}

bool fs_device::is_silent() const noexcept { return is_silent_.load() || has_ended_.load() || !is_of_this_process(); }

bool fs_device::take_turn() noexcept {
  pthread_t nobody = 0;
  if (!is_of_this_process() || !turn_.compare_exchange_strong(nobody, pthread_self())) return false;
  if (!is_silent()) return true;
  end_turn();
  return false;
}

void fs_device::end_turn() noexcept { turn_.store(0); }

// Waits for the turn and takes it; gives up at the deadline (s, monotonic clock) after one try at least.
class fs_device::Turn {
 public:
  explicit Turn(fs_device& device, double deadline = std::numeric_limits<double>::infinity()) : device_(device) {
    is_inside_ = device_.turn_.load() == pthread_self();
    while (!is_inside_) {
      pthread_t nobody = 0;
      is_taken_ = device_.turn_.compare_exchange_strong(nobody, pthread_self());
      if (is_taken_ || fs::steady_now() >= deadline) break;
      fs::pause(2e-5);
    }
  }
  ~Turn() {
    if (is_taken_) device_.end_turn();
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;
  explicit operator bool() const noexcept { return is_taken_ || is_inside_; }

 private:
  fs_device& device_;
  bool is_taken_ = false;
  bool is_inside_ = false;  // this thread has the turn already: the driver called exit
};

void fs_device::write_zero() noexcept {
  if (thread_) {
    thread_->write_zero();
    return;
  }
  constexpr int most_tries = 20;
  const fs_wrench none{};
  const auto write = [&] { return driver_.write(self_, &none); };
  for (int i = 1; fs::call_safely(write) != FS_OK && i < most_tries; ++i) fs::pause(1e-3);
}

void fs_device::zero() noexcept {
  if (!is_of_this_process()) return;
  const Turn turn(*this);
  if (!is_closed_) write_zero();
}

void fs_device::silence() noexcept {
  is_silent_.store(true);
  zero();
}

void fs_device::begin_end() noexcept {
  if (!is_of_this_process() || has_ended_.exchange(true)) return;
  if (thread_) return thread_->begin_end();
  const Turn turn(*this, 0);
  if (turn && was_pushing_ && !is_closed_) write_zero();
}

void fs_device::end(double deadline) noexcept {
  if (!is_of_this_process()) return;
  has_ended_ = true;
  const Turn turn(*this, deadline);
  if (!turn || !was_pushing_ || is_closed_) return;
  if (!thread_) write_zero();
  while (inside_ && fs::steady_now() < deadline) fs::pause(2e-5);
  if (!inside_) close(deadline);  // only a close guarantees that the 0 has arrived
}

// A call of the driver beside the thread that has the turn: the device is not closed meanwhile.
class fs_device::Inside {
 public:
  explicit Inside(fs_device& device) : device_(device) { ++device_.inside_; }
  ~Inside() { --device_.inside_; }
  Inside(const Inside&) = delete;
  Inside& operator=(const Inside&) = delete;

 private:
  fs_device& device_;
};

fs_status fs_device::get_link(fs_link& out) noexcept {
  out = {};
  out.struct_size = sizeof out;
  if (!driver_.get_link) return FS_ERROR_UNSUPPORTED;
  if (thread_) return thread_->get_link(out);
  const Inside inside(*this);
  if (is_silent() || !opened_) return FS_ERROR_UNSUPPORTED;
  return fs::call_safely([&] { return driver_.get_link(self_, &out); });
}

void fs_device::control(const char* request, fs_answer& out) {
  if (!is_of_this_process()) fs::fail(FS_ERROR_STATE, "the device was opened by the parent of this process");
  if (!driver_.control) fs::fail(FS_ERROR_UNSUPPORTED, "a device of '%s' has no requests", driver_.scheme);
  const Inside inside(*this);
  if (has_ended_) fs::fail(FS_ERROR_STATE, "the process is ending, and the device with it");
  const std::shared_ptr<fs::Opened> opened = thread_ ? thread_->device() : opened_;
  if (!opened) {
    const std::string why = newest_trouble().of(FS_ERROR_DISCONNECTED);
    fs::fail(FS_ERROR_DISCONNECTED, "the device is not connected%s%s", why.empty() ? "" : ": ", why.c_str());
  }
  fs::ask_driver(driver_, "control", [&] { return driver_.control(opened->self(), request, out.text, sizeof out.text); });
  out.text[sizeof out.text - 1] = 0;
}

fs::Trouble fs_device::trouble(uint32_t number) const { return thread_ ? thread_->trouble(number) : fs::Trouble{}; }

double fs_device::await_tick(double next, double period) noexcept {
  if (thread_) return thread_->await_state(next - period / 8, next, next + period / 2);
  fs::sleep_until(next);
  return next;
}

void fs_device::leave_servo() noexcept {
  if (thread_) thread_->give_back(true);
}

fs_status fs_device::read(double time, fs_state& out) noexcept {
  out = {};
  fs_status status = thread_ ? thread_->read(out) : fs::call_safely([&] {
    const fs_status advanced = driver_.advance ? driver_.advance(self_, time) : FS_OK;
    return advanced == FS_OK ? driver_.read(self_, &out) : advanced;
  });
  if (status == FS_OK && !(fs::repair_orientation(out.pose.orientation) && std::isfinite(out.time))) {
    status = fs::set_last_error_literal(FS_ERROR_INVALID,
                                        "the driver gave a time that is not finite, or an orientation"
                                        " whose length is not 1");
  }
  if (status != FS_OK) {
    out = {};
    velocity_.reset();
    return status;
  }
  if (out.time == 0) out.time = time;
  ++read_number_;
  const double dt = out.time - std::exchange(read_time_, out.time);
  if (!(out.flags & FS_STATE_READY) || !fs::is_finite(out.pose)) {
    velocity_.reset();  // the pose jumps when a device is homed
    return FS_OK;
  }
  constexpr double contradiction = 1;  // m/s
  const bool stands = std::memcmp(&out.pose, &read_pose_, sizeof read_pose_) == 0;
  const double way = fs::distance(out.pose.position, std::exchange(read_pose_, out.pose).position);
  if (!fs::is_zero(out.twist) && fs::is_finite(out.twist)) gives_twist_ = true;
  const bool is_given = !fs::is_zero(out.twist) || (gives_twist_ && stands);
  const double given = fs::norm(out.twist.linear);
  const fs::Twist of_poses = velocity_.update(out.pose, out.time);  // always, so that it is right when it is needed
  if (is_given && way <= (given + contradiction) * dt) return FS_OK;
  if (!is_given || fs::norm(of_poses.linear) > given + contradiction) out.twist = of_poses;
  return FS_OK;
}

namespace {

// Of a write; the device has got 0 where the wrench is not finite.
fs_status checked(fs_status status, const fs_wrench& wrench) noexcept {
  return fs::is_finite(wrench) ? status : FS_ERROR_INVALID;
}

}  // namespace

// Scaled to the device's maxima; 0 if it is not finite.
fs_wrench fs_device::limited(const fs_wrench& wrench) noexcept {
  fs_wrench out{};
  if (fs::is_finite(wrench)) {
    out.force = fs::limited(wrench.force, info_.force_axes, info_.force_max);
    out.torque = fs::limited(wrench.torque, info_.torque_axes, info_.torque_max);
  }
  was_pushing_ = was_pushing_ || !fs::is_zero(out);
  return out;
}

fs_status fs_device::write(const fs_wrench& wrench) noexcept {
  const fs_wrench out = limited(wrench);
  if (thread_) return checked(thread_->write(out, !is_owned()), wrench);
  return checked(fs::call_safely([&] { return driver_.write(self_, &out); }), wrench);
}

fs_status fs_device::write_model(const fs_pose& pose, const fs_wrench& force, const fs_mat3& stiffness) noexcept {
  constexpr double hold = 0.1;  // s
  fs_model model{};
  model.struct_size = sizeof model;
  model.x0 = fs::identity_pose();
  model.f0 = limited(force);
  model.hold = hold;
  const bool is_pose = fs::is_finite(pose) && fs::norm(pose.orientation) > 0;  // 0: the read failed
  if (is_pose) {
    model.number = read_number_;
    model.time = read_time_;
  }
  if (is_pose && fs::is_finite(stiffness) && fs::is_finite(force)) {
    model.x0 = pose;
    model.dfdx = stiffness;
    if (!fs::is_zero(stiffness)) was_pushing_ = true;
  }
  if (thread_) return checked(thread_->write_model(model), force);
  return checked(fs::call_safely([&] { return driver_.write_model(self_, &model); }), force);
}
