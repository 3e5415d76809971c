// A driver that measures the delay of its link while the servo runs: what the loop can render follows, without a step in force,
// and the hand does not shake; figures that cannot be are refused.
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <forceserver/driver.h>

#include "api/support.h"
#include "api/world.h"

using namespace scenes;

static constexpr double infinite = std::numeric_limits<double>::infinity();
static constexpr double period = 1e-3, follows_within = 0.2, blend = 0.02;  // s
static constexpr double device_mass = 0.1;                                   // kg: light, so that its damping is limited, too

static fs_servo_options protected_options() {
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  options.ramp = options.fade = -1;
  return options;
}

static void describe(fs_device_info& info, double delay) {
  info.mass = device_mass;
  info.damping = 1;
  info.resolution = 0;
  info.delay = delay;
}

// What a servo says of a device that has had this delay from the start.
static fs_servo_stats stats_at(double delay, const fs_servo_options& options = protected_options()) {
  Rig rig("from_the_start");
  describe(rig.fake.info, delay);
  rig.start(options);
  return stats_of(rig.scene.get());
}

namespace {

// A device whose driver tells what the test says, from 2 ms on.
struct Measured : Rig {
  explicit Measured(const char* name) : Rig(name) {
    describe(fake.info, 0.002);
    link.delay = 0.002;
    fake.on_link = [this](FakeDevice&, fs_link& out) {
      ck_assert_uint_eq(out.struct_size, sizeof out);
      ck_assert(out.delay == 0 && out.delay_p99 == 0 && out.rate == 0 && out.loss == 0);
      out = link;
      return link_status;
    };
    link.struct_size = sizeof link;
  }
  ~Measured() { end(); }
  void end() {  // the device is given a last 0
    servo.reset();
    device.reset();
  }
  fs_servo_stats stats() const { return stats_of(scene.get()); }
  // All events of nonsense that came since it was called last.
  std::vector<fs_event> refusals() {
    std::vector<fs_event> out;
    for (fs_event event;;) {
      OK(fs_scene_next_event(scene.get(), 0, &event));
      if (event.kind == FS_EVENT_NONE) return out;
      if (event.kind == FS_EVENT_DEVICE && event.status == FS_ERROR_INVALID) out.push_back(event);
    }
  }

  fs_link link{};
  fs_status link_status = FS_OK;
};

enum class Wall { profile, contact };

// A light hand on that device leans on a wall along z. The loop really has `delay`: a force acts so long after it was sent.
struct Leaning : Measured {
  explicit Leaning(Wall wall) : Measured("leaning") {
    fake.on_read = [this](FakeDevice& device, double time) {
      advance(time);
      device.state.pose.position.z = z;
    };
    fake.on_write = [this](FakeDevice& device) { sent_forces.push_back(device.written.force.z); };
    fs_object o = fs_object_init("wall", FS_PRIMITIVE_PLANE);
    if (wall == Wall::profile) o.back = attract(5000, 20);
    if (wall == Wall::contact) o.contact = {FS_KEEP_FRONT, 0, 5000, 20, 0, 0, {}};
    OK(fs_object_set(scene.get(), &o));
  }
  ~Leaning() { end(); }
  void set_delay(double seconds, bool is_told = true) {
    delay = seconds;
    if (is_told) link.delay = seconds;
  }
  double applied() { return report_of(scene.get(), "wall").stiffness_applied; }
  double swing(int ticks) {  // m, peak to peak
    double low = infinite, high = -infinite;
    for (int k = 0; k < ticks; ++k) {
      step(1);
      low = std::fmin(low, z);
      high = std::fmax(high, z);
    }
    return high - low;
  }

  double delay = 0.002, z = 0.001, speed = 0;
  std::vector<double> sent_forces;  // N, of tick 1, 2, ..

 private:
  static constexpr double hand_mass = 0.15, hand_damping = 3, hand_stiffness = 100, target = -0.04;  // the light hand
  double advanced = 0;
  void advance(double until) {
    constexpr double substep = period / 16;
    for (; advanced < until - substep / 2; advanced += substep) {
      const auto sent = static_cast<int64_t>(std::floor((advanced + substep / 2 - delay) / period));  // the tick that sent it
      const double force = sent >= 1 ? sent_forces[std::min<size_t>(static_cast<size_t>(sent), sent_forces.size()) - 1] : 0;
      const double all = force + hand_stiffness * (target - z) - (hand_damping + 1) * speed;
      speed += substep * all / (hand_mass + device_mass);
      z += substep * speed;
    }
  }
};

}  // namespace

START_TEST(a_hand_leans_while_the_delay_changes) {
  for (const Wall wall : {Wall::profile, Wall::contact}) {
    Leaning rig(wall);
    rig.start(protected_options());
    double before = stats_at(0.002).max_stiffness;
    for (const double delay : {0.002, 0.020, 0.002}) {
      const fs_servo_stats expected = stats_at(delay);
      const double stiffest = std::fmax(before, expected.max_stiffness), deepest = std::fmax(0, -rig.z);
      rig.set_delay(delay);
      double most = 0;  // N, of what a tick changes beyond what it may
      for (int k = 0; k < 1000 * follows_within; ++k) {
        const double z = rig.z, force = rig.sent_forces.empty() ? 0 : rig.sent_forces.back();
        rig.step(1);
        const double blended = std::fabs(before - expected.max_stiffness) * std::fmax(deepest, -rig.z) * period / blend;
        const double moved = stiffest * std::fabs(rig.z - z);
        most = std::fmax(most, std::fabs(rig.sent_forces.back() - force) - blended - moved);
      }
      ck_assert_msg(most <= 0.2, "delay %g: a tick changes the force by %g N more than bound and motion do", delay, most);
      EXPECT_NEAR(rig.applied(), expected.max_stiffness, 1e-9 * expected.max_stiffness);
      const fs_servo_stats stats = rig.stats();
      ck_assert_double_eq(stats.max_stiffness, expected.max_stiffness);
      ck_assert_double_eq(stats.damping, expected.damping);
      ck_assert_double_eq(stats.delay, delay);
      rig.swing(2000);
      const double rest = rig.swing(1000);
      ck_assert_msg(rest < 1e-4, "delay %g: the hand swings by %g mm", delay, 1e3 * rest);
      before = expected.max_stiffness;
    }
    ck_assert_uint_eq(rig.stats().faults, 0);
  }
}
END_TEST

// The test above can fail: where the delay is not told, the hand swings.
START_TEST(a_delay_that_is_not_told_shakes) {
  for (const Wall wall : {Wall::profile, Wall::contact}) {
    Leaning rig(wall);
    rig.start(protected_options());
    rig.step(1000);
    rig.set_delay(0.020, false);
    rig.step(2000);
    ck_assert_double_gt(rig.swing(1000), 1e-3);
  }
}
END_TEST

// Both limits are those of the formula in servo.h.
START_TEST(the_formula_holds) {
  Measured rig("formula");
  rig.start(protected_options());
  for (const double delay : {0.020, 0.002, 0.0, 0.1}) {
    rig.link.delay = delay;
    rig.step(200);
    const double lag = period / 2 + delay, damping = std::fmin(5, 0.7 * device_mass / lag);
    EXPECT_NEAR(rig.stats().damping, damping, 1e-12);
    ck_assert_double_le(rig.stats().max_stiffness, (1 + damping) / 2 / lag);
    ck_assert_double_gt(rig.stats().max_stiffness, 0.3 * (1 + damping) / 2 / lag);
  }
}
END_TEST

// The local damping of a hand that is moved changes in even steps.
START_TEST(damping_is_blended) {
  constexpr double speed = 0.3;  // m/s
  Measured rig("moved");
  rig.fake.on_read = [](FakeDevice& device, double time) { device.state.pose.position.x = speed * (time - 0.5); };
  rig.start(protected_options());
  rig.step(300);
  EXPECT_NEAR(rig.sent().x, -5 * speed, 1e-6);
  for (const double delay : {0.020, 0.002}) {
    const double before = rig.stats().damping, after = stats_at(delay).damping, step = speed * std::fabs(before - after) / 20;
    ck_assert_double_gt(step, 0.01);
    rig.link.delay = delay;
    for (int k = 0; k < 200; ++k) {
      const double force = rig.sent().x;
      rig.step(1);
      ck_assert_double_le(std::fabs(rig.sent().x - force), 1.001 * step);
    }
    EXPECT_NEAR(rig.sent().x, -after * speed, 1e-6);
  }
}
END_TEST

START_TEST(nonsense_is_refused) {
  const struct {
    const char* word;
    void (*change)(fs_link& link);
  } bad[]{{"delay of -1 s, must be within 0..10 s", [](fs_link& l) { l.delay = -1; }},
          {"delay of nan s", [](fs_link& l) { l.delay = NAN; }},
          {"delay of inf s", [](fs_link& l) { l.delay = infinite; }},
          {"delay of 1e+09 s", [](fs_link& l) { l.delay = 1e9; }},
          {"delay_p99 of 0.001 s, must be within 0.002..10 s", [](fs_link& l) { l.delay_p99 = 0.001; }},
          {"delay_p99 of nan s", [](fs_link& l) { l.delay_p99 = NAN; }},
          {"rate of -1 Hz, must be within 0..1e+06 Hz", [](fs_link& l) { l.rate = -1; }},
          {"loss of 1.5, must be within 0..1", [](fs_link& l) { l.loss = 1.5; }},
          {"loss of nan", [](fs_link& l) { l.loss = NAN; }}};
  for (const auto& each : bad) {
    Measured rig("nonsense");
    rig.start(protected_options());
    rig.step(100);
    const fs_servo_stats before = rig.stats();
    const fs_link good = rig.link;
    each.change(rig.link);
    rig.step(2000);
    const fs_servo_stats after = rig.stats();
    ck_assert_double_eq(after.delay, 0.002);
    ck_assert_double_eq(after.max_stiffness, before.max_stiffness);
    ck_assert_double_eq(after.damping, before.damping);
    ck_assert_double_eq(after.link_delay_p50, 0.002);
    ck_assert(after.link_delay_p99 == 0 && after.link_rate == 0 && after.link_loss == 0);
    ck_assert_uint_eq(after.faults, 0);
    std::vector<fs_event> events = rig.refusals();
    ck_assert_uint_eq(events.size(), 1);  // of 50 looks
    ck_assert_str_eq(events[0].name, "fake device");
    ck_assert_double_eq(events[0].value, 0);
    ck_assert_msg(std::strstr(events[0].text, each.word), "\"%s\" does not say \"%s\"", events[0].text, each.word);
    // Good figures count again, and nonsense after them is told again.
    rig.link = good;
    rig.link.delay = 0.020;
    rig.step(100);
    ck_assert_double_eq(rig.stats().delay, 0.020);
    each.change(rig.link);
    rig.step(100);
    ck_assert_uint_eq(rig.refusals().size(), 1);
    ck_assert_double_eq(rig.stats().delay, 0.020);
  }
}
END_TEST

// A driver that changes between nonsense and good figures all the time: an event a second.
START_TEST(nonsense_is_told_seldom) {
  Measured rig("flickers");
  bool is_bad = false;
  rig.fake.on_link = [&](FakeDevice&, fs_link& out) {
    is_bad = !is_bad;
    out.delay = is_bad ? -1 : 0.002;
    return FS_OK;
  };
  rig.start(protected_options());
  rig.step(5000);
  const size_t count = rig.refusals().size();
  ck_assert_uint_ge(count, 4);
  ck_assert_uint_le(count, 6);
}
END_TEST

// What the options say stays.
START_TEST(what_is_given_stays) {
  fs_servo_options options = protected_options();
  options.delay = 0.005;
  const auto run = [&](double delay) {
    Measured rig("given");
    rig.start(options);
    rig.link.delay = delay;
    rig.step(200);
    return rig.stats();
  };
  ck_assert_double_eq(run(0.020).delay, 0.005);
  ck_assert_double_eq(run(0.020).max_stiffness, stats_at(0.005).max_stiffness);
  ck_assert_double_eq(run(0.020).link_delay_p50, 0.020);
  options = protected_options();
  options.damping = 4;
  ck_assert_double_eq(run(0.002).damping, 4);
  EXPECT_NEAR(run(0.020).damping, 0.7 * device_mass / 0.0205, 1e-12);  // as much of it as can be rendered
  options = protected_options();
  options.max_stiffness = 300;
  ck_assert_double_eq(run(0.002).max_stiffness, 300);
  ck_assert_double_lt(stats_at(0.020).max_stiffness, 300);
  ck_assert_double_eq(run(0.020).max_stiffness, stats_at(0.020).max_stiffness);
  options.max_stiffness = -1;
  ck_assert_double_eq(run(0.020).max_stiffness, infinite);
  ck_assert_double_eq(run(0.020).delay, 0.020);  // the damping follows
  EXPECT_NEAR(run(0.020).damping, 0.7 * device_mass / 0.0205, 1e-12);
  // With a slew limit of one's own the stiffness never rises above what the limit allows.
  options = protected_options();
  options.slew_limit = 3 * stats_at(0.002).max_stiffness * (1 + 1e-9);
  ck_assert_double_lt(run(0.002).max_stiffness, stats_at(0).max_stiffness);
  EXPECT_NEAR(run(0).max_stiffness, stats_at(0.002).max_stiffness, 1e-3);
}
END_TEST

// A longer delay counts at the next look, a shorter one after three; small changes and a look that gives nothing do not matter.
START_TEST(the_longest_of_three_counts) {
  Measured rig("looks");
  int looks = 0;
  const auto tell = rig.fake.on_link;
  rig.fake.on_link = [&](FakeDevice& device, fs_link& out) {
    ++looks;
    return tell(device, out);
  };
  rig.start(protected_options());
  rig.step(1000);
  ck_assert_int_ge(looks, 20);
  ck_assert_int_le(looks, 26);
  const auto look = [&](int count) {
    const int end = looks + count;
    while (looks < end) rig.step(1);
  };
  look(1);
  rig.link.delay = 0.010;
  look(1);
  ck_assert_double_eq(rig.stats().delay, 0.010);
  rig.link.delay = 0.004;
  look(2);
  ck_assert_double_eq(rig.stats().delay, 0.010);
  look(1);
  ck_assert_double_eq(rig.stats().delay, 0.004);
  rig.link.delay = 0.0037;  // less by less than a tenth
  look(5);
  ck_assert_double_eq(rig.stats().delay, 0.004);
  ck_assert_double_eq(rig.stats().link_delay_p50, 0.0037);
  rig.link.delay = 0.0041;
  look(1);
  ck_assert_double_eq(rig.stats().delay, 0.0041);
  rig.link.delay_p99 = 0.006;
  rig.link.rate = 990;
  rig.link.loss = 0.01;
  look(1);
  const fs_servo_stats stats = rig.stats();
  ck_assert_double_eq(stats.delay, 0.006);
  ck_assert_double_eq(stats.link_delay_p50, 0.0041);
  ck_assert_double_eq(stats.link_delay_p99, 0.006);
  ck_assert_double_eq(stats.link_rate, 990);
  ck_assert_double_eq(stats.link_loss, 0.01);
  rig.link_status = FS_ERROR_UNSUPPORTED;
  rig.link.delay = -1;
  look(5);
  ck_assert_double_eq(rig.stats().delay, 0.006);
  ck_assert(rig.refusals().empty());
}
END_TEST

// How old a pose may be follows.
START_TEST(poses_may_be_older_where_the_delay_is_longer) {
  Measured rig("old");
  rig.fake.on_read = [](FakeDevice& device, double time) { device.state.time = std::fmax(1e-6, time - 0.03); };
  rig.start(protected_options());
  rig.step(200);
  ck_assert_uint_eq(rig.stats().faults, FS_FAULT_DEVICE);  // 22 ms
  rig.link.delay = 0.020;
  rig.step(200);
  ck_assert_uint_eq(rig.stats().faults, 0);  // 40 ms
  rig.link.delay = 0.002;
  rig.step(200);
  ck_assert_uint_eq(rig.stats().faults, FS_FAULT_DEVICE);
}
END_TEST

// The same with threads of their own.
START_TEST(a_servo_thread_follows) {
  Measured rig("thread");
  rig.fake.on_read = [](FakeDevice& device, double) { device.state.pose.position.z = -0.001; };
  rig.device = rig.fake.open(false);
  rig.servo = start_servo(rig.scene.get(), rig.device.get(), fs_servo_options_init());
  for (const double delay : {0.020, 0.002}) {
    {
      const std::lock_guard lock(rig.fake.mutex);
      rig.link.delay = delay;
    }
    const double expected = stats_at(delay).max_stiffness;
    Patience patience;
    while (rig.stats().max_stiffness != expected) ck_assert(patience.lasts());
  }
}
END_TEST

// Clients of the servo's server are told, too, and what they may have follows.
START_TEST(clients_follow) {
  Measured rig("clients");
  rig.fake.on_read = [](FakeDevice& device, double) { device.state.pose.position.z = -0.001; };
  rig.start(protected_options());
  const std::string endpoint = new_endpoint();
  const Server server = start_server(rig.servo.get(), endpoint, fs_server_options_init());
  const Scene client = connect(endpoint, "me");
  fs_object o = fs_object_init("wall", FS_PRIMITIVE_PLANE);
  o.back = attract(5000, 20);
  OK(fs_object_set(client.get(), &o));
  const auto applied = [&] { return report_of(client.get(), "wall").stiffness_applied; };
  for (const double delay : {0.020, 0.002}) {
    rig.link.delay = delay;
    const double most = stats_at(delay).max_stiffness;
    Patience patience;
    do {
      rig.step(200);
      ck_assert(patience.lasts());
    } while (!(applied() <= most && applied() >= 0.5 * most));
    ck_assert_double_eq(stats_of(client.get()).delay, delay);
    ck_assert_double_eq(stats_of(client.get()).link_delay_p50, delay);
  }
  rig.link.loss = -1;
  Patience patience;
  for (fs_event event{}; event.kind != FS_EVENT_DEVICE || event.status != FS_ERROR_INVALID;) {
    rig.step(100);
    ck_assert(patience.lasts());
    OK(fs_scene_next_event(client.get(), 0, &event));
  }
}
END_TEST

int main() {
  Suite* suite = suite_create("measured delay");
  add_case(suite, "follows", {a_hand_leans_while_the_delay_changes, a_delay_that_is_not_told_shakes, the_formula_holds,
                              damping_is_blended, poses_may_be_older_where_the_delay_is_longer, a_servo_thread_follows,
                              clients_follow});
  add_case(suite, "counts", {nonsense_is_refused, nonsense_is_told_seldom, what_is_given_stays, the_longest_of_three_counts});
  return run_suite(suite);
}
