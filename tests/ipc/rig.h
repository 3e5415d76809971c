// A servo with a server, an honest client that must not be disturbed, and checks at each tick.
#pragma once

#include <memory>

#include "api/world.h"
#include "ipc/raw_client.h"

namespace hostile {

using scenes::eventually;
using scenes::new_endpoint;

constexpr double client_limit = 2;   // N, of each client
constexpr double device_limit = 10;  // N, of the servo
constexpr double torque_limit = 1;   // N m
constexpr double rig_fade = 0.02;    // s

inline fs_servo_options servo_options(fs_servo_mode mode = FS_SERVO_VIRTUAL) {
  fs_servo_options options = fs_servo_options_init();
  options.mode = mode;
  options.rate = 1000;
  options.ramp = options.speed_limit = options.blend = -1;
  options.fade = rig_fade;
  return options;
}

inline fs_server_options server_options() {
  fs_server_options options = fs_server_options_init();
  options.force_limit = client_limit;
  options.lease = 0.01;
  return options;
}

// How many descriptors this process has.
inline size_t open_files() {
  const std::filesystem::directory_iterator files("/proc/self/fd");
  return static_cast<size_t>(std::distance(begin(files), end(files)));
}
inline bool is_near(fs_vec3 a, fs_vec3 b, double tolerance = 1e-9) {
  return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z) <= tolerance;
}
inline bool is_finite(fs_vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

// The same force everywhere (N), along a direction.
inline fs_object push(const char* name, double force, fs_vec3 direction = {1, 0, 0}) {
  return scenes::push(name, force, direction);
}

class Rig {
 public:
  explicit Rig(const fs_server_options& options = server_options(), const fs_servo_options& servo = servo_options(),
               bool has_torque = true)
      : fake_(new_endpoint()), is_virtual_(servo.mode == FS_SERVO_VIRTUAL) {
    using namespace scenes;
    fake_.info.force_max = device_limit;
    fake_.info.torque_axes = has_torque ? 3 : 0;
    fake_.info.torque_max = has_torque ? torque_limit : 0;
    device_ = fake_.open();
    servo_ = start_servo(scene_.get(), device_.get(), servo);
    endpoint = new_endpoint();
    server_ = start_server(servo_.get(), endpoint, options);
    honest_ = std::make_unique<RawClient>(endpoint);
    honest_->join("honest");
    aim();
    set_serial_ = honest_->set(0, push("wall", 1, wanted_));
    ck_assert_msg(until([&] { return is_near(honest_force(), wanted_); }), "the honest client is not felt");
    is_settled_ = true;
  }

  // A client that was accepted, and one that has only connected.
  RawClient join(const std::string& name) {
    RawClient out(endpoint);
    out.join(name);
    return out;
  }
  RawClient stranger() { return RawClient(endpoint); }

  // Runs ticks one at a time and checks each: the force is finite and within the limits, and the honest client's force
  // is the one it set. A servo with a thread of its own ticks by itself: then all its ticks so far are checked.
  void tick(int count = 1) {
    for (int i = 0; i < count; ++i) {
      if (is_virtual_) OK(fs_servo_step(servo_.get(), 1));
      else scenes::wait_a_little();
      look();
    }
  }

  // Ticks until it is so; whether it came to that.
  template <class F>
  bool until(F&& is_so) {
    return eventually([&] {
      tick();
      return is_so();
    });
  }

  // Checks that the honest client is served as before: it moves its object, which is felt, and its requests are
  // answered.
  void check_honest() {
    before_ = wanted_;
    aim();
    has_arrived_ = false;
    honest_->move(0, set_serial_, pose_);
    ck_assert_msg(until([&] { return has_arrived_; }), "the honest client's move is not felt");
    const uint64_t serial = honest_->send(fs::wire::type_sync);
    std::optional<RawClient::Reply> reply;
    ck_assert_msg(until([&] { return bool(reply = honest_->reply_of(serial, 1e-3)); }), "no answer to the honest client");
    ck_assert_int_eq(reply->status, FS_OK);
    fs_event event;
    ck_assert_msg(!honest_->next_refusal(event), "refused to the honest client: %s", event.text);
    ck_assert(!honest_->is_dropped());
  }

  // Waits until the server has disconnected a client.
  void expect_dropped(const RawClient& client, const char* why) {
    ck_assert_msg(until([&] { return client.is_dropped(); }), "not dropped: %s", why);
  }
  // Checks the client's next refusal, whose sentence must have this part.
  fs_event expect_refusal(RawClient& client, fs_status status, const char* part) {
    fs_event event;
    ck_assert_msg(until([&] { return client.next_refusal(event); }), "not refused: '%s'", part);
    ck_assert_msg(event.status == status && std::strstr(event.text, part), "%s: \"%s\", not %s with '%s'",
                  fs_status_name(event.status), event.text, fs_status_name(status), part);
    return event;
  }
  // Waits until all that the client has sent is done; returns the status of the first refusal.
  fs_status sync(RawClient& client) {
    const uint64_t serial = client.send(fs::wire::type_sync);
    std::optional<RawClient::Reply> reply;
    until([&] { return bool(reply = client.reply_of(serial, 1e-3)) || client.is_dropped(); });
    return client.status_of(reply);
  }
  // The client as the server lists it; all zeros: it is not listed.
  fs_client listed(const std::string& name) {
    const std::optional<RawClient::Reply> reply = honest_->reply_of(honest_->send(fs::wire::type_clients));
    ck_assert(reply && reply->status == FS_OK);
    std::vector<fs_client> list(reply->as<fs::wire::Count>().count);
    fs::read_blob(reply->data, 0, std::as_writable_bytes(std::span(list)));
    for (const fs_client& client : list) {
      if (client.name == name) return client;
    }
    return {};
  }

  fs_vec3 honest_force() {
    fs::HandSample hand;
    ck_assert(honest_->outbox->servo.hand.read(hand));
    return hand.response.wrench.force;
  }
  // The force that all other clients add at the last tick, before the guard.
  fs_vec3 foreign_force() const { return foreign_; }
  fs_vec3 torque() const { return torque_; }

  fs_servo* servo() { return servo_.get(); }
  fs_scene* scene() { return scene_.get(); }
  RawClient& honest() { return *honest_; }
  void stop_server() { server_.reset(); }
  scenes::FakeDevice& fake() { return fake_; }

  std::string endpoint;
  int others = 1;  // the most other clients that push at a time

 private:
  void aim() {
    using namespace scenes;
    wanted_ = random_.direction();
    require(fs_pose_from_z(-100.0 * wanted_, wanted_, &pose_), "fs_pose_from_z");
  }

  void look() {
    using namespace scenes;
    fs_tick newest[100];
    size_t count = 0;
    OK(fs_servo_get_record(servo_.get(), newest, is_virtual_ ? 1 : 100, &count));
    for (size_t i = 0; i < std::min<size_t>(count, is_virtual_ ? 1 : 100); ++i) {
      const fs_tick& t = newest[i];
      const fs_vec3 force = t.response.wrench.force, sent = t.sent.force;
      ck_assert(is_finite(force) && is_finite(t.response.wrench.torque) && is_finite(sent) && is_finite(t.sent.torque));
      ck_assert_msg(norm(sent) <= device_limit * (1 + 1e-12) && norm(t.sent.torque) <= torque_limit * (1 + 1e-12),
                    "%g N are sent", norm(sent));
      ck_assert_msg(norm(force) <= 1 + others * client_limit + 1e-9, "the clients push with %g N together", norm(force));
      // If the machine is too slow for the servo's thread, it stops, which is not a client's fault.
      ck_assert_msg(t.faults == 0 || (!is_virtual_ && t.faults == FS_FAULT_LATE), "fault %u", t.faults);
    }
    if (!is_virtual_) fs_servo_set_enabled(servo_.get(), true);
    if (!is_settled_) return;
    const fs_vec3 force = honest_force();
    const bool is_there = is_near(force, wanted_);
    ck_assert_msg(is_there || (!has_arrived_ && is_near(force, before_)),
                  "the honest client gives (%g, %g, %g) N instead of (%g, %g, %g)", force.x, force.y, force.z, wanted_.x,
                  wanted_.y, wanted_.z);
    has_arrived_ |= is_there;
    if (is_virtual_) foreign_ = newest[0].response.wrench.force - force;
    torque_ = newest[0].response.wrench.torque;
  }

  scenes::FakeDevice fake_;
  scenes::Scene scene_ = scenes::make_scene();
  scenes::Device device_;
  scenes::Servo servo_;
  scenes::Server server_;
  std::unique_ptr<RawClient> honest_;
  const bool is_virtual_;

  scenes::Random random_{7};
  fs_pose pose_;
  fs_vec3 wanted_{}, before_{}, foreign_{}, torque_{};
  uint64_t set_serial_ = 0;
  bool is_settled_ = false, has_arrived_ = true;
};

}  // namespace hostile
