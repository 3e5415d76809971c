// fidel:udp through the public functions: what the hand of the simulated device behind fidel-controller feels, over a link that
// delays, loses, repeats, reorders and damages what it carries.
#include <arpa/inet.h>
#include <dlfcn.h>
#include <netdb.h>
#include <sys/socket.h>
#include <sys/wait.h>

#include <csignal>
#include <fstream>
#include <map>

#include "device/table.h"
#include "device/udp/raw_host.h"
#include "device/udp/rig.h"
#include "scenes/folder.h"

using namespace scenes;
using fs::udp::Command;
using fs::udp::Datagram;
using fs::udp::Header;
using fs::udp::State;
using fs::udp::Type;

// The names of a test, which have these addresses in this order, before the system's own names.
static std::map<std::string, std::vector<const char*>> names;
extern "C" int getaddrinfo(const char* name, const char* service, const addrinfo* hints, addrinfo** out) {
  static const auto systems = reinterpret_cast<decltype(&getaddrinfo)>(dlsym(RTLD_NEXT, "getaddrinfo"));
  const auto known = name ? names.find(name) : names.end();
  if (known == names.end()) return systems(name, service, hints, out);
  for (const char* address : known->second) {
    if (const int error = systems(address, service, hints, out)) return error;
    out = &(*out)->ai_next;
  }
  return 0;
}

static void forces_are_felt(const char* options, bool is_model) {
  UdpRig rig;
  rig.start(options);
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(rig.device.get(), &info));
  ck_assert_str_eq(info.name, "FIDEL (simulated)");
  ck_assert_str_eq(info.serial, "sim-0");
  EXPECT_NEAR(info.force_max, 25, 1e-6);
  EXPECT_NEAR(info.controller_rate, is_model ? 1000 : 0, 1e-6);
  rig.set_push();
  ck_assert(rig.await_push());
  // A spring of 200 N/m pulls back to the origin, against the push and with the hand.
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 20);
  OK(fs_object_set(rig.scene.get(), &spring));
  const double there = UdpRig::push / (135 + 200);
  ck_assert(until([&] { return std::fabs(rig.hand().pose.position.x - there) < 0.2 * there; }));
  ck_assert(std::strstr(rig.controller.said().c_str(), "connected: "));
  rig.servo.reset();
  rig.device.reset();
  ck_assert(until([&] { return std::strstr(rig.controller.said().c_str(), "it has said goodbye"); }));
}
START_TEST(models_are_felt) { forces_are_felt("", true); }
END_TEST
START_TEST(plain_forces_are_felt) { forces_are_felt("?render=force&hz=500", false); }
END_TEST

START_TEST(silence_ends_the_force_and_it_comes_back_through_ready) {
  UdpRig rig;
  rig.start();
  rig.set_push();
  ck_assert(rig.await_push());
  rig.relay.cut();
  ck_assert(until([&] { return rig.is_lost(); }));
  ck_assert_double_eq(rig.sent(), 0);
  ck_assert(until([&] { return std::strstr(rig.controller.said().c_str(), "silent for 0.5 s"); }));
  rig.forget_states();
  fs_event event{};
  while (fs_scene_next_event(rig.scene.get(), 0, &event) == FS_OK && event.kind != FS_EVENT_NONE) {
  }
  rig.relay.set({});
  bool was_ready = false;
  ck_assert(until([&] {
    EXPECT(FS_OK, fs_scene_next_event(rig.scene.get(), 0, &event));
    return was_ready |= event.kind == FS_EVENT_DEVICE && event.status == FS_OK;
  }));
  ck_assert(rig.await_push());
  // Ramped: the force grew from 0 over half a second.
  const std::vector<State> states = rig.states();
  double largest_step = 0;
  for (size_t i = 1; i < states.size(); ++i) {
    if (states[i].time - states[i - 1].time < 5'000'000) {
      largest_step = std::fmax(largest_step, std::fabs(states[i].applied.force.x - states[i - 1].applied.force.x));
    }
  }
  std::printf("  the largest step of the force as it comes back: %.3f N\n", largest_step);
  ck_assert_double_lt(largest_step, 2);
}
END_TEST

// As the controller sees it, on its own clock: no command comes any more.
START_TEST(the_controller_holds_and_fades) {
  UdpRig rig;
  rig.start("?render=force");
  rig.set_push();
  ck_assert(until([&] { return rig.sent() > 0.99 * UdpRig::push; }));
  ck_assert(rig.await_push());
  rig.forget_states();
  rig.relay.set({}, {.loss = 1});
  ck_assert(until([&] {
    const auto states = rig.states();
    return !states.empty() && states.back().time > states.back().command_time + 200'000'000;
  }));
  int held = 0, fading = 0, gone = 0;
  for (const State& state : rig.states()) {
    const double silence = 1e-9 * static_cast<double>(state.time - state.command_time);
    const double force = state.applied.force.x;
    if (silence < 0.04) {
      ck_assert_double_gt(force, 0.9 * UdpRig::push);
      ++held;
    } else if (silence > 0.06 && silence < 0.09) {
      fading += force > 0 && force < 0.95 * UdpRig::push;
    } else if (silence > 0.12) {
      ck_assert_msg(force == 0 || silence < 0.2, "%g N after %g s of silence", force, silence);
      gone += force == 0;
    }
  }
  std::printf("  states while the force was held, faded, and was gone: %d, %d, %d\n", held, fading, gone);
  ck_assert(held > 0 && gone > 0);
}
END_TEST

START_TEST(a_bad_link_is_no_end) {
  UdpRig rig("sim:?encoder=ideal", 7);
  rig.relay.set({.delay = 2e-3, .jitter = 1e-3, .loss = 0.2, .again = 0.2, .reorder = 0.1});
  rig.start();
  rig.set_push();
  ck_assert(rig.await_push());
  ck_assert(until([&] { return rig.stats().link_loss > 0.1; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  const fs_servo_stats stats = rig.stats();
  std::printf("  of 20 %% lost, 20 %% repeated, 10 %% late: loss %.3f, %.0f states/s, delay p50 %.2f ms, p99 %.2f ms\n", stats.link_loss,
              stats.link_rate, 1e3 * stats.link_delay_p50, 1e3 * stats.link_delay_p99);
  ck_assert(stats.link_loss > 0.1 && stats.link_loss < 0.4);
  ck_assert_double_lt(stats.link_rate, 1.1 * 500);  // none is counted twice
  ck_assert(rig.await_push());
}
END_TEST

// Damaged and hostile datagrams are ignored and counted at both ends.
START_TEST(garbage_is_ignored) {
  UdpRig rig("sim:?encoder=ideal", 3);
  rig.start();
  rig.set_push();
  ck_assert(rig.await_push());
  rig.relay.set({.damage = 0.2});
  rig.relay.flood(20000);
  std::this_thread::sleep_for(std::chrono::milliseconds(1000));
  rig.relay.flood(0);
  ck_assert(rig.await_push());
  rig.relay.set({});
  ck_assert(until([&] {
    const std::string text = rig.ask("link");
    return number_behind(text, "ignored by the host: ") > 100 && number_behind(text, "by the controller: ") > 100;
  }));
  std::printf("  %s\n", rig.ask("link").c_str());
  ck_assert(rig.await_push());
}
END_TEST

// The controller's clock jumps by an hour, forth and back; the time of a state on the host's clock stays right.
START_TEST(a_clock_jumps) {
  std::atomic<int64_t> jump{0};  // ns
  UdpRig rig;
  rig.relay.on_way_to_host([&](Bytes& bytes) {
    Header header{};
    State state;
    if (!is_state(bytes, header, state)) return;
    const auto shift = static_cast<uint64_t>(jump.load());
    state.time += shift;
    state.sent += shift;
    if (state.command_time) state.command_time += shift;
    const Datagram changed = encode(header, state);
    bytes.assign(changed.bytes, changed.bytes + changed.size);
  });
  rig.start();
  rig.set_push();
  ck_assert(rig.await_push());
  const int64_t hour = 3'600'000'000'000;
  int jumps = 0;
  for (const int64_t next : {hour, int64_t{0}, -hour, int64_t{0}}) {
    jump = next;
    ++jumps;
    ck_assert(until([&] { return number_behind(rig.ask("link"), "jumps of a clock: ") >= jumps; }));
    ck_assert(until([&] {
      const double age = std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count() - rig.hand().time;
      return age > -1e-3 && age < 0.1 && rig.sent() > 0.9 * UdpRig::push;
    }));
    ck_assert(rig.await_push());
  }
}
END_TEST

// Each second state tells a pose of seven hours ago: it is ignored, and the others are felt without a fault.
START_TEST(a_time_that_cannot_be) {
  std::atomic<bool> is_wrong{false};
  UdpRig rig;
  rig.relay.on_way_to_host([&](Bytes& bytes) {
    Header header{};
    State state;
    if (!is_state(bytes, header, state) || !is_wrong || header.number % 2) return;
    state.time -= uint64_t{7 * 3600} * 1'000'000'000;
    const Datagram changed = encode(header, state);
    bytes.assign(changed.bytes, changed.bytes + changed.size);
  });
  rig.start();
  rig.set_push();
  ck_assert(rig.await_push());
  is_wrong = true;
  ck_assert(until([&] { return number_behind(rig.ask("link"), "ignored by the host: ") > 200; }));
  ck_assert(until([&] { return rig.stats().faults == 0; }));  // a busy machine may have caused one for a moment
  ck_assert(rig.await_push());
}
END_TEST

START_TEST(a_second_sender_is_refused) {
  std::atomic<uint64_t> session{0};
  UdpRig rig;
  rig.start();
  rig.set_push();
  ck_assert(rig.await_push());
  fs_device* raw = nullptr;
  EXPECT_SENTENCE(FS_ERROR_DENIED, fs_device_open(rig.controller.uri().c_str(), &raw), "in use by");
  // One that does not ask, with a number of its own, and one that has found out the number.
  const int other = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  to.sin_port = htons(rig.controller.port());
  ck_assert_int_eq(connect(other, reinterpret_cast<sockaddr*>(&to), sizeof to), 0);
  rig.relay.on_way_to_host([&](Bytes& bytes) {
    Header header{};
    if (open(bytes.data(), bytes.size(), header) == fs::udp::Opened::good) session = header.session;
  });
  ck_assert(until([&] { return session != 0; }));
  const double before = number_behind(rig.ask("link"), "by the controller: ");
  Command command;
  command.force.force = {-20, 0, 0};
  for (uint32_t i = 1; i <= 200; ++i) {
    for (const uint64_t number : {uint64_t{4711}, session.load()}) {
      const Datagram datagram = encode({Type::command, number, 1'000'000 + i}, command);
      ck_assert_int_gt(send(other, datagram.bytes, datagram.size, 0), 0);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ck_assert(until([&] { return number_behind(rig.ask("link"), "by the controller: ") >= before + 300; }));
  Datagram heard;
  const ssize_t size = recv(other, heard.bytes, sizeof heard.bytes, 0);
  Header header{};
  ck_assert(size > 0 && open(heard.bytes, static_cast<size_t>(size), header) == fs::udp::Opened::good && header.type == Type::busy);
  close(other);
  ck_assert(rig.feels_push());
  ck_assert_uint_eq(rig.stats().device_errors, 0);
  ck_assert(std::strstr(rig.controller.said().c_str(), "refused: 127.0.0.1:"));
}
END_TEST

// Another host was killed a moment ago: its controller is soon free.
START_TEST(a_killed_host_makes_room) {
  ControllerProcess controller;
  RawHost killed(controller.port(), 91);
  killed.hello();
  ck_assert(killed.heard(Type::welcome));
  fs_device* raw = nullptr;
  fs_status status;
  Patience patience;
  int tries = 0;
  do status = fs_device_open(controller.uri().c_str(), &raw), ++tries;
  while (status == FS_ERROR_DENIED && patience.lasts());
  ck_assert_int_eq(status, FS_OK);
  ck_assert_int_le(tries, 2);  // not as often as it can ask
  fs_device_close(raw);
  // By a name, too, of which another address may come first.
  const std::string name = "fidel:udp:localhost:" + std::to_string(controller.port());
  EXPECT(FS_OK, fs_device_open(name.c_str(), &raw));
  fs_device_close(raw);
}
END_TEST

// The controller is killed and started again: another session, through READY, by itself.
START_TEST(a_controller_is_killed_and_started_again) {
  auto first = std::make_unique<ControllerProcess>();
  const uint16_t port = first->port();
  const Scene scene = make_scene();
  const Device device = open_device(first->uri().c_str());
  const Servo servo = start_servo(scene.get(), device.get(), fs_servo_options_init());
  fs_object o = fs_object_init("push", FS_PRIMITIVE_POINT);
  o.pose.position.x = 10;
  o.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 5, 0, 5);
  OK(fs_object_set(scene.get(), &o));
  const auto is_pushed = [&] {
    fs_state state{};
    fs_wrench sent{};
    EXPECT(FS_OK, fs_scene_get_hand(scene.get(), &state, nullptr, &sent));
    return state.pose.position.x > 0.03 && sent.force.x > 4;
  };
  const auto is_still = [&] {
    fs_wrench sent{};
    EXPECT(FS_OK, fs_scene_get_hand(scene.get(), nullptr, nullptr, &sent));
    return sent.force.x == 0;
  };
  ck_assert(until(is_pushed));
  first->end(SIGKILL);
  ck_assert(until(is_still));
  first.reset();
  ControllerProcess second("sim:?encoder=ideal", port);
  ck_assert(until(is_pushed));
  ck_assert(std::strstr(second.said().c_str(), "connected: "));
  // Ended as it should be, it says so, and the host need not wait for silence.
  const int status = second.end(SIGTERM);
  ck_assert(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  ck_assert(std::strstr(second.said().c_str(), "ended, with force 0"));
  ck_assert(until(is_still));
}
END_TEST

START_TEST(the_delay_is_measured) {
  for (const char* options : {"", "?render=force"}) {
    UdpRig rig;
    rig.start(options);
    ck_assert(until([&] { return rig.stats().link_delay_p50 > 0; }));
    const fs_servo_stats near = rig.stats();
    const double way = 0.01;
    rig.relay.set({.delay = way});
    ck_assert(until([&] { return rig.stats().link_delay_p50 > 2 * way; }));
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    const fs_servo_stats far = rig.stats();
    std::printf("  '%s': delay %.2f ms and %.0f N/m; with 10 ms each way %.2f ms (p99 %.2f) and %.0f N/m; %.0f states/s\n", options,
                1e3 * near.link_delay_p50, near.max_stiffness, 1e3 * far.link_delay_p50, 1e3 * far.link_delay_p99, far.max_stiffness,
                far.link_rate);
    ck_assert(far.link_delay_p50 > 2 * way && far.link_delay_p50 < 2 * way + 0.03);
    ck_assert_double_lt(far.max_stiffness, near.max_stiffness);
    ck_assert_double_ge(far.delay, 0.9 * far.link_delay_p50);
  }
}
END_TEST

START_TEST(rows_of_the_table) {
  const ControllerProcess controller;
  expect_in_table(open_device(controller.uri().c_str()).get(), "`fidel:udp:`");
  expect_in_table(open_device("sim:").get(), "`sim:`");
}
END_TEST

START_TEST(requests_are_answered) {
  UdpRig rig;
  rig.start();
  ck_assert(std::strstr(rig.ask("status").c_str(), "FIDEL (simulated), serial 'sim-0'"));
  ck_assert(std::strstr(rig.ask("link").c_str(), "round trip "));
  fs_answer answer{};
  EXPECT_SENTENCE(FS_ERROR_UNSUPPORTED, fs_device_control(rig.device.get(), "dance", &answer),
                  "a device of 'sim' has no requests; the requests are: link, status, and those of the device behind it");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_control(rig.device.get(), std::string(300, 'x').c_str(), &answer), "must be at most 255");
  rig.relay.set({.loss = 0.3, .again = 0.3});
  for (int i = 0; i < 10; ++i) ck_assert(std::strstr(rig.ask("status").c_str(), "serial 'sim-0'"));
}
END_TEST

// Of several addresses of a name the controller may listen at any, whatever is wrong with the others.
START_TEST(each_address_of_a_name_is_tried) {
  ControllerProcess controller;
  const int silent = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = inet_addr("127.0.0.2");
  at.sin_port = htons(controller.port());
  ck_assert_int_eq(bind(silent, reinterpret_cast<sockaddr*>(&at), sizeof at), 0);
  const char *const nobody = "127.0.0.3", *const silence = "127.0.0.2", *const here = "127.0.0.1";
  const char* const unreachable = "255.255.255.255";  // a socket may not send to all
  names = {{"found.test", {unreachable, silence, nobody, here}},
           {"nobody.test", {silence, nobody, unreachable}},
           {"silent.test", {unreachable, silence}},
           {"unreachable.test", {unreachable}}};
  const auto opens = [&](const char* name) {
    fs_device* raw = nullptr;
    const fs_status status = fs_device_open(("fidel:udp:" + (name + (":" + std::to_string(controller.port())))).c_str(), &raw);
    fs_device_close(raw);
    return status;
  };
  EXPECT(FS_OK, opens("found.test"));
  // Otherwise what comes nearest to a controller is told.
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, opens("nobody.test"), "nobody listens at nobody.test");
  EXPECT_SENTENCE(FS_ERROR_TIMEOUT, opens("silent.test"), "no controller answers at silent.test");
  EXPECT_SENTENCE(FS_ERROR_IO, opens("unreachable.test"), "cannot send to unreachable.test");
  // A controller that is in use is the one that was meant.
  names["used.test"] = {here, silence};
  const Device first = open_device(controller.uri().c_str());
  EXPECT_SENTENCE(FS_ERROR_DENIED, opens("used.test"), "in use by");
  names.clear();
  close(silent);
}
END_TEST

START_TEST(addresses_are_refused) {
  const std::pair<const char*, const char*> wrong[]{{"fidel:udp", "HOST:PORT"},
                                                    {"fidel:udp:", "HOST:PORT"},
                                                    {"fidel:udp:127.0.0.1:0", "within 1..65535"},
                                                    {"fidel:udp:127.0.0.1:70000", "within 1..65535"},
                                                    {"fidel:udp:127.0.0.1:5x", "HOST:PORT"},
                                                    {"fidel:udp:[::1", "HOST:PORT"},
                                                    {"fidel:udp:127.0.0.1:5?hz=20", "100..1000"},
                                                    {"fidel:udp:127.0.0.1:5?render=both", "model, force"},
                                                    {"fidel:udp:127.0.0.1:5?colour=red", "render, hz"}};
  fs_device* raw = nullptr;
  for (const auto& [uri, word] : wrong) EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open(uri, &raw), word);
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("fidel:udp:127.0.0.1:1", &raw), "nobody listens");
  ControllerProcess controller;
  Relay relay(controller.port());
  relay.cut();
  const fs_status status = fs_device_open(relay.uri().c_str(), &raw);
  ck_assert_msg(status == FS_ERROR_TIMEOUT && std::strstr(fs_last_error(), "no controller answers"), "%s", fs_last_error());
}
END_TEST

// m, from end to end, in 1.5 s: the nominal hand has touched a wall of 1 kN/m, 10 ms away, and leans on it, with the protections off.
static double swing(const char* options) {
  const Folder folder;
  std::ofstream(folder / "touch") << "0 0 0 0.05\n2 0 0 0.05\n2.5 0 0 -0.01\n";  // s, m
  UdpRig rig("sim:?path=" + (folder / "touch"));
  rig.relay.set({.delay = 0.01});
  fs_servo_options servo = fs_servo_options_init();
  servo.max_stiffness = servo.damping = servo.slew_limit = servo.speed_limit = -1;
  rig.start(options, servo);
  fs_object wall = fs_object_init("wall", FS_PRIMITIVE_PLANE);
  wall.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 1000, 0, 20);
  OK(fs_object_set(rig.scene.get(), &wall));
  std::this_thread::sleep_for(std::chrono::seconds(4));
  rig.forget_states();
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  double low = 1, high = -1;
  for (const State& state : rig.states()) {
    low = std::fmin(low, state.pose.position.z);
    high = std::fmax(high, state.pose.position.z);
  }
  return high - low;
}

START_TEST(models_stand_where_forces_swing) {
  bool is_seen = false;
  for (int i = 0; i < 3 && !is_seen; ++i) {  // a machine that stalls shakes models too
    const double force = swing("?render=force"), model = swing("");
    std::printf("  a wall of 1 kN/m at 10 ms each way: forces swing by %.2f mm, models by %.3f mm\n", 1e3 * force, 1e3 * model);
    std::fflush(stdout);
    is_seen = force > 5e-3 && model < force / 5;
  }
  ck_assert(is_seen);
}
END_TEST

int main() {
  Suite* suite = suite_create("udp");
  for (const TTest* test : {models_are_felt, plain_forces_are_felt, silence_ends_the_force_and_it_comes_back_through_ready,
                            the_controller_holds_and_fades, a_bad_link_is_no_end, garbage_is_ignored, a_clock_jumps, a_time_that_cannot_be,
                            a_second_sender_is_refused, a_killed_host_makes_room, a_controller_is_killed_and_started_again, the_delay_is_measured,
                            rows_of_the_table, requests_are_answered, each_address_of_a_name_is_tried, addresses_are_refused,
                            models_stand_where_forces_swing}) {
    add_case(suite, test->name, {test});  // CK_RUN_CASE selects one
  }
  return run_suite(suite);
}
