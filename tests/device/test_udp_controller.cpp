// The rules of the controller, kept to by fidel-controller: a host that does what it should not do.
#include <sys/wait.h>

#include <csignal>
#include <thread>

#include "api/support.h"
#include "device/fidel/controller/controller.h"  // in this process, for a device that a test makes
#include "device/udp/controller_process.h"
#include "device/udp/raw_host.h"
#include "device/waiting_device.h"

using namespace scenes;
using namespace fs::udp;

static constexpr char held[] = "sim:?encoder=ideal&hand_mass=1&hand_damping=100&hand_stiffness=10000";  // a hand that hardly moves

static Command force(double x) {
  Command out;
  out.force.force.x = x;
  return out;
}
static bool is_bye(RawHost& host, Reason reason) {
  Bye bye;
  return host.heard(Type::bye) && decode(host.datagram.bytes, host.datagram.size, bye) && bye.reason == reason;
}

START_TEST(a_force_comes_and_goes) {
  ControllerProcess controller(held);
  RawHost host(controller.port(), 77);
  host.hello();
  ck_assert(host.heard(Type::welcome));
  Welcome welcome;
  ck_assert(decode(host.datagram.bytes, host.datagram.size, welcome));
  ck_assert_uint_eq(welcome.hello, 1);
  ck_assert_double_eq(static_cast<double>(welcome.rate), 500);
  ck_assert_str_eq(welcome.name, "FIDEL (simulated)");
  ck_assert(host.commands(force(5), [](const State& s) { return s.applied.force.x > 4.999; }));
  ck_assert_uint_eq(host.state.flags, FS_STATE_READY);
  // The controller tells which command came last, and not after it was sent.
  ck_assert(host.state.command > 0 && host.state.came <= host.state.command && host.state.command_time <= host.state.sent);
  // Goodbye: 0 before the answer comes. A second goodbye is answered, too.
  for (int i = 0; i < 2; ++i) {
    host.say(Type::bye, Bye{Reason::ends});
    ck_assert(is_bye(host, Reason::unknown_session));
  }
  // Nobody comes back by a HELLO that was late; another session does.
  host.hello();
  ck_assert(!host.heard(Type::welcome, 200));
  RawHost next(controller.port(), 78);
  next.hello();
  ck_assert(next.heard(Type::welcome) && next.heard(Type::state));
  ck_assert_double_eq(next.state.applied.force.x, 0);
}
END_TEST

START_TEST(a_model_is_rendered_held_and_limited) {
  ControllerProcess controller(held);
  RawHost host(controller.port(), 79);
  host.hello(1000);
  Command model;
  model.is_model = true;
  model.hold = 1;  // counts as 0.05
  model.pose.position.x = -0.02;
  model.dfdx = {-100, 0, 0, 0, -100, 0, 0, 0, -100};
  // At the origin -100 (0 + 0.02) = -2 N.
  ck_assert(host.commands(model, [](const State& s) { return std::fabs(s.applied.force.x + 2) < 0.05; }));
  // Silence: held for 50 ms, gone after 100 ms, though the model says 1 s.
  bool was_held = false, is_gone = false;
  while (!is_gone && host.heard(Type::state)) {
    const double silence = 1e-9 * static_cast<double>(host.state.time - host.state.command_time);
    if (silence < 0.045) was_held |= host.state.applied.force.x < -1.8;
    is_gone = host.state.applied.force.x == 0;
    if (is_gone) ck_assert_double_gt(silence, 0.09);
    ck_assert_double_lt(silence, 0.2);
  }
  ck_assert(was_held && is_gone);
  // A shorter hold counts.
  model.hold = 0.01f;
  ck_assert(host.commands(model, [](const State& s) { return s.applied.force.x < -1.5; }));
  for (is_gone = false; !is_gone && host.heard(Type::state);) is_gone = host.state.applied.force.x == 0;
  ck_assert(is_gone);
  ck_assert_double_lt(1e-9 * static_cast<double>(host.state.time - host.state.command_time), 0.09);
  // 25 N at most, in the same direction.
  model.hold = 0.05f;
  model.force.force = {300, 400, 0};
  ck_assert(host.commands(model, [](const State& s) { return s.applied.force.y > 19.99; }));
  EXPECT_NEAR(host.state.applied.force.x, 15, 0.2);
}
END_TEST

START_TEST(late_and_stale_commands_are_not_used) {
  ControllerProcess controller(held);
  RawHost host(controller.port(), 80);
  host.hello();
  ck_assert(host.commands(force(5), [](const State& s) { return s.applied.force.x > 4.999; }));
  const uint32_t came = host.state.came, newest = host.state.command;
  // A jump of numbers, then older ones of another force.
  for (int i = 0; i < 20; ++i) {
    host.say(Type::command, force(5), newest + 100);
    host.say(Type::command, force(-20), newest + 50);
    ck_assert(host.heard(Type::state));
    ck_assert_double_gt(host.state.applied.force.x, 0);
  }
  ck_assert(host.heard(Type::state));
  ck_assert_uint_ge(host.state.came, came + 2);  // each once
  ck_assert_uint_le(host.state.came, came + 4);  // with those that were under way
  // Answers to a state of 0.3 s ago, and to one that is still to come.
  const uint32_t old = host.header.number;
  uint32_t number = newest + 1000;
  const double begin = 1e-9 * static_cast<double>(host.state.time);
  while (1e-9 * static_cast<double>(host.state.time) < begin + 0.3) {
    host.say(Type::command, force(5), ++number);
    ck_assert(host.heard(Type::state));
  }
  for (int i = 0; i < 200; ++i) {
    Command stale = force(-20);
    stale.state = i % 2 ? old : host.header.number + 1000;
    host.say(Type::command, stale, ++number);
    ck_assert(host.heard(Type::state));
    ck_assert_double_ge(host.state.applied.force.x, 0);
  }
  ck_assert_double_eq(host.state.applied.force.x, 0);  // nothing that could be used has come
}
END_TEST

START_TEST(who_is_silent_makes_room) {
  ControllerProcess controller(held);
  RawHost first(controller.port(), 81), second(controller.port(), 82);
  first.hello();
  ck_assert(first.heard(Type::welcome));
  second.hello();
  ck_assert(second.heard(Type::busy));
  ck_assert(is_bye(first, Reason::silent));
  second.hello();
  ck_assert(second.heard(Type::welcome));
  // The first one's commands are answered, so that it need not wait for silence: somebody else is there, then nobody.
  first.say(Type::command, force(5));
  ck_assert(first.heard(Type::busy));
  second.say(Type::bye, Bye{Reason::ends});
  ck_assert(is_bye(second, Reason::unknown_session));
  first.say(Type::command, force(5));
  ck_assert(is_bye(first, Reason::unknown_session));
}
END_TEST

// Only a goodbye with reason 0 is answered, or two ends could answer each other for ever.
START_TEST(only_one_goodbye_is_answered) {
  ControllerProcess controller(held);
  RawHost host(controller.port(), 85), next(controller.port(), 86);
  host.hello();
  ck_assert(host.commands(force(5), [](const State& s) { return s.applied.force.x > 4.9; }));
  host.say(Type::bye, Bye{Reason::unknown_session});
  ck_assert(!host.heard(Type::bye, 200));
  ck_assert(std::strstr(controller.said().c_str(), "it has said goodbye"));
  host.say(Type::bye, Bye{Reason::silent});  // of the session that ended last
  ck_assert(!host.heard(Type::bye, 200));
  host.say(Type::bye, Bye{Reason::ends});
  ck_assert(is_bye(host, Reason::unknown_session));
  next.hello();  // the controller is free
  ck_assert(next.heard(Type::welcome) && next.heard(Type::state));
  ck_assert_double_eq(next.state.applied.force.x, 0);
}
END_TEST

static Request request(const char* text) {
  Request out;
  std::snprintf(out.text, sizeof out.text, "%s", text);
  return out;
}

// Each request is done once: what is said again gets the same answer, what was said before the newest gets none.
START_TEST(late_requests_are_not_done_again) {
  ControllerProcess controller(held);
  RawHost host(controller.port(), 87);
  host.hello();
  ck_assert(host.heard(Type::welcome));
  const auto is_answered = [&](uint32_t number) {
    Answer answer;
    host.say(Type::request, request("status"), number);
    return host.heard(Type::answer, 200) && decode(host.datagram.bytes, host.datagram.size, answer) && answer.request == number;
  };
  for (const uint32_t first : {1u, 0xfffffffeu}) {  // the numbers go round
    if (first != 1) {
      for (const uint32_t step : {0x70000000u, 0xe0000000u}) ck_assert(is_answered(step));
    }
    ck_assert(is_answered(first));
    ck_assert(is_answered(first + 3));
    ck_assert_uint_eq(host.header.number, first == 1 ? 2 : 6);  // how many answers there are, each counted once
    ck_assert(is_answered(first + 3));
    ck_assert_uint_eq(host.header.number, first == 1 ? 2 : 6);
    ck_assert(!is_answered(first));
    ck_assert(!is_answered(first + 1));
  }
}
END_TEST

// A controller in this process, before a device of which a request takes as long as the test wants.
struct SlowDevice {
  WaitingDevice slow{"slow"};
  Device device = slow.open();
  Socket socket = Socket::listening({"127.0.0.1", 0});
  uint16_t port = ntohs(reinterpret_cast<const sockaddr_in&>(socket.own().address).sin_port);
  std::atomic<bool> ends{false};
  Controller controller{device.get(), socket, [](const std::string&) {}};
  std::thread loop{[this] { controller.run([this] { return ends.load(); }); }};
  ~SlowDevice() {
    slow.let_go();
    ends = true;
    loop.join();
  }
};

START_TEST(a_request_to_the_device_does_not_hold_the_loop) {
  SlowDevice behind;
  RawHost host(behind.port, 88);
  host.hello(1000);
  ck_assert(host.commands(force(3), [](const State& s) { return s.applied.force.x > 2.999; }));
  Answer answer;
  const auto is_answered = [&](uint32_t number, int32_t status) {
    if (!host.heard(Type::answer) || !decode(host.datagram.bytes, host.datagram.size, answer)) return false;
    return answer.request == number && answer.status == status;
  };
  behind.slow.hang(WaitingDevice::in_control);
  host.say(Type::request, request("echo"), 1);
  ck_assert(is_answered(1, still_being_done));
  host.say(Type::request, request("echo"), 1);
  ck_assert(is_answered(1, still_being_done));
  // For 0.3 s the force is rendered, and the states come.
  const uint64_t begin = host.state.time;
  int states = 0;
  ck_assert(host.commands(force(3), [&](const State& s) {
    states += s.applied.force.x > 2.9;
    return s.time > begin + 300'000'000;
  }));
  std::printf("  %d states with the force in the 0.3 s of a request\n", states);
  ck_assert_int_gt(states, 100);
  // The answer comes by itself, and when it is asked for again.
  behind.slow.let_go();
  ck_assert(is_answered(1, FS_OK));
  ck_assert_str_eq(answer.text, "1");
  host.say(Type::request, request("echo"), 1);
  ck_assert(is_answered(1, FS_OK));
  // One at a time; what the controller itself answers is no such request.
  behind.slow.hang(WaitingDevice::in_control);
  host.say(Type::request, request("echo"), 2);
  ck_assert(is_answered(2, still_being_done));
  host.say(Type::request, request("dance"), 3);
  ck_assert(is_answered(3, FS_ERROR_STATE));
  ck_assert_str_eq(answer.text, "busy: the device behind the controller is still doing 'echo'");
  host.say(Type::request, request("status"), 4);
  ck_assert(is_answered(4, FS_OK));
  behind.slow.let_go();
  ck_assert(!host.heard(Type::answer, 200));  // nobody waits for the second one any more
  host.say(Type::request, request("dance"), 5);
  ck_assert(is_answered(5, still_being_done) && is_answered(5, FS_ERROR_UNSUPPORTED));
  ck_assert_str_eq(answer.text, "the requests are: echo; the requests are: link, status, and those of the device behind it");
}
END_TEST

// Also when that takes longer than the 2 s for which a host waits for a controller that is silent.
START_TEST(a_host_waits_for_the_device) {
  SlowDevice behind;
  const Device device = open_device(("fidel:udp:127.0.0.1:" + std::to_string(behind.port)).c_str());
  behind.slow.hang(WaitingDevice::in_control);
  std::thread opener([&] {
    behind.slow.await_hanging();
    std::this_thread::sleep_for(std::chrono::milliseconds(2500));
    behind.slow.let_go();
  });
  fs_answer answer{};
  EXPECT(FS_OK, fs_device_control(device.get(), "echo", &answer));
  ck_assert_str_eq(answer.text, "1");
  opener.join();
}
END_TEST

START_TEST(another_version_is_told) {
  ControllerProcess controller(held);
  RawHost host(controller.port(), 83);
  Datagram hello = encode({Type::hello, host.session, 1}, Hello{});
  hello.bytes[4] = 2;
  const uint32_t sum = checksum(hello.bytes, hello.size - 4);
  for (size_t i = 0; i < 4; ++i) hello.bytes[hello.size - 4 + i] = static_cast<uint8_t>(sum >> (8 * i));
  host.say(hello);
  ck_assert(is_bye(host, Reason::version));
  // Strangers get 50 answers a second at most, and 20 at once.
  const auto begin = std::chrono::steady_clock::now();
  int answers = 0;
  for (int i = 0; i < 200; ++i) host.say(hello);
  while (host.heard(Type::bye, 100)) ++answers;
  const double time = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::printf("  %d answers to 200 datagrams of a stranger, in %.2f s\n", answers, time);
  ck_assert(answers > 0 && answers < 25 + 50 * time);
}
END_TEST

START_TEST(it_ends_with_force_0) {
  ControllerProcess controller(held);
  RawHost host(controller.port(), 84);
  host.hello();
  ck_assert(host.commands(force(5), [](const State& s) { return s.applied.force.x > 4.9; }));
  controller.signal(SIGINT);
  ck_assert(is_bye(host, Reason::controller_ends));
  const int status = controller.end(0);
  ck_assert(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  ck_assert(std::strstr(controller.said().c_str(), "ended, with force 0"));
}
END_TEST

int main() {
  Suite* suite = suite_create("udp_controller");
  for (const TTest* test : {a_force_comes_and_goes, a_model_is_rendered_held_and_limited,
                            late_and_stale_commands_are_not_used, who_is_silent_makes_room, only_one_goodbye_is_answered,
                            late_requests_are_not_done_again, a_request_to_the_device_does_not_hold_the_loop,
                            a_host_waits_for_the_device, another_version_is_told,
                            it_ends_with_force_0}) {
    add_case(suite, test->name, {test});  // CK_RUN_CASE selects one
  }
  return run_suite(suite);
}
