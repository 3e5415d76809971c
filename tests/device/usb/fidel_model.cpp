#include "device/usb/fidel_model.h"

#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <new>
#include <numbers>
#include <stdexcept>

#include "device/kinematics/fidel.h"

namespace scenes {
namespace {

namespace fidel = fs::fidel;
using fs::operator+, fs::operator-, fs::operator*, fs::operator+=;

constexpr double step_length = 250e-6;   // s
constexpr int steps_a_tick = 4;
constexpr double hand_speed = 0.5;       // m/s
constexpr double mark_angle = 30 * std::numbers::pi / 180;
constexpr double grip = 2;               // N m/rad
constexpr uint32_t tick_length = 1000;   // us
constexpr double power_up_angle = 0.3;   // rad: where the counters begin

double part(fs_vec3 v, int i) { return i == 0 ? v.x : i == 1 ? v.y : v.z; }

// The angles of the joints where the handle is.
fs_vec3 angles_at(fs_vec3 position, double scale) {
  const auto angles = fs::delta_inverse(fidel::geometry, fidel::to_delta((1 / scale) * position));
  return angles.value_or(fs_vec3{});
}

int32_t counts(double angle, double per_turn) { return static_cast<int32_t>(std::lround(angle / fidel::count_angle(per_turn))); }

}  // namespace

FidelModel::FidelModel(const FidelOptions& options) : options_(options) {
  void* const memory = mmap(nullptr, sizeof(FidelBody), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::runtime_error("no shared memory");
  body_ = new (memory) FidelBody;
  fidel_constants constants{};
  std::memcpy(constants.serial, options.serial.data(), std::min(options.serial.size(), sizeof constants.serial));
  constants.firmware_version = 0x0100;
  constants.base_radius = 170000;
  constants.platform_radius = 50000;
  constants.upper_arm = 200000;
  constants.forearm = 330000;
  constants.centre_depth = 280000;
  constants.joint_counts = 80000;
  constants.wrist_counts = 20000;
  constants.joint_torque = 5520000;
  constants.wrist_torque = static_cast<uint32_t>(std::lround(1e6 * options.wrist_torque));
  constants.joint_speed = 12000;
  fidel_firmware_start(&body_->firmware, &constants);
  read_encoders();
  if (!options.is_homed) return;
  body_->firmware.marks = 7;
  for (int i = 0; i < 3; ++i) {
    body_->firmware.offsets[i] = counts(mark_angle, 80000) - counts(mark_angle + options.mark_errors[i] - power_up_angle, 80000);
  }
}

FidelModel::~FidelModel() { munmap(body_, sizeof(FidelBody)); }

void FidelModel::read_encoders() {
  FidelBody& b = *body_;
  const fs_vec3 angles = angles_at(b.position, options_.scale);
  for (int i = 0; i < 3; ++i) {
    const double mark = mark_angle + options_.mark_errors[i];
    const int32_t mark_count = counts(mark - power_up_angle, 80000);
    const int32_t before = b.inputs.counters[i];
    int32_t now = counts(part(angles, i) - power_up_angle, 80000);
    if (i == b.stuck_joint) now = b.stuck_count;
    now += b.jump[i];
    b.inputs.at_mark[i] = (before < mark_count) != (now < mark_count);
    b.inputs.mark_counters[i] = mark_count;
    b.inputs.counters[i] = now;
    b.inputs.wrist[i] = static_cast<int16_t>(counts(part(b.wrist, i), 20000));
  }
}

void FidelModel::step() {
  FidelBody& b = *body_;
  const fs_vec3 way = b.target - b.hand;
  b.hand += std::min(1.0, hand_speed * step_length / std::max(1e-9, fs::norm(way))) * way;
  fs_vec3 target = b.hand;
  if (b.shakes) {
    const double angle = 4 * std::numbers::pi * 1e-6 * b.clock;
    target = target + fs_vec3{0.02 * std::cos(angle), 0.02 * std::sin(angle), 0.01 * std::sin(2 * angle)};
  }
  const fs_vec3 input = b.force + b.hand_stiffness * (target - b.position) - b.hand_damping * b.velocity;
  b.velocity += (step_length / b.mass) * input;
  b.position += step_length * b.velocity;
}

void FidelModel::tick() {
  FidelBody& b = *body_;
  for (int i = 0; i < steps_a_tick; ++i) step();
  b.clock += tick_length;
  read_encoders();
  fidel_firmware_tick(&b.firmware, &b.inputs, b.clock);

  // F = J^-T tau, by Cramer's rule with the columns of J.
  const fs_vec3 position = fidel::to_delta((1 / options_.scale) * b.position);
  const auto jacobian = fs::delta_jacobian(fidel::geometry, position, angles_at(b.position, options_.scale));
  const int32_t* const t = b.firmware.torques;
  b.force = {};
  if (jacobian) {
    const fs_mat3& j = jacobian->jacobian;
    const fs_vec3 x{j.xx, j.yx, j.zx}, y{j.xy, j.yy, j.zy}, z{j.xz, j.yz, j.zz};
    const double volume = fs::dot(x, fs::cross(y, z));
    b.force = (1e-6 / (volume * options_.scale)) *
              fidel::turned(t[0] * fs::cross(y, z) + t[1] * fs::cross(z, x) + t[2] * fs::cross(x, y));
  }
  b.wrist = b.wrist + 0.1 * ((1e-6 / grip) * fs_vec3{double(t[3]), double(t[4]), double(t[5])} - b.wrist);
  if (!std::any_of(t, t + 6, [](int32_t torque) { return torque != 0; })) return;
  if (b.last_torque != b.clock - tick_length) b.largest_start = std::max(b.largest_start, fs::norm(b.force));
  b.last_torque = b.clock;
}

void FidelModel::advance(double time) {
  FidelBody& b = *body_;
  if (!b.has_time) {
    b.has_time = true;
    b.time = time;
  }
  while (time - b.time >= 1e-6 * tick_length - 1e-9) {
    tick();
    b.time += 1e-6 * tick_length;
  }
}

void FidelModel::run(double duration) {
  body_->has_time = true;
  advance(body_->time + duration);
}

// ----------------------------------------------------------------------------------------------------------- the bus

std::vector<uint8_t> FidelModel::device_descriptor() const {
  return {18, 1, 0x00, 0x02, 0, 0, 0, 64, 0x09, 0x12, 0x01, 0x00, 0x00, 0x01, 1, 2, 3, 1};
}

std::vector<uint8_t> FidelModel::configuration_descriptor() const {
  return {9, 2, 32,   0, 1,  1,    0, 0x80, 50,          // the configuration, 32 bytes in all, powered by the bus
          9, 4, 0,    0, 2,  0xff, 0, 0,    0,           // the interface
          7, 5, 0x81, 3, 64, 0,    1,                 // interrupt IN
          7, 5, 0x01, 3, 64, 0,    1};                // interrupt OUT
}

std::string FidelModel::string(uint8_t index) const {
  return index == 1 ? "a laboratory" : index == 2 ? "FIDEL" : index == 3 ? options_.serial : "";
}

int FidelModel::control(const UsbSetup& setup, Bytes, std::vector<uint8_t>& answer, double time) {
  advance(time);
  uint8_t bytes[FIDEL_IDENTITY_SIZE];
  const int size =
      fidel_firmware_control(&body_->firmware, setup.request_type, setup.request, setup.value, setup.index, setup.length, bytes);
  if (size < 0) return -EPIPE;
  answer.assign(bytes, bytes + size);
  if (setup.request == 1 && size > 1) answer[1] = body_->version;
  return size;
}

int FidelModel::out(uint8_t endpoint, Bytes data, double time) {
  advance(time);
  if (endpoint != 0x01) return -EPIPE;
  ++body_->commands;
  body_->last_command = body_->clock;
  const auto after_tick = static_cast<uint32_t>(std::lround(1e6 * std::max(0.0, time - body_->time)));
  if (!body_->is_deaf) fidel_firmware_command(&body_->firmware, data.data(), data.size(), body_->clock + after_tick);
  return static_cast<int>(data.size());
}

int FidelModel::in(uint8_t endpoint, size_t capacity, std::vector<uint8_t>& data, double time) {
  advance(time);
  FidelBody& b = *body_;
  if (endpoint != 0x81) return -EPIPE;
  if (b.clock == reported_ || b.is_silent) return -EAGAIN;
  const uint32_t missed = reported_ == 0 ? 0 : (b.clock - reported_) / tick_length - 1;
  reported_ = b.clock;
  if (b.repeats) --b.firmware.report_number;
  else b.firmware.report_number = static_cast<uint16_t>(b.firmware.report_number + missed);  // replaced by this one
  uint8_t report[FIDEL_REPORT_SIZE];
  fidel_firmware_report(&b.firmware, report);
  ++b.reports;
  data.assign(report, report + sizeof report);
  if (b.damages && b.reports % static_cast<uint32_t>(b.damages) == 0) data[9] ^= 0x40;
  data.resize(static_cast<size_t>(static_cast<int>(data.size()) - b.cuts));
  if (data.size() > capacity) return -EOVERFLOW;
  return static_cast<int>(data.size());
}

}  // namespace scenes
