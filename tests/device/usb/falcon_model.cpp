#include "device/usb/falcon_model.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <utility>

namespace scenes {
namespace {

constexpr double pi = 3.14159265358979323846;
constexpr double watchdog = 0.02;       // s without a command: no force
constexpr double answer_after = 0.0006; // s
constexpr uint16_t baud_greeting = 0x4138, baud_image = 0x15, baud_packets = 0x2;

// The angle of an arm (rad) by bisection: the platform's end of its forearm is as far from the arm's end as the forearm allows.
double arm_angle(fs_vec3 p, double leg) {
  constexpr double a = .060, b = .1025, c = .01443, offsets = .0225, f = -.025, r = .0400, s = -.02309;
  const double u = std::cos(leg) * p.x + std::sin(leg) * p.y - r, v = -std::sin(leg) * p.x + std::cos(leg) * p.y - s;
  const double length = offsets + std::sqrt(b * b - (v + f) * (v + f)), out = u + c;
  const auto excess = [&](double angle) { return std::hypot(out - a * std::cos(angle), p.z - a * std::sin(angle)) - length; };
  // The distance grows as the arm turns away from the platform: from the direction of the platform, down by up to half a turn.
  double high = std::atan2(p.z, out), low = high - pi;
  for (int i = 0; i < 48; ++i) {
    const double middle = 0.5 * (low + high);
    (excess(middle) > 0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

std::array<double, 3> angles(fs_vec3 p) {
  return {arm_angle(p, 105 * pi / 180), arm_angle(p, -15 * pi / 180), arm_angle(p, -135 * pi / 180)};
}

// The force of torques at a position: work of the torques per way.
fs_vec3 force_of(const std::array<double, 3>& torques, fs_vec3 p) {
  constexpr double step = 1e-5;
  const auto along = [&](fs_vec3 way) {
    const auto more = angles(p + step * way), less = angles(p - step * way);
    double work = 0;
    for (size_t i = 0; i < 3; ++i) work += torques[i] * (more[i] - less[i]) / (2 * step);
    return work;
  };
  return {along({1, 0, 0}), along({0, 1, 0}), along({0, 0, 1})};
}

}  // namespace

std::array<double, 3> FalconModel::counts_at(fs_vec3 position) {
  std::array<double, 3> counts = angles(position);
  for (double& count : counts) count = (count * 180 / pi - 35) / 0.036435;
  return counts;
}

std::vector<uint8_t> FalconModel::device_descriptor() const {
  return {18, 1, 0x00, 0x02, 0, 0, 0, 8, 0x03, 0x04, 0x48, 0xcb, 0x00, 0x06, 1, 2, 3, 1};
}

std::vector<uint8_t> FalconModel::configuration_descriptor() const {
  return {9, 2, 32, 0, 1, 1, 0, 0xa0, 45, 9, 4, 0, 0, 2, 0xff, 0xff, 0xff, 2, 7, 5, 0x81, 2, 64, 0, 0, 7, 5, 0x02, 2, 64, 0, 0};
}

std::string FalconModel::string(uint8_t index) const {
  return index == 1 ? "FTDI" : index == 2 ? "FALCON HAPTIC" : index == 3 ? serial_ : "";
}

int FalconModel::control(const UsbSetup& setup, Bytes, std::vector<uint8_t>&, double time) {
  advance(time);
  if (setup.request_type != 0x40 || setup.index != 0) return -EPIPE;
  switch (setup.request) {
    case 0:
      if (setup.value != 2) for_host_.clear();
      return 0;
    case 1:
      if (setup.value == 0x0101 && !dtr_ && baud_ == baud_greeting && !has_firmware) {
        is_listening_ = true;
        is_loading_ = is_announced_ = false;
        heard_.clear();
      }
      if (setup.value & 0x0100) dtr_ = setup.value & 1;
      return 0;
    case 2:
    case 4: return 0;
    case 3: baud_ = setup.value; return 0;
    case 9: latency_ = setup.value; return 0;
    default: return -EPIPE;
  }
}

int FalconModel::out(uint8_t endpoint, Bytes data, double time) {
  if (endpoint != 0x02) return -EPIPE;
  if (const double since = std::exchange(reported_, 0); since > 0 && turnarounds) turnarounds->push_back(time - since);
  advance(time);
  for (const uint8_t byte : data) {
    if (has_firmware && baud_ == baud_packets) packet_byte(byte);
    else if (is_loading_ && baud_ == baud_image && !dtr_) image_byte(byte);
    else if (is_listening_ && baud_ == baud_greeting && dtr_) boot(byte);
    else ++nonsense;
  }
  return static_cast<int>(data.size());
}

void FalconModel::boot(uint8_t byte) {
  heard_.push_back(byte);
  if (heard_.size() < 3) return;
  const bool is_greeting = heard_ == std::vector<uint8_t>{0x0a, 0x43, 0x0d};
  heard_.clear();
  if (!is_greeting || deaf_greetings-- > 0) return;
  for (const uint8_t answer : {0x00, 0x0a, 0x44, 0x2c, 0x0d}) for_host_.push_back(answer);
  is_loading_ = true;
  image_.clear();
}

void FalconModel::image_byte(uint8_t byte) {
  if (!std::exchange(is_announced_, true)) return for_host_.push_back(byte);
  const bool is_wrong = static_cast<int>(image_.size()) == wrong_echo_at;
  if (is_wrong) wrong_echo_at = -1;
  image_.push_back(byte);
  for_host_.push_back(static_cast<uint8_t>(is_wrong ? ~byte : byte));
  if (image_ != firmware) return;
  has_firmware = true;
  is_homed = is_loading_ = is_listening_ = false;
}

void FalconModel::packet_byte(uint8_t byte) {
  if (packet_.empty() && byte != '<') ++nonsense;
  else packet_.push_back(byte);
  if (packet_.size() < 16) return;
  if (packet_.back() == '>') command();
  else ++nonsense;
  packet_.clear();
}

void FalconModel::command() {
  for (size_t i = 0; i < 3; ++i) {
    int value = 0;
    for (size_t k = 0; k < 4; ++k) value |= (packet_[1 + 4 * i + k] - 'A') << 4 * k;
    motors[i] = static_cast<int16_t>(value);
    most_motor = std::max(most_motor, std::abs(motors[i]));
  }
  lights = packet_[13] - 'A';
  if ((lights & 1) && homes_when_asked) is_homed = true;
  ++commands;
  last_command_ = time_;
  queued += !owed_.empty();
  owed_.push_back(std::max(owed_.empty() ? 0 : owed_.back(), time_ + std::exchange(late, 0)) + answer_after);
}

void FalconModel::report() {
  const std::array<double, 3> counts = counts_at(position_);
  for_host_.push_back('<');
  for (size_t i = 0; i < 3; ++i) {
    const int exact = static_cast<int>(std::floor(counts[i])) + encoder_offset[i] + (is_homed ? 0 : 700);
    if (!is_encoder_stuck[i]) stuck_at_[i] = exact;
    for (int k = 0; k < 4; ++k) for_host_.push_back(static_cast<uint8_t>('A' + (static_cast<unsigned>(stuck_at_[i]) >> 4 * k & 15)));
  }
  for_host_.push_back(static_cast<uint8_t>('A' + (odd_buttons & 15) + (is_homed ? 0x70 : 0x20)));
  for_host_.push_back('A');
  for_host_.push_back('>');
}

int FalconModel::in(uint8_t endpoint, size_t capacity, std::vector<uint8_t>& data, double time) {
  if (endpoint != 0x81) return -EPIPE;
  advance(time);
  for (; !owed_.empty() && time >= owed_.front(); owed_.pop_front()) {
    if (answers) report();
  }
  if (for_host_.empty() && time < last_in_ + 1e-3 * latency_) return -EAGAIN;
  last_in_ = time;
  data = {0x01, 0x60};
  if (for_host_.size() >= 16) reported_ = time;
  const size_t count = std::min({capacity - 2, for_host_.size(), size_t{62}});
  data.insert(data.end(), for_host_.begin(), for_host_.begin() + static_cast<std::ptrdiff_t>(count));
  for_host_.erase(for_host_.begin(), for_host_.begin() + static_cast<std::ptrdiff_t>(count));
  return static_cast<int>(data.size());
}

void FalconModel::advance(double time) {
  if (time_ == 0) time_ = time;
  if (time - last_command_ > watchdog) motors = {};
  if (motors == std::array<int, 3>{}) force_ = {};
  else force_ = force_of({motors[0] / -1e4, motors[1] / -1e4, motors[2] / -1e4}, position_);
  if (norm(force_) > 0) last_force_time = time;
  constexpr double step = 5e-4;
  for (int i = 0; time_ < time && i < 40; ++i) {
    const double dt = std::min(step, time - time_);
    const fs_vec3 pull = hand_stiffness * (target - position_) - hand_damping * velocity_;
    velocity_ = velocity_ + (dt / mass) * (pull + force_);
    position_ = position_ + dt * velocity_;
    const fs_vec3 aside = position_ - fs_vec3{0, 0, 0.125};
    if (norm(aside) > 0.045) {  // its end stop
      position_ = fs_vec3{0, 0, 0.125} + (0.045 / norm(aside)) * aside;
      velocity_ = {};
    }
    time_ += dt;
  }
  time_ = time;
  if (is_held_fast) {
    position_ = target;
    velocity_ = {};
  }
}

}  // namespace scenes
