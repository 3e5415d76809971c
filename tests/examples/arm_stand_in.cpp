#include "examples/arm_stand_in.h"

#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <stdexcept>

namespace arm {
namespace {

// The numbers of woodenhaptics.json.
constexpr double joint_height = 0.080, upper = 0.205, fore = 0.245;  // m
constexpr double origin[3] = {0.220, 0, 0.080};                      // m; towards the user, right, up
constexpr double ratio[3] = {16, 12, 12};                            // turns of a motor in one of its body
constexpr double torque_constant = 0.0259, counts = 2000;            // N m/A, in a turn
constexpr double pi = 3.14159265358979323846;

constexpr double mass = 0.3, spring = 100, damper = 8;  // kg, N/m, N s/m: the hand that holds the handle
constexpr double watchdog = 0.5;                        // s
constexpr size_t command_size = 9;                       // with the number of the report

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

int16_t word(const uint8_t* at) { return static_cast<int16_t>(at[0] | at[1] << 8); }

fs_vec3 plus(fs_vec3 a, double s, fs_vec3 b) { return {a.x + s * b.x, a.y + s * b.y, a.z + s * b.z}; }
double dot(fs_vec3 a, fs_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
fs_vec3 cross(fs_vec3 a, fs_vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

}  // namespace

// In the plane of the arm, which body a turns: the elbow is above the joint of body b and leans to the user by angle b; the
// forearm hangs from the elbow, lifted by angle c.
fs_vec3 handle_of(const Angles& angles) {
  const double elbow_out = upper * std::sin(angles.b), elbow_up = joint_height + upper * std::cos(angles.b);
  const double out = elbow_out + fore * std::sin(angles.c), up = elbow_up - fore * std::cos(angles.c);
  const double to_user = out * std::cos(angles.a), right = out * std::sin(angles.a);
  return {right - origin[1], -(to_user - origin[0]), up - origin[2]};
}

Angles angles_of(fs_vec3 handle) {
  const double to_user = origin[0] - handle.y, right = handle.x + origin[1], up = handle.z + origin[2] - joint_height;
  const double out = std::hypot(to_user, right), distance = std::hypot(out, up);
  const double cosine = (upper * upper + distance * distance - fore * fore) / (2 * upper * distance);
  Angles angles{};
  angles.a = std::atan2(right, to_user);
  angles.b = std::atan2(out, up) - std::acos(std::fmax(-1, std::fmin(1, cosine)));
  angles.c = std::atan2(out - upper * std::sin(angles.b), upper * std::cos(angles.b) - up);
  return angles;
}

fs_vec3 force_of(const Angles& angles, const double (&current)[3]) {
  constexpr double step = 1e-6;  // rad
  // A positive current turns motor a so that its angle grows, and the other two so that theirs become smaller.
  const double torque[3] = {current[0] * torque_constant * ratio[0], -current[1] * torque_constant * ratio[1],
                            -current[2] * torque_constant * ratio[2]};
  fs_vec3 by[3];
  for (int i = 0; i < 3; ++i) {
    Angles more = angles, less = angles;
    (i == 0 ? more.a : i == 1 ? more.b : more.c) += step;
    (i == 0 ? less.a : i == 1 ? less.b : less.c) -= step;
    const fs_vec3 difference = plus(handle_of(more), -1, handle_of(less));
    by[i] = {difference.x / (2 * step), difference.y / (2 * step), difference.z / (2 * step)};
  }
  // by[i] . force = torque[i]
  const double determinant = dot(by[0], cross(by[1], by[2]));
  fs_vec3 force{};
  force = plus(force, torque[0] / determinant, cross(by[1], by[2]));
  force = plus(force, torque[1] / determinant, cross(by[2], by[0]));
  return plus(force, torque[2] / determinant, cross(by[0], by[1]));
}

StandIn::StandIn(std::string node) : node_(std::move(node)) {
  plug();
  thread_ = std::thread([this] { run(); });
}

StandIn::~StandIn() {
  ends_ = true;
  thread_.join();
  unplug();
}

void StandIn::plug() {
  const int master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  char name[64];
  if (master < 0 || grantpt(master) || unlockpt(master) || ptsname_r(master, name, sizeof name)) {
    throw std::runtime_error("there is no pseudo terminal");
  }
  // In raw mode each byte passes as it is. Once it was closed, a poll of the master says whether it is open.
  const int slave = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
  termios mode{};
  tcgetattr(slave, &mode);
  cfmakeraw(&mode);
  tcsetattr(slave, TCSANOW, &mode);
  close(slave);
  std::filesystem::create_symlink(name, node_);
  const std::lock_guard lock(mutex);
  terminal_ = master;
  is_open_ = false;
  received_.clear();
  number_ = 0;
  for (double& current : current_) current = 0;
}

void StandIn::unplug() {
  std::error_code error;
  std::filesystem::remove(node_, error);
  const std::lock_guard lock(mutex);
  if (terminal_ >= 0) close(terminal_);
  terminal_ = -1;
}

void StandIn::hold_at(fs_vec3 handle) {
  const std::lock_guard lock(mutex);
  is_loose_ = false;
  handle_ = handle;
  speed_ = {};
}

void StandIn::hold_loosely(fs_vec3 rest) {
  const std::lock_guard lock(mutex);
  is_loose_ = true;
  handle_ = rest_ = rest;
  speed_ = {};
}

fs_vec3 StandIn::handle() const {
  const std::lock_guard lock(mutex);
  return handle_;
}

fs_vec3 StandIn::force() const {
  const std::lock_guard lock(mutex);
  return force_of(angles_of(handle_), current_);
}

std::vector<int> StandIn::current() const {
  const std::lock_guard lock(mutex);
  std::vector<int> out;
  for (const double current : current_) out.push_back(static_cast<int>(std::lrint(1000 * current)));
  return out;
}

void StandIn::run() {
  constexpr double period = 1e-3;  // s
  const sched_param as_hardware{90};  // where this is allowed, it is as punctual as the hardware that it stands for
  pthread_setschedparam(pthread_self(), SCHED_FIFO, &as_hardware);
  double before = now();
  for (double next = before; !ends_; next = std::fmax(next + period, now() - 0.005)) {
    std::this_thread::sleep_for(std::chrono::duration<double>(std::fmax(0, next - now())));
    const std::lock_guard lock(mutex);
    const double time = now();
    if (terminal_ >= 0) take_commands();
    move(std::fmin(time - before, 0.01));
    if (terminal_ >= 0 && is_open_ && !is_silent) report();
    before = time;
  }
}

void StandIn::take_commands() {
  pollfd terminal{terminal_, POLLIN, 0};
  poll(&terminal, 1, 0);
  is_open_ = !(terminal.revents & POLLHUP);
  uint8_t bytes[900];
  for (ssize_t size; (size = read(terminal_, bytes, sizeof bytes)) > 0;) received_.insert(received_.end(), bytes, bytes + size);
  while (received_.size() >= command_size) {
    bad_commands_ += received_[0] != 0;
    for (int i = 0; i < 3; ++i) current_[i] = 1e-3 * word(&received_[static_cast<size_t>(1 + 2 * i)]);
    commanded_ = now();
    ++commands_;
    received_.erase(received_.begin(), received_.begin() + command_size);
  }
  if (now() - commanded_ > watchdog) current_[0] = current_[1] = current_[2] = 0;
}

void StandIn::move(double dt) {
  if (!is_loose_) return;
  const int steps = 10;
  for (int i = 0; i < steps; ++i) {
    fs_vec3 force = force_of(angles_of(handle_), current_);
    force = plus(plus(plus(force, spring, rest_), -spring, handle_), -damper, speed_);
    speed_ = plus(speed_, dt / steps / mass, force);
    handle_ = plus(handle_, dt / steps, speed_);
  }
}

void StandIn::report() {
  const Angles angles = angles_of(handle_);
  const double turned[3] = {-angles.a, -angles.b, pi / 2 - angles.c};
  std::vector<uint8_t> bytes;
  const auto put = [&](int value) {
    bytes.push_back(static_cast<uint8_t>(value & 0xff));
    bytes.push_back(static_cast<uint8_t>(value >> 8 & 0xff));
  };
  for (int i = 0; i < 3; ++i) put(static_cast<int>(std::lrint(turned[i] * ratio[i] * counts / (2 * pi))) + count_offset[i]);
  put(++number_);
  if (on_report) on_report(bytes);
  if (!bytes.empty() && write(terminal_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size())) ++reports_;
}

}  // namespace arm
