// What goes wrong between the driver haply and the Haply Inverse Service: the force ends, its reason is told, and it begins again.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <random>

#include "device/makers/haply_rig.h"
#include "device/makers/troubles.h"

using namespace makers;

// What comes is of no use: the force ends, the reason is told, and it goes on when all is well again.
START_TEST(answers_of_no_use) {
  HaplyRig rig;
  std::string deep = R"({"inverse3":)";
  deep += std::string(30000, '[');
  const struct {
    const char* name;
    std::string answer;
    const char* words;
  } faults[]{{"garbage", "\x01 not JSON", "no JSON object"},
             {"NaN", R"({"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":NaN,"y":0,"z":0}}}]})", "no JSON object"},
             {"infinity", R"({"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":1e999,"y":0,"z":0}}}]})", "no JSON object"},
             {"wrong type", R"({"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":"0","y":0,"z":0}}}]})", "cursor_position"},
             {"missing", R"({"inverse3":[{"device_id":"049D"}]})", "cursor_position"},
             {"far", R"({"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":1.5,"y":0,"z":0}}}]})", "1 m from the origin"},
             {"nested", deep, "64 levels"},
             {"another", R"({"inverse3":[{"device_id":"04BA","state":{"cursor_position":{"x":0,"y":0,"z":0}}}]})", "no longer tells of this"}};
  for (const auto& fault : faults) {
    std::printf("  %s:", fault.name);
    rig.change([&](HaplyService& it) { it.answer = fault.answer; });
    rig.expect_end();
    ck_assert_msg(until([&] { return rig.pushing.event_with(fault.words); }), "%s", fault.name);
    rig.change([](HaplyService& it) { it.answer.clear(); });
    ck_assert_msg(rig.pushes(), "%s", fault.name);
  }
}
END_TEST

// The connection is of no use any more, so the library opens another.
START_TEST(connections_of_no_use) {
  HaplyRig rig;
  std::string huge("\x81\x7f\0\0\0\0\x06\0\0\0", 10);  // a frame of 100 MB
  const struct {
    const char* name;
    std::string bytes;
  } faults[]{{"no frame", "\xff\xff\xff\xff"}, {"half a message", std::string("\x81\x40{\"inv", 7)}, {"100 MB", huge}};
  for (const auto& fault : faults) {
    std::printf("  %s:", fault.name);
    rig.change([&](HaplyService& it) { it.bytes = fault.bytes; });
    rig.expect_end();
    ck_assert_msg(until([&] { return rig.pushing.event_with("Haply Inverse Service"); }), "%s", fault.name);
    rig.change([](HaplyService& it) { it.bytes.clear(); });
    ck_assert_msg(rig.pushes(), "%s", fault.name);
  }
  std::printf("  closed:");
  rig.change([](HaplyService& it) { it.closes = true; });
  rig.expect_end();
  rig.change([](HaplyService& it) { it.closes = false; });
  ck_assert(rig.pushes());
}
END_TEST

START_TEST(it_does_not_answer) {
  HaplyRig rig;
  for (bool HaplyService::*fault : {&HaplyService::is_silent, &HaplyService::is_deaf}) {
    rig.change([&](HaplyService& it) { it.*fault = true; });
    rig.expect_end();
    const double begin = now_s();
    const uint64_t before = stats_of(rig.pushing.scene.get()).ticks;
    std::this_thread::sleep_for(std::chrono::milliseconds(400));
    // receive and send come back within 25 ms together, so the servo has ticked.
    const double cycle = (now_s() - begin) / static_cast<double>(stats_of(rig.pushing.scene.get()).ticks - before);
    std::printf("  a tick each %.1f ms\n", 1e3 * cycle);
    ck_assert_msg(cycle < 0.1, "%g s", cycle);
    ck_assert(until([&] { return rig.pushing.event_with("does not answer"); }));
    rig.change([&](HaplyService& it) { it.*fault = false; });
    ck_assert(rig.pushes());
  }
}
END_TEST

START_TEST(late_answers_do_not_queue) {
  HaplyRig rig;
  rig.change([](HaplyService& it) { it.lag = 0.1; });
  rig.expect_end();
  const uint64_t before = rig.service.with([](HaplyService& it) { return it.messages; });
  std::this_thread::sleep_for(std::chrono::seconds(1));
  rig.change([&](HaplyService& it) {
    ck_assert_uint_ge(it.messages, before + 1);
    ck_assert_msg(it.most_waiting < 250, "%d bytes", it.most_waiting);  // one message, which ends a force
    it.lag = 0;
  });
  ck_assert(rig.pushes());
}
END_TEST

START_TEST(the_service_goes_and_comes_back) {
  HaplyRig rig;
  rig.service.stop();
  rig.expect_end();
  ck_assert(until([&] { return rig.pushing.event_with("it is not connected"); }));
  rig.arm.id = "04BA";  // another device is not the same
  rig.service.start();
  const uint64_t before = rig.service.with([](HaplyService& it) { return it.messages; });
  ck_assert(until([&] { return rig.service.with([](HaplyService& it) { return it.messages; }) >= before + 2; }));
  ck_assert(push_of(rig.arm) == 0);
  rig.change([&](HaplyService&) { rig.arm.id = "049D"; });
  ck_assert(rig.pushes());
}
END_TEST

START_TEST(closing_ends_the_force) {
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  arm.handle.set_watchdog(0);
  {
    const Device device = opened(service);
    const Pushing pushing(device);
    ck_assert(until([&] { return push_of(arm) > 0.5; }));
  }
  ck_assert(push_of(arm) == 0);
}
END_TEST

START_TEST(a_process_that_is_killed) {
  int way[2];
  ck_assert(pipe(way) == 0);
  const pid_t child = fork();
  if (child == 0) {
    unsigned short port = 0;
    if (read(way[0], &port, sizeof port) != sizeof port) _exit(1);
    const Device device = open_device(uri(port).c_str());
    const Pushing pushing(device);
    for (;;) pause();
  }
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  const unsigned short port = service.port();
  ck_assert(write(way[1], &port, sizeof port) == sizeof port);
  ck_assert(until([&] { return push_of(arm) > 0.5; }));
  const double begin = now_s();
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  ck_assert(until([&] { return push_of(arm) == 0; }));
  std::printf("  the force ended after %.0f ms\n", 1e3 * (arm.handle.last_force_time() - begin));
}
END_TEST

START_TEST(random_messages) {
  HaplyRig rig;
  const std::string good = rig.service.with([](HaplyService& it) { return it.state(true); });
  std::mt19937 random(1);
  const auto below = [&](size_t bound) { return std::uniform_int_distribution<size_t>(0, bound - 1)(random); };
  for (int i = 0; i < 300; ++i) {
    std::string text = good;
    for (size_t k = 1 + below(8); k > 0 && !text.empty(); --k) {
      const size_t at = below(text.size());
      if (below(3) == 0) text.erase(at, below(20));
      else if (below(2) == 0) text.insert(at, text.substr(below(text.size()), below(40)));
      else text[at] = "{}[]\":,0e-x"[below(11)];
    }
    rig.change([&](HaplyService& it) { it.answer = text; });
    std::this_thread::sleep_for(std::chrono::milliseconds(3));
  }
  rig.change([](HaplyService& it) { it.answer.clear(); });
  ck_assert(rig.pushes());
}
END_TEST

// A deaf or late service is not among it: it takes the force that was sent last, and then the 0 that follows it.
START_TEST(at_random) {
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  arm.handle.set_watchdog(0);  // on a busy machine it would end a force that the next message brings back
  const auto change = [&](auto change_it) {
    return [&, change_it] { service.with([&](HaplyService& it) { return change_it(it), 0; }); };
  };
  const auto of_arm = [&](auto change_it) {
    return [&, change_it] { service.with([&](HaplyService&) { return change_it(arm), 0; }); };
  };
  const auto says = [&](const std::string& text) { return change([=](HaplyService& it) { it.answer = text; }); };
  const auto answers = says("");
  const auto writes = [&](const std::string& bytes) { return change([=](HaplyService& it) { it.bytes = bytes; }); };
  live_with({{"the service goes", [&] { service.stop(); }, [&] { service.start(); }},
             {"another in its place", of_arm([](HaplyDevice& it) { it.id = "04BA"; }), of_arm([](HaplyDevice& it) { it.id = "049D"; })},
             {"not calibrated", of_arm([](HaplyDevice& it) { it.is_calibrated = false; }), of_arm([](HaplyDevice& it) { it.is_calibrated = true; })},
             {"not ready", of_arm([](HaplyDevice& it) { it.is_ready = false; }), of_arm([](HaplyDevice& it) { it.is_ready = true; })},
             {"without power", of_arm([](HaplyDevice& it) { it.has_power = false; }), of_arm([](HaplyDevice& it) { it.has_power = true; })},
             {"silent", change([](HaplyService& it) { it.is_silent = true; }), change([](HaplyService& it) { it.is_silent = false; })},
             {"no frame", writes("\xff\xff\xff\xff"), writes("")},
             {"half a message", writes(std::string("\x81\x40{\"inv", 7)), writes("")},
             {"garbage", says("\x01 not JSON"), answers},
             {"far away", says(R"({"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":1.5,"y":0,"z":0}}}]})"), answers}},
            uri(service.port()), arm.handle);
}
END_TEST

int main() {
  Suite* suite = suite_create("haply faults");
  add_case(suite, "faults", {answers_of_no_use, connections_of_no_use, it_does_not_answer, late_answers_do_not_queue,
                             the_service_goes_and_comes_back, closing_ends_the_force, a_process_that_is_killed, random_messages,
                             at_random});
  return run_suite(suite);
}
