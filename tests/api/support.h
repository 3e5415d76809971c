// What all tests of the C contract share. Read tests/scenes first.
#pragma once

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>

#include <forceserver/forceserver.h>

#include "scenes/fake_device.h"
#include "scenes/scenes.h"

#include <check.h>
#undef fail  // an old macro of Check's; std::ios has a function of that name

namespace scenes {

inline constexpr double long_enough = 30;  // s, for whatever must come, on a machine that is busy with other things too

// Waits a little each time that it is asked; lasts until it has been asked for so long.
class Patience {
 public:
  bool lasts() {
    const auto now = std::chrono::steady_clock::now();
    if (asked_++ == 0) start_ = now;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return now - start_ < std::chrono::duration<double>(long_enough);
  }

 private:
  int asked_ = 0;
  std::chrono::steady_clock::time_point start_;
};

// A call that needs an answer waits 1 s for it, which may be too short where the machine is busy with other things: then it is
// made again.
template <class Call>
fs_status patiently(Call&& call) {
  Patience patience;
  fs_status status;
  do status = call();
  while (status == FS_ERROR_TIMEOUT && patience.lasts());
  return status;
}
#define PATIENTLY(call) scenes::patiently([&] { return call; })

}  // namespace scenes

// The call, made patiently, gives this status, or the test fails with both and the library's sentence.
#define EXPECT(status, call)                                                                                        \
  do {                                                                                                              \
    fs_status got_;                                                                                                 \
    scenes::Patience patience_;                                                                                     \
    do got_ = (call);                                                                                               \
    while (got_ == FS_ERROR_TIMEOUT && (status) != FS_ERROR_TIMEOUT && patience_.lasts());                          \
    ck_assert_msg(got_ == (status), "%s gives %s (\"%s\"), not %s", #call, fs_status_name(got_), fs_last_error(),   \
                  fs_status_name(status));                                                                          \
  } while (0)
#define OK(call) EXPECT(FS_OK, call)

// The same, and the error sentence must have this part.
#define EXPECT_SENTENCE(status, call, word)                                                                         \
  do {                                                                                                              \
    EXPECT(status, call);                                                                                           \
    ck_assert_msg(std::strstr(fs_last_error(), word), "\"%s\" does not name \"%s\"", fs_last_error(), word);        \
  } while (0)

#define EXPECT_NEAR(a, b, tolerance)                                                                                \
  do {                                                                                                              \
    const double a_ = (a), b_ = (b);                                                                                \
    ck_assert_msg(std::fabs(a_ - b_) <= (tolerance), "%s is %.17g, not %.17g", #a, a_, b_);                         \
  } while (0)

#define EXPECT_VECTOR(a, b, tolerance)                                                                              \
  do {                                                                                                              \
    const fs_vec3 a_ = (a), b_ = (b);                                                                               \
    ck_assert_msg(scenes::norm(a_ - b_) <= (tolerance), "%s is (%.17g, %.17g, %.17g), not (%.17g, %.17g, %.17g)",   \
                  #a, a_.x, a_.y, a_.z, b_.x, b_.y, b_.z);                                                          \
  } while (0)

namespace scenes {

// The hand at x at time t (s), at rest.
inline fs_state hand_at(fs_vec3 x, double time = FS_NOW) {
  fs_state state{};
  state.pose = at(x);
  state.time = time;
  return state;
}

inline fs_response evaluate(fs_tool* tool, const fs_state& state) {
  fs_response response;
  require(fs_evaluate(tool, &state, &response), "fs_evaluate");
  return response;
}
inline fs_vec3 force_at(fs_tool* tool, fs_vec3 x, double time = FS_NOW) {
  return evaluate(tool, hand_at(x, time)).wrench.force;
}

inline double now(fs_scene* scene) {
  double time = 0;
  OK(fs_scene_get_time(scene, &time));
  return time;
}

inline size_t object_count(fs_scene* scene) {
  size_t count = 0;
  OK(fs_scene_get_reports(scene, nullptr, 0, &count));
  return count;
}

inline fs_report report_of(fs_scene* scene, const char* name) {
  fs_report report;
  OK(fs_scene_get_report(scene, name, &report));
  return report;
}

inline fs_servo_stats stats_of(fs_scene* scene) {
  fs_servo_stats stats = fs_servo_stats_init();
  OK(fs_scene_get_servo_stats(scene, &stats));
  return stats;
}

// Options of a virtual servo without the protections that change what a moving hand or a change is felt like: a test sets
// those it needs.
inline fs_servo_options virtual_options() {
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  options.rate = 1000;
  options.damping = options.max_stiffness = options.slew_limit = options.blend = -1;
  return options;
}

// A servo of a scene on a fake device, stepped by the test.
struct Rig {
  FakeDevice fake;
  Scene scene = make_scene();
  Device device;
  Servo servo;

  explicit Rig(const char* name) : fake(name) {}
  void start(const fs_servo_options& options) {
    device = fake.open();
    servo = start_servo(scene.get(), device.get(), options);
  }
  void step(uint64_t ticks) {  // even if the device is lost: all ticks run
    const fs_status status = fs_servo_step(servo.get(), ticks);
    if (status != FS_ERROR_DISCONNECTED) require(status, "fs_servo_step");
  }
  fs_vec3 sent() const { return fake.written.force; }
};

// Runs all cases of a suite. FORK: Check's own way, a crash is a failed test.
inline int run_suite(Suite* suite) {
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
// Adds one test case with these tests. Its time limit is for a servo that hangs, not for a slow machine.
inline void add_case(Suite* suite, const char* name, std::initializer_list<const TTest*> tests) {
  TCase* test_case = tcase_create(name);
  tcase_set_timeout(test_case, 500);
  for (const TTest* test : tests) tcase_add_test(test_case, test);
  suite_add_tcase(suite, test_case);
}

}  // namespace scenes
