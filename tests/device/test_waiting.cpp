// Drivers that wait for their device: the library's thread, the pace of the servo, forces that end, hangs, devices that come back.
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "api/support.h"
#include "device/waiting_device.h"

using namespace scenes;

namespace {

constexpr double stiffness = 100;  // N/m

// A spring at the origin, felt by the hand of a device that waits.
struct Loop {
  explicit Loop(WaitingDevice& the_device, fs_servo_mode mode = FS_SERVO_THREAD, double ramp = -1)
      : scene(make_scene()), device(the_device.open()) {
    fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
    spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, stiffness, 0, 5);
    require(fs_object_set(scene.get(), &spring), "fs_object_set");
    fs_servo_options options = fs_servo_options_init();
    options.mode = mode;
    options.fade = options.damping = -1;
    options.ramp = ramp;
    options.max_stiffness = -1;
    servo = start_servo(scene.get(), device.get(), options);
  }
  fs_servo_stats stats() const {
    fs_servo_stats out = fs_servo_stats_init();
    require(fs_scene_get_servo_stats(scene.get(), &out), "fs_scene_get_servo_stats");
    return out;
  }

  Scene scene;
  Device device;
  Servo servo;
};

template <class Condition>
bool until(Condition condition) {
  for (Patience patience; patience.lasts();) {
    if (condition()) return true;
  }
  return false;
}

bool is_zero(const fs_wrench& w) { return norm(w.force) == 0 && norm(w.torque) == 0; }

// The handle is 10 mm to the right.
void aside(fs_state& state, uint64_t) { state.pose.position.x = 0.01; }

fs_wrench last_sent(const WaitingDevice& device) {
  const auto sent = device.sent();
  return sent.empty() ? fs_wrench{} : sent.back().wrench;
}
bool pushes(const WaitingDevice& device) { return last_sent(device).force.x < -0.9; }

// The text of the newest event of the device that has this word; "": there is none yet.
std::string event_with(fs_scene* scene, const char* word) {
  fs_event event;
  while (fs_scene_next_event(scene, 0, &event) == FS_OK && event.kind != FS_EVENT_NONE) {
    if (event.kind == FS_EVENT_DEVICE && std::strstr(event.text, word)) return event.text;
  }
  return "";
}

}  // namespace

// The force for a state is sent before the next state is asked for, in spite of threads and clocks.
static void force_answers_its_state(uint32_t flags, const char* scheme) {
  WaitingDevice device(scheme, flags);
  device.on_state = [](fs_state& state, uint64_t number) { state.pose.position.x = 1e-6 * static_cast<double>(number); };
  Loop loop(device);
  ck_assert(until([&] { return device.states() > 1000; }));
  loop.servo.reset();
  int good = 0, all = 0;
  for (const WaitingDevice::Sent& sent : device.sent()) {
    if (is_zero(sent.wrench)) continue;
    ++all;
    good += std::fabs(-sent.wrench.force.x / stiffness - 1e-6 * static_cast<double>(sent.answers)) < 1e-9;
  }
  std::printf("  %s: %d of %d forces answer the newest state\n", scheme, good, all);
  ck_assert_int_gt(all, 500);
  ck_assert_int_ge(good, all * (is_sanitized ? 5 : 8) / 10);  // the others: the machine was busy for a period
}
START_TEST(a_state_paces_the_servo) { force_answers_its_state(0, "paced"); }
END_TEST
START_TEST(the_servos_thread_calls_the_driver) { force_answers_its_state(FS_DRIVER_IN_SERVO, "inservo"); }
END_TEST

// After a pause of any length the force is still there, or has ended and begins again by the ramp.
START_TEST(no_pause_makes_a_step) {
  WaitingDevice device("pausing");
  device.on_state = aside;
  Loop loop(device, FS_SERVO_CALLER, 0);
  const auto step = [&](double after) {
    std::this_thread::sleep_for(std::chrono::duration<double>(after));
    const fs_status status = fs_servo_step(loop.servo.get(), 1);  // DISCONNECTED: the machine was busy, and its state is old
    ck_assert_msg(status == FS_OK || status == FS_ERROR_DISCONNECTED, "%s", fs_last_error());
  };
  const double until = now_s() + 30;  // of a busy machine, on which the force seldom comes back
  for (double pause = 0.018; pause < 0.03 && now_s() < until; pause += 4e-4) {
    do {
      for (int i = 0; i < 50; ++i) step(5e-4);
    } while (!pushes(device) && now_s() < until);
    step(pause);
  }
  int ends = 0;
  double last = 0;
  for (const WaitingDevice::Sent& sent : device.sent()) {
    const double force = norm(sent.wrench.force);
    ck_assert_msg(force < last + 0.2, "%g N, and then %g N", last, force);
    ends += force == 0 && last > 0.9;
    last = force;
  }
  ck_assert_int_gt(ends, 0);
}
END_TEST

START_TEST(a_driver_in_the_servo_is_lent_and_given_back) {
  WaitingDevice device("lent", FS_DRIVER_IN_SERVO);
  device.on_state = aside;
  uint64_t before = 0;
  {
    Loop loop(device);
    ck_assert(until([&] { return !device.sent().empty(); }));
    before = device.sent().front().thread;  // of the library, until the servo's thread takes over
    ck_assert(until([&] { return device.sent().back().thread != before && pushes(device); }));
    loop.servo.reset();
    ck_assert(is_zero(last_sent(device)));
    ck_assert(until([&] { return device.sent().back().thread == before; }));
    // A second servo gets it, too.
    loop.servo = start_servo(loop.scene.get(), loop.device.get(), fs_servo_options_init());
    ck_assert(until([&] { return device.sent().back().thread != before; }));
  }
  ck_assert(!device.is_open());
  ck_assert(is_zero(last_sent(device)));
}
END_TEST

// Whatever the driver's own pace, the servo ticks at its rate.
START_TEST(slow_and_fast_states) {
  for (const double period : {1.7e-3, 1e-4}) {
    WaitingDevice device("pace");
    device.period = period;
    Loop loop(device);
    const fs_servo_stats before = loop.stats();
    const double begin = now_s();
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    const double ticks = static_cast<double>(loop.stats().ticks - before.ticks) / (now_s() - begin);
    std::printf("  a state each %g ms: %.0f ticks/s\n", 1e3 * period, ticks);
    ck_assert_double_lt(ticks, 2100);
    ck_assert_double_gt(ticks, 100);  // a busy machine
  }
}
END_TEST

START_TEST(a_force_ends_soon_after_the_last_tick) {
  WaitingDevice device("fading");
  device.on_state = aside;
  Loop loop(device, FS_SERVO_CALLER);
  ck_assert(until([&] {
    fs_servo_step(loop.servo.get(), 1);
    return pushes(device);
  }));
  const double last = now_s();
  ck_assert(until([&] { return device.sent().back().time > last + 0.1; }));
  for (const WaitingDevice::Sent& sent : device.sent()) {
    if (sent.time > last + 0.045) ck_assert_msg(is_zero(sent.wrench), "%g ms after the last tick", 1e3 * (sent.time - last));
  }
}
END_TEST

START_TEST(what_is_written_without_a_servo_stays) {
  WaitingDevice device("lasting");
  const Device handle = device.open();
  fs_state state;
  OK(fs_device_read(handle.get(), &state));
  ck_assert_uint_eq(state.flags, FS_STATE_READY);  // a state has come before the open returned
  const fs_wrench wrench{{1, 2, 3}, {}};
  OK(fs_device_write(handle.get(), &wrench));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_VECTOR(last_sent(device).force, wrench.force, 1e-12);
  {  // but not when the device has been lost meanwhile
    const std::lock_guard lock(device.mutex);
    device.receive_status = FS_ERROR_DISCONNECTED;
  }
  ck_assert(until([&] { return device.closes() > 0; }));
  {
    const std::lock_guard lock(device.mutex);
    device.receive_status = FS_OK;
  }
  ck_assert(until([&] { return is_zero(last_sent(device)); }));
  OK(fs_device_write(handle.get(), &wrench));
  ck_assert(until([&] { return !is_zero(last_sent(device)); }));
}
END_TEST

// ------------------------------------------------------------------------------------------------------- what goes wrong

START_TEST(a_hang_holds_up_nobody) {
  for (const auto call : {WaitingDevice::in_receive, WaitingDevice::in_send, WaitingDevice::in_close, WaitingDevice::in_link}) {
    WaitingDevice device("hangs");
    device.on_state = aside;
    auto loop = std::make_unique<Loop>(device);
    ck_assert(until([&] { return pushes(device); }));
    device.hang(call);
    if (call != WaitingDevice::in_close) {
      device.await_hanging();
      const uint64_t ticks = loop->stats().ticks;
      ck_assert(until([&] { return loop->stats().ticks > ticks + 100; }));
      ck_assert(until([&] { return (loop->stats().faults & FS_FAULT_DEVICE) != 0; }));
    }
    const double begin = now_s();
    loop = nullptr;  // stops the servo and closes the device
    std::printf("  hanging in call %d: stopped and closed within %.2f s\n", call, now_s() - begin);
    ck_assert_double_lt(now_s() - begin, 10);
    ck_assert(device.is_open());  // it still hangs
    device.let_go();
    ck_assert(until([&] { return !device.is_open(); }));
    if (call != WaitingDevice::in_close) ck_assert(is_zero(last_sent(device)));
  }
}
END_TEST

// One that has promised not to hang, and so has the servo's thread: that is left behind, and with it the device.
START_TEST(a_broken_promise_holds_up_no_stop) {
  for (const auto call : {WaitingDevice::in_receive, WaitingDevice::in_send}) {
    WaitingDevice& device = *new WaitingDevice(call == WaitingDevice::in_send ? "promise2" : "promise1", FS_DRIVER_IN_SERVO);
    device.on_state = aside;
    auto loop = std::make_unique<Loop>(device);
    ck_assert(until([&] { return pushes(device); }));
    device.hang(call);
    device.await_hanging();
    const double begin = now_s();
    fs_servo_stop(loop->servo.release());
    ck_assert_double_lt(now_s() - begin, 10);
    fs_servo* second = nullptr;
    const fs_servo_options options = fs_servo_options_init();
    EXPECT_SENTENCE(FS_ERROR_STATE, fs_servo_start(loop->scene.get(), loop->device.get(), &options, &second), "has a servo already");
    device.let_go();
    ck_assert(until([&] { return is_zero(last_sent(device)); }));
  }
}
END_TEST

START_TEST(a_process_ends_in_spite_of_a_hang) {
  for (const auto call :
       {WaitingDevice::in_receive, WaitingDevice::in_send, WaitingDevice::in_close, WaitingDevice::in_control}) {
    const pid_t child = fork();
    ck_assert_int_ge(child, 0);
    if (child == 0) {
      static WaitingDevice device("endless", FS_DRIVER_IN_SERVO);
      device.on_state = aside;
      static Loop loop(device, FS_SERVO_THREAD);
      while (!pushes(device)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      device.hang(call);
      if (call == WaitingDevice::in_control) {
        std::thread([] {
          fs_answer answer;
          fs_device_control(loop.device.get(), "echo", &answer);
        }).detach();
      }
      if (call != WaitingDevice::in_close) device.await_hanging();
      std::quick_exit(0);
    }
    int status = -1;
    ck_assert_msg(until([&] { return waitpid(child, &status, WNOHANG) == child; }), "hanging in call %d", call);
    ck_assert_int_eq(status, 0);
  }
}
END_TEST

// All that hang have one second together.
START_TEST(a_process_ends_in_spite_of_many_hangs) {
  const pid_t child = fork();
  ck_assert_int_ge(child, 0);
  if (child == 0) {
    static double begin = 0;
    std::at_quick_exit([] { std::_Exit(now_s() - begin < 3 ? 0 : 1); });  // called last, after what the devices add
    static WaitingDevice device("many");
    device.on_state = aside;
    static std::vector<Device> all;
    const fs_wrench wrench{{1, 0, 0}, {}};
    for (int i = 0; i < 8; ++i) {
      all.push_back(device.open());
      require(fs_device_write(all.back().get(), &wrench), "fs_device_write");
    }
    device.hang(WaitingDevice::in_receive);
    device.await_hanging();
    begin = now_s();
    std::quick_exit(2);
  }
  int status = -1;
  ck_assert(until([&] { return waitpid(child, &status, WNOHANG) == child; }));
  ck_assert_int_eq(status, 0);
}
END_TEST

START_TEST(a_lost_device_comes_back) {
  WaitingDevice device("lost");
  device.on_state = aside;
  Loop loop(device);
  ck_assert(until([&] { return pushes(device); }));
  {
    const std::lock_guard lock(device.mutex);
    device.receive_status = FS_ERROR_DISCONNECTED;
    device.open_status = FS_ERROR_NOT_FOUND;
  }
  ck_assert(until([&] { return device.closes() == 1; }));
  ck_assert(until([&] { return (loop.stats().faults & FS_FAULT_DEVICE) != 0; }));
  fs_answer answer;
  EXPECT(FS_ERROR_DISCONNECTED, fs_device_control(loop.device.get(), "echo", &answer));
  ck_assert(until([&] { return !event_with(loop.scene.get(), "lost").empty(); }));
  {  // Another device is plugged in: it is not taken.
    const std::lock_guard lock(device.mutex);
    device.receive_status = FS_OK;
    device.open_status = FS_OK;
    device.serial = "2";
  }
  const size_t sent = device.sent().size();
  ck_assert(until([&] { return device.closes() == 2; }));
  ck_assert_uint_eq(device.sent().size(), sent);
  const auto is_refused = [&](const char* why) {
    return until([&] {
      fs_device_control(loop.device.get(), "echo", &answer);
      return std::strstr(fs_last_error(), why) != nullptr;
    });
  };
  ck_assert(is_refused("another device is there: a device that waits, serial number '2'"));
  {  // The same with another handle is no longer what the loop was made for.
    const std::lock_guard lock(device.mutex);
    device.serial = "1";
    device.mass = 0.5;
  }
  ck_assert(is_refused("its mass is now 0.5, and was 0.3"));
  {
    const std::lock_guard lock(device.mutex);
    device.mass = 0.3;
  }
  ck_assert(until([&] { return pushes(device) && loop.stats().faults == 0; }));
  ck_assert(until([&] { return !event_with(loop.scene.get(), "ready").empty(); }));
  OK(fs_device_control(loop.device.get(), "echo", &answer));
  ck_assert_str_eq(answer.text, "1");
}
END_TEST

START_TEST(what_is_no_state_gives_no_force) {
  const auto bad = [](const char* what, auto change) {
    for (const uint32_t flags : {0u, uint32_t{FS_DRIVER_IN_SERVO}}) {
      WaitingDevice device(flags ? "bad2" : "bad1", flags);
      device.on_state = aside;
      Loop loop(device);
      ck_assert(until([&] { return pushes(device); }));
      {
        const std::lock_guard lock(device.mutex);
        change(device);
      }
      ck_assert_msg(until([&] { return is_zero(last_sent(device)); }), "%s", what);
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      ck_assert_msg(is_zero(last_sent(device)), "%s", what);
      {
        const std::lock_guard lock(device.mutex);
        device.receive_status = device.send_status = FS_OK;
        device.throws = false;
        device.period = 1e-3;
        device.on_state = aside;
      }
      const auto pushes_again = [&] {  // the last bad state may be told after it was enabled
        OK(fs_servo_set_enabled(loop.servo.get(), true));
        return pushes(device);
      };
      ck_assert_msg(until(pushes_again), "after %s", what);
    }
  };
  bad("IO", [](WaitingDevice& d) { d.receive_status = FS_ERROR_IO; });
  bad("a number that is no status", [](WaitingDevice& d) { d.receive_status = static_cast<fs_status>(99); });
  bad("an exception", [](WaitingDevice& d) { d.throws = true; });
  bad("silence", [](WaitingDevice& d) { d.period = 1e9; });
  bad("NaN", [](WaitingDevice& d) { d.on_state = [](fs_state& s, uint64_t) { s.pose.position.x = NAN; }; });
  bad("an orientation without length",
      [](WaitingDevice& d) { d.on_state = [](fs_state& s, uint64_t) { s.pose.orientation.w = 7; }; });
  bad("not homed", [](WaitingDevice& d) { d.on_state = [](fs_state& s, uint64_t) { s.flags = FS_STATE_NOT_HOMED; }; });
  bad("sends that fail", [](WaitingDevice& d) { d.send_status = FS_ERROR_IO; });
}
END_TEST

// After one call that failed, or one state that is not ready, good states follow at once: the force begins again by the ramp.
START_TEST(one_fault_is_felt_as_a_ramp) {
  const auto after = [](const char* what, auto change) {
    for (const uint32_t flags : {0u, uint32_t{FS_DRIVER_IN_SERVO}}) {
      WaitingDevice device(flags ? "once2" : "once1", flags);
      device.on_state = aside;
      Loop loop(device, FS_SERVO_THREAD, 0.2);
      for (int i = 0; i < 2; ++i) {
        ck_assert(until([&] { return pushes(device); }));
        size_t before = 0;
        {
          const std::lock_guard lock(device.mutex);
          before = device.sent().size();
          change(device);
        }
        const auto fault = [&] {
          const auto sent = device.sent();
          return std::any_of(sent.begin() + static_cast<ptrdiff_t>(before), sent.end(),
                             [](const auto& each) { return norm(each.wrench.force) < 0.3; });  // a loss ends by close
        };
        ck_assert_msg(until(fault), "after %s: the force does not end", what);
        ck_assert(until([&] { return pushes(device); }));
        const auto sent = device.sent();
        for (size_t k = before + 1; k < sent.size(); ++k) {
          const double step = norm(sent[k].wrench.force) - norm(sent[k - 1].wrench.force);
          ck_assert_msg(step < 0.3, "after %s: a step of %.2f N", what, step);  // 1 N within 0.2 s, and a tick may be late
        }
      }
    }
  };
  after("an error of receive", [](WaitingDevice& d) { d.next_receive = FS_ERROR_IO; });
  after("a loss that receive tells", [](WaitingDevice& d) { d.next_receive = FS_ERROR_DISCONNECTED; });
  after("a loss that send tells", [](WaitingDevice& d) { d.next_send = FS_ERROR_DISCONNECTED; });
  after("a state that is not ready", [](WaitingDevice& d) {
    const uint64_t number = d.states() + 5;
    d.on_state = [number](fs_state& state, uint64_t at) {
      aside(state, at);
      if (at == number) state.flags = FS_STATE_STOPPED;
    };
  });
}
END_TEST

// From the start on nothing comes.
START_TEST(silence_is_told) {
  WaitingDevice device("silent");
  device.period = 1e9;
  Loop loop(device);
  ck_assert(until([&] { return event_with(loop.scene.get(), "it does not answer yet").find("not ready") == 0; }));
  const uint64_t before = loop.stats().ticks;
  const double begin = now_s();
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  const double rate = static_cast<double>(loop.stats().ticks - before) / (now_s() - begin);
  std::printf("  without states: %.0f ticks/s\n", rate);
  ck_assert_double_gt(rate, 750);  // by the clock, 1000 on a machine with time
  loop.servo.reset();
  {
    const std::lock_guard lock(device.mutex);
    device.period = 1e-3;
  }
  ck_assert(until([&] { return device.states() > 10; }));
  {
    const std::lock_guard lock(device.mutex);
    device.period = 1e9;
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  while (!event_with(loop.scene.get(), "").empty()) {
  }
  loop.servo = start_servo(loop.scene.get(), loop.device.get(), fs_servo_options_init());
  ck_assert(until([&] { return event_with(loop.scene.get(), "ms old, must be at most").find("its pose is") == 0; }));
}
END_TEST

START_TEST(the_reason_is_told) {
  WaitingDevice device("why");
  device.on_state = [](fs_state& s, uint64_t) { s.flags = FS_STATE_NOT_HOMED; };
  Loop loop(device);
  ck_assert(until([&] { return !event_with(loop.scene.get(), "it is not homed").empty(); }));
  {
    const std::lock_guard lock(device.mutex);
    device.on_state = [](fs_state& s, uint64_t) { s.flags = FS_STATE_STOPPED | FS_STATE_TOO_FAST; };
  }
  ck_assert(until([&] { return !event_with(loop.scene.get(), "emergency stop").empty(); }));
  {
    const std::lock_guard lock(device.mutex);
    device.receive_status = FS_ERROR_DISCONNECTED;
    device.open_status = FS_ERROR_NOT_FOUND;
  }
  ck_assert(until([&] { return !event_with(loop.scene.get(), "lost").empty(); }));  // though it was not ready before
  {
    const std::lock_guard lock(device.mutex);
    device.receive_status = device.open_status = FS_OK;
    device.on_state = aside;
  }
  ck_assert(until([&] { return pushes(device); }));
  {
    const std::lock_guard lock(device.mutex);
    device.receive_status = FS_ERROR_IO;
    device.words = "the cable is red";
  }
  ck_assert(until([&] { return !event_with(loop.scene.get(), "its state could not be read (the cable is red)").empty(); }));
  {
    const std::lock_guard lock(device.mutex);
    device.receive_status = FS_OK;
  }
  ck_assert(until([&] { return pushes(device); }));
  {  // An event that is fetched late tells its own reason.
    const std::lock_guard lock(device.mutex);
    device.receive_status = FS_ERROR_DISCONNECTED;
    device.words = "the cable is out";
    device.open_status = FS_ERROR_NOT_FOUND;
  }
  std::this_thread::sleep_for(std::chrono::seconds(1));  // meanwhile it is looked for
  ck_assert(!event_with(loop.scene.get(), "lost: it is not connected (the cable is out)").empty());
  ck_assert(!event_with(loop.scene.get(), "lost: it is not connected (").empty());  // that it cannot be found
  {
    const std::lock_guard lock(device.mutex);
    device.receive_status = device.open_status = FS_OK;
  }
  ck_assert(until([&] { return event_with(loop.scene.get(), "ready") == "ready"; }));
  {  // What was said then is not the reason of this.
    const std::lock_guard lock(device.mutex);
    device.on_state = [](fs_state& s, uint64_t) { s.time = NAN; };
  }
  ck_assert(until([&] { return !event_with(loop.scene.get(), "its state could not be read; ").empty(); }));
  ck_assert_str_eq(fs_state_reason(0), "");
  ck_assert_str_eq(fs_state_reason(FS_STATE_READY | FS_STATE_CLUTCHED), "");
  ck_assert_str_eq(fs_state_reason(1u << 31), "");
  for (uint32_t bit = FS_STATE_CONNECTING; bit <= FS_STATE_TOO_FAST; bit *= 2)
    ck_assert_uint_gt(std::strlen(fs_state_reason(bit)), 10);
}
END_TEST

START_TEST(requests) {
  WaitingDevice device("asked");
  device.on_state = aside;
  Loop loop(device);
  fs_answer answer;
  OK(fs_device_control(loop.device.get(), "echo", &answer));
  ck_assert_str_eq(answer.text, "1");
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_control(loop.device.get(), "dance", &answer), "the requests are: echo");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_control(loop.device.get(), nullptr, &answer), "request");
  const Device sim = open_device("sim:");
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_control(sim.get(), "home", &answer), "'sim' has no requests");

  // A request that hangs holds up neither the servo nor its end.
  ck_assert(until([&] { return pushes(device); }));
  device.hang(WaitingDevice::in_control);
  std::thread asking([&] { fs_device_control(loop.device.get(), "echo", &answer); });
  device.await_hanging();
  const size_t sent = device.sent().size();
  ck_assert(until([&] { return device.sent().size() > sent + 100; }));
  ck_assert(pushes(device));
  loop.servo.reset();
  ck_assert(is_zero(last_sent(device)));
  device.let_go();
  asking.join();
}
END_TEST

START_TEST(tables_are_refused) {
  const auto refused = [](fs_status status, const char* word, auto change) {
    fs_driver driver{};
    driver.struct_size = sizeof driver;
    driver.scheme = "refused";
    driver.open = [](const char*, void**) { return FS_OK; };
    driver.close = [](void*) {};
    driver.get_info = [](void*, fs_device_info*) { return FS_OK; };
    driver.receive = [](void*, fs_state*) { return FS_OK; };
    driver.send = [](void*, const fs_wrench*) { return FS_OK; };
    change(driver);
    EXPECT_SENTENCE(status, fs_driver_register(&driver), word);
  };
  refused(FS_ERROR_INVALID, "driver.receive", [](fs_driver& d) { d.receive = nullptr; });
  refused(FS_ERROR_INVALID, "driver.send", [](fs_driver& d) { d.send = nullptr; });
  refused(FS_ERROR_INVALID, "must be null", [](fs_driver& d) { d.read = d.receive; });
  refused(FS_ERROR_INVALID, "must be null", [](fs_driver& d) { d.write = d.send; });
  refused(FS_ERROR_VERSION, "driver.flags is 6", [](fs_driver& d) { d.flags = 6; });
  refused(FS_ERROR_INVALID, "reserved_2", [](fs_driver& d) { d.reserved_2 = 1; });
  refused(FS_ERROR_INVALID, "without receive", [](fs_driver& d) {
    d.read = d.receive;
    d.write = d.send;
    d.receive = nullptr;
    d.send = nullptr;
    d.flags = FS_DRIVER_IN_SERVO;
  });
}
END_TEST

int main() {
  Suite* suite = suite_create("waiting");
  TCase* tests = tcase_create("waiting");
  tcase_set_timeout(tests, 120);
  tcase_add_test(tests, a_state_paces_the_servo);
  tcase_add_test(tests, the_servos_thread_calls_the_driver);
  tcase_add_test(tests, no_pause_makes_a_step);
  tcase_add_test(tests, a_driver_in_the_servo_is_lent_and_given_back);
  tcase_add_test(tests, slow_and_fast_states);
  tcase_add_test(tests, a_force_ends_soon_after_the_last_tick);
  tcase_add_test(tests, what_is_written_without_a_servo_stays);
  tcase_add_test(tests, a_hang_holds_up_nobody);
  tcase_add_test(tests, a_broken_promise_holds_up_no_stop);
  tcase_add_test(tests, a_process_ends_in_spite_of_a_hang);
  tcase_add_test(tests, a_process_ends_in_spite_of_many_hangs);
  tcase_add_test(tests, a_lost_device_comes_back);
  tcase_add_test(tests, what_is_no_state_gives_no_force);
  tcase_add_test(tests, one_fault_is_felt_as_a_ramp);
  tcase_add_test(tests, silence_is_told);
  tcase_add_test(tests, the_reason_is_told);
  tcase_add_test(tests, requests);
  tcase_add_test(tests, tables_are_refused);
  suite_add_tcase(suite, tests);
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed != 0;
}
