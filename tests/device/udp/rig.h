// fidel-controller, a relay, and a scene with a servo on the device "fidel:udp" behind both; what passes on the way is kept.
#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "api/support.h"
#include "device/fidel/udp/protocol.h"
#include "device/udp/controller_process.h"
#include "device/udp/relay.h"

namespace scenes {

template <class Condition>
bool until(Condition condition) {
  for (Patience patience; patience.lasts();) {
    if (condition()) return true;
  }
  return false;
}

inline bool is_state(const Bytes& bytes, fs::udp::Header& header, fs::udp::State& state) {
  return open(bytes.data(), bytes.size(), header) == fs::udp::Opened::good && header.type == fs::udp::Type::state &&
         decode(bytes.data(), bytes.size(), state);
}

class UdpRig {
  mutable std::mutex mutex_;  // of the next; both outlive the relay
  std::vector<fs::udp::State> states_;

 public:
  ControllerProcess controller;
  Relay relay;
  Scene scene = make_scene();
  Device device;
  Servo servo;

  explicit UdpRig(const std::string& sim = "sim:?encoder=ideal", uint64_t seed = 1) : controller(sim), relay(controller.port(), seed) {
    relay.on_way_to_host([this](Bytes& bytes) { keep(bytes); });
  }

  void start(const char* options = "", fs_servo_options servo_options = fs_servo_options_init()) {
    device = open_device(relay.uri(options).c_str());
    servo = start_servo(scene.get(), device.get(), servo_options);
  }

  // 5 N to the right, everywhere. The nominal hand is pushed by 5/135 m.
  static constexpr double push = 5, pushed = push / 135;
  void set_push() {
    fs_object o = fs_object_init("push", FS_PRIMITIVE_POINT);
    o.pose.position.x = 10;
    o.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, push, 0, push);
    require(fs_object_set(scene.get(), &o), "fs_object_set");
  }

  fs_state hand() const {
    fs_state out{};
    require(fs_scene_get_hand(scene.get(), &out, nullptr, nullptr), "fs_scene_get_hand");
    return out;
  }
  double sent() const {  // N
    fs_wrench out{};
    require(fs_scene_get_hand(scene.get(), nullptr, nullptr, &out), "fs_scene_get_hand");
    return norm(out.force);
  }
  bool feels_push() const { return std::fabs(hand().pose.position.x - pushed) < 0.15 * pushed; }
  bool await_push() const { return until([&] { return feels_push(); }); }

  fs_servo_stats stats() const { return stats_of(scene.get()); }
  fs_tick last_tick() const {
    size_t count = 0;
    std::vector<fs_tick> ticks(20000);
    require(fs_servo_get_record(servo.get(), ticks.data(), ticks.size(), &count), "fs_servo_get_record");
    return count ? ticks[count - 1] : fs_tick{};
  }
  bool is_lost() const { return last_tick().device == FS_ERROR_DISCONNECTED; }
  std::string ask(const char* request) const {
    fs_answer answer{};
    EXPECT(FS_OK, fs_device_control(device.get(), request, &answer));
    return answer.text;
  }

  // The states that the controller has sent.
  std::vector<fs::udp::State> states() const {
    const std::lock_guard lock(mutex_);
    return states_;
  }
  void forget_states() {
    const std::lock_guard lock(mutex_);
    states_.clear();
  }
  void keep(const Bytes& bytes) {
    fs::udp::Header header{};
    fs::udp::State state;
    if (!is_state(bytes, header, state)) return;
    const std::lock_guard lock(mutex_);
    states_.push_back(state);
  }
};

// The number behind this word, such as "jumps of a clock: 2"; -1: it is not there.
inline double number_behind(const std::string& text, const std::string& word) {
  const size_t at = text.find(word);
  return at == std::string::npos ? -1 : std::atof(text.c_str() + at + word.size());
}

}  // namespace scenes
