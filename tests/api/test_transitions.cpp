// A client that is delayed in the middle of a call, and what else must survive a change of servo, clock or group.
// test_no_step has all orders of calls.
#include <chrono>
#include <cstddef>
#include <functional>
#include <new>
#include <thread>
#include <vector>

#include "api/support.h"

using namespace scenes;

// Every operator new of the program and of the library calls this. When the countdown ends, it runs `interrupt` first,
// as if the client were delayed in the middle of a call.
static thread_local long countdown = -1;  // -1: none
static std::function<void()> interrupt;

static void* allocate(size_t size, size_t alignment) {
  if (countdown >= 0 && countdown-- == 0) interrupt();
  const size_t whole = (size + alignment - 1) / alignment * alignment;
  void* p = alignment > alignof(std::max_align_t) ? std::aligned_alloc(alignment, whole) : std::malloc(whole);
  if (!p) throw std::bad_alloc();
  return p;
}
void* operator new(size_t size) { return allocate(size, 1); }
void* operator new(size_t size, std::align_val_t alignment) { return allocate(size, static_cast<size_t>(alignment)); }
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, size_t, std::align_val_t) noexcept { std::free(p); }

static constexpr double fade = 0.2, period = 0.001;  // s
static constexpr uint64_t whole_fade = 205;          // ticks: a fade and some more

// A hand at rest at the origin, unless a test moves it; no ramp, so that what is seen are fades.
struct FeltRig : Rig {
  std::vector<fs_wrench> log;
  fs_scene* s;

  explicit FeltRig(double with_fade = fade) : Rig("felt"), s(scene.get()), fade_(with_fade) {
    fake.info.force_max = 25;
  }
  ~FeltRig() { fake.log = nullptr; }
  void begin() {  // from here on steps count
    fs_servo_options options = virtual_options();
    options.fade = fade_;
    options.ramp = options.speed_limit = -1;
    start(options);
    step(5);
    fake.log = &log;
    log.assign(1, fake.written);
  }
  double largest_step() const {
    double largest = 0;
    for (size_t k = 1; k < log.size(); ++k) largest = std::fmax(largest, norm(log[k].force - log[k - 1].force));
    return largest;
  }

  void set(const fs_object& o) { OK(fs_object_set(s, &o)); }
  void remove(const char* name) { OK(fs_object_remove(s, name)); }
  void move(const char* name, fs_vec3 x) {
    const fs_pose pose = at(x);
    OK(fs_object_move(s, name, &pose, nullptr, FS_NOW));
  }
  void open() { OK(fs_scene_begin(s)); }
  void commit() { OK(fs_scene_commit(s)); }
  void cancel() { OK(fs_scene_cancel(s)); }
  void hold(bool held) { OK(fs_scene_set_clutch(s, held)); }
  void shift(double x) {
    fs_frame frame = fs_frame_init();
    frame.pose.position.x = x;
    OK(fs_scene_set_frame(s, &frame));
  }
  void expect(double force) {
    ck_assert_msg(std::fabs(norm(sent()) - force) < 1e-9, "%g N are felt, not %g", norm(sent()), force);
  }

 private:
  double fade_;
};

// A constant force towards a point 1 cm above the hand.
static fs_object pull(const char* name, double force = 10) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
  o.pose = at(0, 0, 0.01);
  o.front = constant(FS_SENSE_ATTRACTIVE, force);
  return o;
}
static fs_object mortal(fs_object o, double lifetime) {
  o.lifetime = lifetime;
  return o;
}
// Lines near the hand that draw it with 10 N: up, down, and along x.
static fs_object line(int which) {
  static const fs_vec3 ends[3][2]{{{-1, 0, 0.01}, {1, 0, 0.01}}, {{-1, 0, -0.01}, {1, 0, -0.01}},
                                  {{0.01, -1, 0}, {0.01, 1, 0}}};
  static const Shape shapes[3]{make_polyline(ends[0], 2, false), make_polyline(ends[1], 2, false),
                               make_polyline(ends[2], 2, false)};
  fs_object o = fs_object_init("line", FS_PRIMITIVE_POLYLINE);
  o.front = constant(FS_SENSE_ATTRACTIVE, 10);
  o.shape = shapes[which].get();
  return o;
}

// A group that is open when a servo starts, or when it ends.
START_TEST(groups_over_servos) {
  constexpr double most = 10 * period / fade * (1 + 1e-6);  // N, of a step
  for (const bool is_removed : {false, true}) {
    FeltRig rig;
    if (is_removed) rig.set(pull("x"));
    rig.open();
    if (is_removed) rig.remove("x");
    else rig.set(pull("x"));
    rig.begin();
    rig.step(2 * whole_fade);
    rig.expect(is_removed ? 10 : 0);
    rig.commit();
    rig.step(2 * whole_fade);
    rig.expect(is_removed ? 0 : 10);
    ck_assert_double_le(rig.largest_step(), most);
  }
  FeltRig rig;
  rig.set(pull("x"));
  rig.begin();
  rig.open();
  rig.remove("x");
  rig.set(pull("y"));
  rig.step(20);
  rig.fake.log = nullptr;
  rig.servo.reset();
  rig.commit();
  const Tool tool = make_tool(rig.s);
  EXPECT_NEAR(norm(force_at(tool.get(), {})), 10, 1e-12);
  ck_assert_uint_eq(object_count(rig.s), 1);
  rig.begin();  // and the next servo has everything
  rig.expect(10);
  rig.open();
  rig.remove("y");
  rig.fake.log = nullptr;
  rig.servo.reset();
  rig.begin();
  rig.expect(10);
  rig.cancel();
  rig.step(2 * whole_fade);
  rig.expect(10);
  ck_assert_double_eq(rig.largest_step(), 0);
}
END_TEST

// A client that is delayed for a quarter of a fade in each allocation of a call, while ticks go on.
struct Call {
  const char* name;
  double force;
  std::function<void(FeltRig&)> before, call;
};

START_TEST(a_client_held_up) {
  const auto set = [](FeltRig& rig) { rig.set(pull("x")); };
  const auto steady = [set](FeltRig& rig) { set(rig); rig.step(2 * whole_fade); };
  const auto busy = [steady](FeltRig& rig) {  // a great many changes since the last tick
    steady(rig);
    for (int k = 0; k < 17; ++k) rig.set(pull(("f" + std::to_string(k)).c_str(), 1e-6));
  };
  const auto remove = [](FeltRig& rig) { rig.remove("x"); };
  const Call calls[]{
      {"set", 10, [](FeltRig&) {}, set},
      {"set over another", 20, [](FeltRig& rig) { rig.set(line(0)); rig.step(9); rig.set(line(1)); },
       [](FeltRig& rig) { rig.set(line(1)); }},
      {"another shape", 20, [](FeltRig& rig) { rig.set(line(0)); }, [](FeltRig& rig) { rig.set(line(1)); }},
      {"remove", 10, set, remove},
      {"remove of a steady one", 10, steady, remove},
      {"remove after many changes", 10.001, busy, remove},
      {"set while it fades out", 10, [steady, remove](FeltRig& rig) { steady(rig); remove(rig); }, set},
      {"clutch", 10, steady, [](FeltRig& rig) { rig.hold(true); }},
      {"clutch let go", 20, [steady](FeltRig& rig) { steady(rig); rig.hold(true); },
       [](FeltRig& rig) { rig.hold(false); }},
      {"frame", 20, steady, [](FeltRig& rig) { rig.shift(0); }},
      {"clear", 10, steady, [](FeltRig& rig) { OK(fs_scene_clear(rig.s)); }},
      {"begin", 10, set, [](FeltRig& rig) { rig.open(); }},
      {"commit", 10, [set](FeltRig& rig) { set(rig); rig.open(); rig.remove("x"); },
       [](FeltRig& rig) { rig.commit(); }},
      {"cancel", 10, [set](FeltRig& rig) { set(rig); rig.open(); rig.remove("x"); },
       [](FeltRig& rig) { rig.cancel(); }},
  };
  for (const Call& call : calls) {
    for (long k = 0;; ++k) {
      FeltRig rig;
      rig.begin();
      call.before(rig);
      bool is_reached = false;
      interrupt = [&] {
        is_reached = true;
        rig.step(50);
      };
      countdown = k;
      call.call(rig);
      countdown = -1;
      rig.step(2 * whole_fade);
      const double allowed = call.force * period / fade * (1 + 1e-6) + 1e-9;
      ck_assert_msg(rig.largest_step() <= allowed, "%s, held up in allocation %ld: a step of %g N, %g are allowed",
                    call.name, k, rig.largest_step(), allowed);
      if (!is_reached) {
        ck_assert_msg(k > 0 || std::strcmp(call.name, "cancel") == 0, "%s allocates nothing here", call.name);
        break;
      }
    }
  }
}
END_TEST

// Servos.

static fs_servo_options fast_options() {  // without fades
  fs_servo_options options = virtual_options();
  options.ramp = options.fade = -1;
  return options;
}

// An object is disabled while one shape of it fades in and the next one waits: the first fades out from then on.
START_TEST(disabled_while_a_shape_waits) {
  FeltRig rig;
  rig.begin();
  rig.set(line(0));
  rig.step(50);
  rig.set(line(1));
  rig.step(20);
  fs_object off = line(2);
  off.enabled = false;
  rig.set(off);
  rig.step(1);
  const size_t from = rig.log.size();
  rig.step(whole_fade);
  for (size_t k = from; k < rig.log.size(); ++k) {
    ck_assert_double_le(norm(rig.log[k].force), norm(rig.log[k - 1].force) + 1e-9);
  }
  ck_assert_double_gt(norm(rig.log[from - 1].force), 2);
  rig.expect(0);
}
END_TEST

START_TEST(enabled_twice) {  // between two ticks: clears a fault as once does
  for (int times = 1; times <= 3; ++times) {
    Rig rig("twice");
    rig.start(fast_options());
    rig.step(5);
    rig.fake.state.pose.position.x = NAN;
    rig.step(1);
    rig.fake.state.pose.position.x = 0;
    rig.step(1);
    ck_assert_uint_eq(stats_of(rig.scene.get()).faults, FS_FAULT_NUMBER);
    for (int k = 0; k < times; ++k) OK(fs_servo_set_enabled(rig.servo.get(), true));
    rig.step(3);
    ck_assert_uint_eq(stats_of(rig.scene.get()).faults, 0);
  }
}
END_TEST

START_TEST(late_is_late) {  // also when someone enables the servo now and then
  for (bool is_enabled : {false, true}) {
    FakeDevice fake("late");
    const Scene scene = make_scene();
    const Device device = fake.open(false);
    fs_servo_options options = virtual_options();
    options.mode = FS_SERVO_CALLER;
    const Servo servo = start_servo(scene.get(), device.get(), options);
    uint32_t faults = 0;
    for (int k = 0; k < 200 && !(faults & FS_FAULT_LATE); ++k) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      fs_servo_step(servo.get(), 1);
      faults = stats_of(scene.get()).faults;
      if (is_enabled && k % 15 == 14) OK(fs_servo_set_enabled(servo.get(), true));
    }
    ck_assert_uint_eq(faults, FS_FAULT_LATE);
  }
}
END_TEST

START_TEST(a_bad_twist_and_the_speed_limit) {  // of a driver that gives no twists otherwise
  for (bool is_bad : {false, true}) {
    Rig rig("badtwist");
    rig.start(fast_options());
    rig.step(10);
    if (is_bad) {
      rig.fake.state.twist.linear.x = NAN;
      rig.step(1);
      rig.fake.state.twist.linear.x = 0;
      rig.step(1);
      ck_assert_uint_eq(stats_of(rig.scene.get()).faults, FS_FAULT_NUMBER);
      OK(fs_servo_set_enabled(rig.servo.get(), true));
      rig.step(2);
      ck_assert_uint_eq(stats_of(rig.scene.get()).faults, 0);
    }
    for (int k = 0; k < 50; ++k) {  // 5 m/s
      rig.fake.state.pose.position.x += 0.005;
      rig.step(1);
    }
    ck_assert_uint_eq(stats_of(rig.scene.get()).faults, FS_FAULT_SPEED);
  }
}
END_TEST

START_TEST(a_hand_that_never_was) {  // it is at the identity
  Rig rig("never");
  rig.fake.read_status = FS_ERROR_DISCONNECTED;
  rig.start(fast_options());
  for (int k = 0; k < 3; ++k) {
    fs_state hand;
    fs_response response;
    OK(fs_scene_get_hand(rig.scene.get(), &hand, &response, nullptr));
    for (const fs_pose& pose : {hand.pose, response.proxy}) {
      ck_assert_double_eq(pose.orientation.w, 1);
      EXPECT_VECTOR(pose.position, (fs_vec3{}), 0);
    }
    rig.step(1);
  }
}
END_TEST

START_TEST(expired_before_the_servo) {  // is not felt by it, not even on the way out
  Rig rig("expired");
  OK(fs_scene_set_time(rig.scene.get(), 10));
  fs_object o = mortal(pull("x", 4), 1);
  o.pose = at(3, 0, 0);
  OK(fs_object_set(rig.scene.get(), &o));
  OK(fs_scene_set_time(rig.scene.get(), 11.1));
  fs_servo_options options = fast_options();
  options.fade = 0.5;
  rig.start(options);
  for (int k = 0; k < 10; ++k) {
    rig.step(1);
    EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  }
}
END_TEST

START_TEST(sent_is_what_the_device_got) {
  Rig rig("twoaxes");
  rig.fake.info.force_axes = 2;
  fs_object o = pull("x", 4);
  o.pose = at(3, 0, 4);
  OK(fs_object_set(rig.scene.get(), &o));
  rig.start(fast_options());
  rig.step(5);
  fs_wrench sent;
  OK(fs_scene_get_hand(rig.scene.get(), nullptr, nullptr, &sent));
  EXPECT_VECTOR(rig.sent(), (fs_vec3{2.4, 0, 0}), 1e-12);
  EXPECT_VECTOR(sent.force, rig.sent(), 0);
  fs_tick tick;
  size_t count = 0;
  OK(fs_servo_get_record(rig.servo.get(), &tick, 1, &count));
  EXPECT_VECTOR(tick.sent.force, rig.sent(), 0);
}
END_TEST

START_TEST(reports_begin_anew) {  // with the servo: nothing is left of the one before
  Rig rig("stale");
  fs_object o = pull("x");
  o.front.reach = 0.02;
  OK(fs_object_set(rig.scene.get(), &o));
  rig.start(fast_options());
  rig.step(3000);
  EXPECT_NEAR(report_of(rig.scene.get(), "x").distance, 0.01, 1e-12);
  rig.servo.reset();
  ck_assert(std::isinf(report_of(rig.scene.get(), "x").distance));
  rig.fake.state.pose = at(0.1, 0, 0);
  rig.start(fast_options());
  ck_assert(std::isinf(report_of(rig.scene.get(), "x").distance));
  rig.step(100);
  const fs_report report = report_of(rig.scene.get(), "x");
  ck_assert(std::isinf(report.distance));
  EXPECT_VECTOR(report.wrench.force, (fs_vec3{}), 0);
}
END_TEST

START_TEST(views_of_another_servo) {  // before its first tick: the servo before it leaves no row of a view in use
  Rig rig("views");
  fs_servo_options options = fast_options();
  options.fade = 0.05;
  fs_frame frame = fs_frame_init();
  const auto set_frame = [&] {
    frame.pose.position.x += 0.001;
    OK(fs_scene_set_frame(rig.scene.get(), &frame));
  };
  rig.fake.on_write = [&](FakeDevice&) { set_frame(); };  // amid a tick, which has its snapshot and has not said so yet
  for (int servo = 0; servo < 4; ++servo) {
    rig.start(options);
    for (int i = 0; i < 50; ++i) {
      for (int k = 0; k < 30; ++k) set_frame();
      const fs_object o = pull(("x" + std::to_string(i)).c_str());
      OK(fs_scene_begin(rig.scene.get()));
      OK(fs_object_set(rig.scene.get(), &o));
      set_frame();
      OK(fs_scene_commit(rig.scene.get()));
      rig.step(1);
    }
    rig.servo.reset();
  }
}
END_TEST

START_TEST(views_amid_ticks) {  // in any number, while the clutch is held and released
  Rig rig("views");
  fs_servo_options options = fast_options();
  options.fade = 0.05;
  Random random(3);
  fs_frame frame = fs_frame_init();
  const auto change = [&] {
    frame.pose.position.x += 0.001;
    if (random.coin(0.3)) OK(fs_scene_set_clutch(rig.scene.get(), random.coin()));
    if (random.coin(0.8)) OK(fs_scene_set_frame(rig.scene.get(), &frame));
  };
  rig.fake.on_write = [&](FakeDevice&) { change(); };
  rig.start(options);
  for (int i = 0; i < 2000; ++i) {
    for (size_t k = random.coin() ? random.below(3) : 30; k > 0; --k) change();
    rig.step(1 + random.below(3));
  }
}
END_TEST

// Events.

static std::vector<fs_event> events_of(fs_scene* scene, fs_event_kind kind, double timeout = 0) {
  std::vector<fs_event> all;
  for (fs_event event;;) {
    OK(fs_scene_next_event(scene, timeout, &event));
    if (event.kind == FS_EVENT_NONE) return all;
    if (event.kind == kind) all.push_back(event);
  }
}

START_TEST(expiry_is_told) {  // gives one event, whatever comes between
  {
    FeltRig rig;  // the servo stops before the event is fetched
    rig.begin();
    rig.set(mortal(pull("x"), 0.5));
    const double due = now(rig.s) + 0.5;
    rig.step(2000);
    const double age = now(rig.s) - due;
    rig.fake.log = nullptr;
    rig.servo.reset();
    const double stopped = now(rig.s);
    const std::vector<fs_event> events = events_of(rig.s, FS_EVENT_EXPIRED);
    ck_assert_uint_eq(events.size(), 1);
    ck_assert_str_eq(events[0].name, "x");
    ck_assert_double_ge(stopped - events[0].time, age - 1e-6);  // on the present clock
    ck_assert_double_le(stopped - events[0].time, age + 10);
  }
  {
    const Scene scene = make_scene();  // a lifetime that is over at once
    const fs_object o = mortal(pull("x"), 1e-9);
    OK(fs_object_set(scene.get(), &o));
    ck_assert_uint_eq(events_of(scene.get(), FS_EVENT_EXPIRED, 0.02).size(), 1);
    const fs_object least = mortal(pull("y"), 5e-324);
    OK(fs_object_set(scene.get(), &least));
    ck_assert_uint_eq(events_of(scene.get(), FS_EVENT_EXPIRED, 0.02).size(), 1);
  }
  for (bool is_kept : {false, true}) {
    FeltRig rig;  // moved in a group: evaluation does not see it
    rig.begin();
    rig.set(mortal(pull("x"), 0.5));
    const double due = now(rig.s) + 0.5;
    rig.open();
    rig.move("x", {});
    rig.step(2000);
    rig.expect(0);
    const std::vector<fs_event> events = events_of(rig.s, FS_EVENT_EXPIRED);
    ck_assert_uint_eq(events.size(), 1);
    EXPECT_NEAR(events[0].time, due, 1e-9);
    is_kept ? rig.commit() : rig.cancel();
    rig.step(10);
    ck_assert_uint_eq(events_of(rig.s, FS_EVENT_EXPIRED).size(), 0);
    rig.move("x", {});  // it lives again, and dies again
    rig.step(600);
    ck_assert_uint_eq(events_of(rig.s, FS_EVENT_EXPIRED).size(), 1);
  }
  {
    FeltRig rig;  // asked for only once the group is cancelled
    rig.begin();
    rig.set(mortal(pull("x"), 0.5));
    rig.open();
    rig.move("x", {});
    rig.step(2000);
    rig.cancel();
    ck_assert_uint_eq(events_of(rig.s, FS_EVENT_EXPIRED).size(), 1);
  }
  {
    FeltRig rig;  // removed in a group that is cancelled
    rig.begin();
    rig.set(mortal(pull("x"), 0.1));
    rig.open();
    rig.remove("x");
    rig.step(200);
    rig.cancel();
    rig.step(10);
    ck_assert_uint_eq(events_of(rig.s, FS_EVENT_EXPIRED).size(), 1);
  }
}
END_TEST

START_TEST(events_keep_their_age) {  // when a servo's stop changes the clock
  Rig rig("ages");
  rig.start(fast_options());
  rig.step(1000);
  rig.servo.reset();
  const double stopped = now(rig.scene.get());
  const std::vector<fs_event> events = events_of(rig.scene.get(), FS_EVENT_DEVICE);
  ck_assert_uint_eq(events.size(), 1);  // the device is ready, at the first tick
  ck_assert_double_ge(stopped - events[0].time, 0.999 - 1e-6);
  ck_assert_double_le(stopped - events[0].time, 0.999 + 10);
}
END_TEST

// Groups and evaluation.

START_TEST(fields_and_open_groups) {
  const Scene scene = make_scene();
  const fs_vec3 x{};
  fs_vec3 force{};
  const fs_object a = pull("a"), b = pull("b");
  OK(fs_object_set(scene.get(), &b));
  OK(fs_scene_begin(scene.get()));
  OK(fs_object_set(scene.get(), &a));
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_evaluate_field(scene.get(), "a", FS_NOW, &x, 1, &force), "a");
  OK(fs_object_remove(scene.get(), "b"));
  OK(fs_evaluate_field(scene.get(), "b", FS_NOW, &x, 1, &force));
  EXPECT_VECTOR(force, (fs_vec3{0, 0, 10}), 1e-12);
  OK(fs_scene_commit(scene.get()));
  OK(fs_evaluate_field(scene.get(), "a", FS_NOW, &x, 1, &force));
  EXPECT_VECTOR(force, (fs_vec3{0, 0, 10}), 1e-12);
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_evaluate_field(scene.get(), "b", FS_NOW, &x, 1, &force), "b");
}
END_TEST

START_TEST(expressions_and_open_groups) {  // for a tool that is created while the group is open, and stays
  if (!has_expressions()) return;
  const Scene other = make_scene();
  std::vector<Tool> others;
  // so that new tools do not take over the memory of old ones
  for (int k = 0; k < 8; ++k) others.push_back(make_tool(other.get()));
  FeltRig rig;
  const Curve five = make_expression("5"), three = make_expression("3");
  fs_object o = pull("x", 1);
  o.front.kind = FS_PROFILE_CUSTOM;
  o.front.limit = 9;
  o.front.curve = five.get();
  rig.set(o);
  auto felt = [](const Tool& tool) { return force_at(tool.get(), {}).z; };

  rig.open();  // an object that only those outside of the group have
  rig.remove("x");
  const Tool first = make_tool(rig.s);
  EXPECT_NEAR(felt(first), 5, 1e-12);
  rig.cancel();
  EXPECT_NEAR(felt(first), 5, 1e-12);

  rig.open();  // one that only the group has
  o.front.curve = three.get();
  rig.set(o);
  const Tool second = make_tool(rig.s);
  EXPECT_NEAR(felt(second), 5, 1e-12);
  rig.commit();
  EXPECT_NEAR(felt(first), 3, 1e-12);
  EXPECT_NEAR(felt(second), 3, 1e-12);

  rig.open();
  rig.remove("x");
  rig.begin();
  rig.step(2 * whole_fade);
  rig.expect(3);
  rig.cancel();
  rig.step(2 * whole_fade);
  rig.expect(3);
}
END_TEST

START_TEST(poses_of_extreme_directions) {
  const fs_vec3 directions[]{
      {1e-170, 0, -1}, {1e-162, 0, -1}, {1e-100, 0, -1}, {1e-9, 0, -1}, {0, -1e-170, -1}, {1e-160, 1e-161, -1},
      {1e-170, 0, 1}, {1e-9, 0, 1}, {0, 0, -1}, {0, 0, 1}, {0, 0, -1e-300}, {1e-300, -1e-300, 1e-300},
      {5e-324, 0, 0}, {0, 5e-324, -5e-324}, {1e300, -1e300, 1e300}, {1.7e308, 1.7e308, -1.7e308}, {1e308, 0, -1e-308}};
  for (const fs_vec3& direction : directions) {
    fs_pose pose;
    OK(fs_pose_from_z({1, 2, 3}, direction, &pose));
    const fs_quat q = pose.orientation;
    const double largest = std::fmax(std::fabs(direction.x), std::fmax(std::fabs(direction.y), std::fabs(direction.z)));
    const fs_vec3 z = unit(fs_vec3{direction.x / largest, direction.y / largest, direction.z / largest});
    ck_assert_msg(std::fabs(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z - 1) < 1e-12 &&
                  norm(rotate(q, {0, 0, 1}) - z) < 1e-12, "(%g, %g, %g): (%.17g, %.17g, %.17g, %.17g)", direction.x,
                  direction.y, direction.z, q.w, q.x, q.y, q.z);
    EXPECT_NEAR(q.z, 0, 0);  // the shortest way
    EXPECT_VECTOR(pose.position, (fs_vec3{1, 2, 3}), 0);
  }
}
END_TEST

int main() {
  Suite* suite = suite_create("transitions");
  add_case(suite, "transitions", {a_client_held_up, groups_over_servos});
  add_case(suite, "servos", {disabled_while_a_shape_waits, enabled_twice, late_is_late, a_bad_twist_and_the_speed_limit, a_hand_that_never_was,
                             expired_before_the_servo, sent_is_what_the_device_got, reports_begin_anew, views_of_another_servo,
                             views_amid_ticks});
  add_case(suite, "events", {expiry_is_told, events_keep_their_age});
  add_case(suite, "groups", {fields_and_open_groups, expressions_and_open_groups, poses_of_extreme_directions});
  return run_suite(suite);
}
