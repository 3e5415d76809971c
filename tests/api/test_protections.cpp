// What keeps the loop stable: the stiffness and damping that it can render, local damping, the slew limit, the energy,
// and the local models that a servo sends to a controller behind a link.
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <thread>
#include <vector>

#include <forceserver/driver.h>

#include "api/support.h"

using namespace scenes;

static constexpr double infinite = std::numeric_limits<double>::infinity();

// Default protections, in virtual time.
static fs_servo_options protected_options() {
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  options.ramp = options.fade = -1;
  return options;
}

// The force is the same everywhere.
static fs_object lift(double force) {
  fs_object o = fs_object_init("lift", FS_PRIMITIVE_PLANE);
  o.front = constant(FS_SENSE_REPULSIVE, force);
  o.back = constant(FS_SENSE_ATTRACTIVE, force);
  return o;
}
static fs_object spring(double stiffness, double limit = 100) {
  fs_object o = fs_object_init("spring", FS_PRIMITIVE_POINT);
  o.front = attract(stiffness, limit);
  return o;
}
static void set(fs_scene* scene, const fs_object& o) { OK(fs_object_set(scene, &o)); }

// What a servo with these options says about a device of this mass (kg), damping (N s/m) and delay (s).
static fs_servo_stats stats_with(double mass, double damping, double delay, const fs_servo_options& options) {
  Rig rig("limits");
  rig.fake.info.mass = mass;
  rig.fake.info.damping = damping;
  rig.fake.info.delay = delay;
  rig.start(options);
  return stats_of(rig.scene.get());
}

START_TEST(the_loop_is_told) {
  fs_servo_options options = protected_options();
  fs_servo_stats stats = stats_with(0.3, 1, 0, options);
  EXPECT_NEAR(stats.max_stiffness, 10814 / 2.0, 1);  // half of what shakes it; the formula gives 6000
  ck_assert_double_eq(stats.damping, 5);
  ck_assert_uint_eq(stats.protections_off, FS_OFF_RAMP | FS_OFF_FADE);
  EXPECT_NEAR(stats_with(1e6, 1, 0, options).max_stiffness, 6000, 1);
  EXPECT_NEAR(stats_with(1e6, 1, 0.002, options).max_stiffness, 1200, 1);
  EXPECT_NEAR(stats_with(1e6, 1, 0.010, options).max_stiffness, 285.7, 0.1);
  options.rate = 500;
  EXPECT_NEAR(stats_with(1e6, 1, 0, options).max_stiffness, 3000, 1);
  // delay replaces the device's.
  options = protected_options();
  options.delay = 0.005;
  EXPECT_NEAR(stats_with(1e6, 1, 0.050, options).max_stiffness, 545.5, 0.1);
  options.delay = 10;
  const fs_servo_stats slow = stats_with(0.3, 1, 0, options);
  ck_assert_double_gt(slow.max_stiffness, 0);
  ck_assert_double_lt(slow.max_stiffness, 0.06);
  // A mass that is not known counts as 0.05 kg.
  options = protected_options();
  ck_assert_double_eq(stats_with(0, 1, 0.01, options).max_stiffness, stats_with(0.05, 1, 0.01, options).max_stiffness);
  ck_assert_double_ne(stats_with(0, 1, 0.01, options).max_stiffness, stats_with(0.3, 1, 0.01, options).max_stiffness);
}
END_TEST

START_TEST(what_is_asked_is_bounded) {
  fs_servo_options options = protected_options();
  options.max_stiffness = 2000;
  ck_assert_double_eq(stats_with(0.3, 1, 0, options).max_stiffness, 2000);
  options.max_stiffness = 50000;
  EXPECT_NEAR(stats_with(0.3, 1, 0, options).max_stiffness, 5407, 1);
  options.max_stiffness = -1;
  fs_servo_stats stats = stats_with(0.3, 1, 0, options);
  ck_assert_double_eq(stats.max_stiffness, infinite);
  const uint32_t rest = FS_OFF_RAMP | FS_OFF_FADE;
  ck_assert_uint_eq(stats.protections_off, rest | FS_OFF_STIFFNESS | FS_OFF_SLEW);  // no slew limit follows from none
  options.slew_limit = 500;
  ck_assert_uint_eq(stats_with(0.3, 1, 0, options).protections_off, rest | FS_OFF_STIFFNESS);

  options = protected_options();
  options.damping = 20;
  ck_assert_double_eq(stats_with(0.3, 1, 0, options).damping, 20);
  options.damping = 1000;
  EXPECT_NEAR(stats_with(0.3, 1, 0, options).damping, 0.7 * 0.3 / 0.0005, 1e-9);
  options.damping = 0;
  EXPECT_NEAR(stats_with(0.05, 1, 0.01, options).damping, 0.7 * 0.05 / 0.0105, 1e-9);  // below 5
  options.damping = -1;
  stats = stats_with(0.3, 1, 0, options);
  ck_assert_double_eq(stats.damping, 0);
  EXPECT_NEAR(stats.max_stiffness, 1000, 1);
  ck_assert_uint_eq(stats.protections_off, rest | FS_OFF_DAMPING);

  // What cannot be rendered, and what would shake, is refused with the reason.
  Rig rig("refused");
  rig.fake.info.mass = 0.3;
  rig.device = rig.fake.open();
  fs_servo* servo = nullptr;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_servo_start(rig.scene.get(), rig.device.get(), &options, &servo),
                  "damping is -1 (none), and the device has no damping of its own");
  options = protected_options();
  options.slew_limit = 1000;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_servo_start(rig.scene.get(), rig.device.get(), &options, &servo),
                  "slew_limit is 1000, must be at least ");
  options.slew_limit = std::atof(std::strstr(fs_last_error(), "at least ") + 9);  // the bound as it is told is taken
  rig.start(options);
  rig.servo.reset();
  options.slew_limit = 1000;
  ck_assert_ptr_null(servo);
  options.max_stiffness = 300;  // needs 900 N/s only
  rig.start(options);
}
END_TEST

START_TEST(damping_takes_energy) {
  for (const double damping : {-1.0, 0.0, 20.0}) {
    Rig rig("damping");
    rig.fake.info.mass = 0.3;
    rig.fake.info.damping = 1;
    rig.fake.on_read = [](FakeDevice& fake, double time) { fake.state.pose.position.y = 0.05 * std::sin(6 * time); };
    fs_servo_options options = protected_options();
    options.damping = damping;
    rig.start(options);
    rig.step(5000);
    const double applied = damping < 0 ? 0 : damping > 0 ? damping : 5;
    // The filter's lag takes a little: the mean of v^2 is (0.05*6)^2/2.
    EXPECT_NEAR(stats_of(rig.scene.get()).energy, -applied * 0.045 * 5, 0.03 * applied * 0.045 * 5);
    ck_assert_uint_eq(stats_of(rig.scene.get()).guarded, 0);
    EXPECT_NEAR(rig.sent().y, -applied * 0.3 * std::cos(30), 0.02 * applied);
  }
}
END_TEST

// A released device without friction is drawn by a spring: whether it swings up.
static bool grows(double stiffness, const fs_servo_options& options) {
  const Scene scene = make_scene();
  const Device device = open_device("sim:?hand=released&friction=0&encoder=ideal&hold=1e-4,0,0");
  set(scene.get(), spring(stiffness));
  const Servo servo = start_servo(scene.get(), device.get(), options);
  const auto largest = [&] {  // m, in the next second
    double most = 0;
    for (int k = 0; k < 1000; ++k) {
      OK(fs_servo_step(servo.get(), 1));
      fs_state state;
      OK(fs_scene_get_hand(scene.get(), &state, nullptr, nullptr));
      most = std::fmax(most, std::fabs(state.pose.position.x));
    }
    return most;
  };
  const double early = largest();
  OK(fs_servo_step(servo.get(), 3000));
  return largest() > early;
}

// The figures from which the limits are worked out are those of the whole loop.
START_TEST(damping_stabilises) {
  fs_servo_options options = protected_options();
  options.max_stiffness = -1;
  options.damping = -1;
  ck_assert(!grows(0.98 * 2001, options));
  ck_assert(grows(1.02 * 2001, options));
  options.damping = 0;
  ck_assert(!grows(0.98 * 10814, options));
  ck_assert(grows(1.02 * 10814, options));
}
END_TEST

// N peak to peak along each axis, of what the simulated device is sent from 3 s on.
static fs_vec3 unrest_along(const std::string& uri, const fs_object& o, double rate) {
  const Scene scene = make_scene();
  const Device device = open_device(uri.c_str());
  OK(fs_object_set(scene.get(), &o));
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  options.rate = rate;
  const Servo servo = start_servo(scene.get(), device.get(), options);
  OK(fs_servo_step(servo.get(), static_cast<uint64_t>(3 * rate)));
  fs_vec3 low{1e9, 1e9, 1e9}, high = -1.0 * low;
  for (int i = 0; i < rate; ++i) {
    OK(fs_servo_step(servo.get(), 1));
    fs_wrench sent;
    OK(fs_scene_get_hand(scene.get(), nullptr, nullptr, &sent));
    low = {std::fmin(low.x, sent.force.x), std::fmin(low.y, sent.force.y), std::fmin(low.z, sent.force.z)};
    high = {std::fmax(high.x, sent.force.x), std::fmax(high.y, sent.force.y), std::fmax(high.z, sent.force.z)};
  }
  return high - low;
}
static double unrest(const std::string& uri, const fs_object& o, double rate) { return norm(unrest_along(uri, o, rate)); }

// Where damping fails: a hand that moves at 5 mm/s sees its speed as pulses, one for each step of an encoder, and a damped object
// makes a force of them, also across the way. The table of lib/servo/README.md.
START_TEST(encoder_steps_are_felt_in_slow_motion) {
  const std::string path = (std::filesystem::temp_directory_path() / ("slow-" + std::to_string(getpid()) + ".path")).string();
  std::ofstream(path) << "0 -0.01 0 0\n1 -0.01 0 0\n5 0.01 0 0\n";
  for (const auto& [damping, hand] : {std::pair{0, "worst"}, {20, "worst"}, {50, "worst"}, {200, "nominal"}, {200, "firm"}}) {
    fs_object honey = fs_object_init("honey", FS_PRIMITIVE_POINT);
    honey.damping = damping;
    honey.front = constant(FS_SENSE_ATTRACTIVE, 1e-6);
    honey.front.limit = 5;
    honey.front.reach = 0.05;
    const std::string uri = "sim:?hand=" + std::string(hand) + "&path=" + path;
    const double felt = unrest_along(uri, honey, 1000).z, exact = unrest_along(uri + "&encoder=ideal", honey, 1000).z;
    std::printf("  %3d N s/m, %s hand at 5 mm/s: %.2f N across the way; with exact encoders %.2g N\n", damping, hand, felt, exact);
    ck_assert_double_lt(exact, 1e-4);
    ck_assert(felt < 0.03 * damping + 0.1);
    ck_assert(felt > 0.01 * damping);
  }
  std::filesystem::remove(path);
}
END_TEST

// Without friction a hand at rest steps to and fro over an edge of its encoders' steps. Neither the damping of an object, nor that
// of a contact, nor the local one may make a force of it that shakes the hand.
START_TEST(encoder_steps_are_not_felt_at_rest) {
  double worst = 0, worst_remote = 0;
  for (const char* hand : {"worst", "nominal&friction=0", "light&friction=0"}) {
    for (const double rate : {500.0, 1000.0, 3000.0, 10000.0}) {
      for (const double damping : {0.0, 5.0, 20.0, 100.0, 200.0}) {
        static int seed = 0;
        if (++seed % times(3, 1) != 0) continue;
        const std::string uri = std::string("sim:?hold=0.005,0.003,0.002&hand=") + hand + "&seed=" + std::to_string(seed);
        fs_object held = spring(300, 10);
        held.damping = damping;
        fs_object floor = fs_object_init("floor", FS_PRIMITIVE_PLANE);
        floor.pose.position.z = 0.004;
        floor.contact = {FS_KEEP_FRONT, 0, 300, 10, damping, 0, {}};
        worst = std::fmax(worst, std::fmax(unrest(uri, held, rate), unrest(uri, floor, rate)));
        if (rate < 3000) worst_remote = std::fmax(worst_remote, unrest(uri + "&link=model", held, rate));
      }
    }
  }
  ck_assert_msg(worst < 0.1, "the force of a hand at rest changes by %g N", worst);
  ck_assert_msg(worst_remote < 0.1, "behind a link the force of a hand at rest changes by %g N", worst_remote);
}
END_TEST

// A hand that moves feels the damping in full: at 3 to 500 mm/s, and in a swing with a top speed of 20 mm/s and more.
START_TEST(damping_is_felt_in_motion) {
  constexpr double step = 20e-6, damping = 100;  // m, N s/m
  const fs_vec3 along = (1 / std::sqrt(14.0)) * fs_vec3{1, 2, 3};
  for (const double rate : {500.0, 1000.0, 10000.0}) {
    for (const double speed : {0.003, 0.02, 0.1, 0.5}) {
      for (const bool is_swing : {false, true}) {
        if (is_swing && speed < 0.02) continue;  // that is a few steps only
        Rig rig("damping");
        rig.fake.info.resolution = step;
        rig.fake.info.rate = rate;
        const double swing = 2 * M_PI * 5;  // rad/s; its top speed is that
        rig.fake.on_read = [&](FakeDevice& f, double time) {
          const fs_vec3 x = (is_swing ? speed / swing * std::sin(swing * time) : speed * (time - 0.5)) * along;
          f.state.pose.position = {step * std::round(x.x / step), step * std::round(x.y / step), step * std::round(x.z / step)};
        };
        fs_servo_options options = virtual_options();
        options.ramp = options.fade = options.speed_limit = -1;
        fs_object honey = fs_object_init("honey", FS_PRIMITIVE_PLANE);
        honey.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_REPULSIVE, 0, 1e-6, 1000);
        honey.damping = damping;
        honey.pose.position.z = -10;
        set(rig.scene.get(), honey);
        rig.start(options);
        rig.step(static_cast<uint64_t>(0.2 * rate));
        double felt = 0, wanted = 0;  // the work of the damping, over 0.6 s
        for (int i = 0; i < 0.6 * rate; ++i) {
          rig.step(1);
          fs_response response;
          OK(fs_scene_get_hand(rig.scene.get(), nullptr, &response, nullptr));
          const double now = is_swing ? speed * std::cos(swing * rig.fake.time) : speed;
          felt += dot(response.wrench.force, along) * now;
          wanted -= damping * now * now;
        }
        const double tolerance = speed < 0.02 ? 0.15 : 0.05;
        ck_assert_msg(std::fabs(felt / wanted - 1) < tolerance, "at %g m/s, %g Hz, %s: %g of the damping is felt", speed, rate,
                      is_swing ? "in a swing" : "straight on", felt / wanted);
      }
    }
  }
}
END_TEST

namespace {

// N s/m: the damping that a tool of `count` points feels as it goes down into a floor with the damping `each`. points: bits of
// those that feel the floor; 0: all.
double damping_felt(size_t count, double each, uint32_t points = 0) {
  constexpr double speed = 0.1;  // m/s
  Rig rig("floor");
  rig.fake.info.mass = 0.3;
  std::vector<fs_vec3> tool;
  for (size_t i = 0; i < count; ++i) tool.push_back({1e-3 * std::cos(i), 1e-3 * std::sin(i), 0});
  OK(fs_scene_set_tool(rig.scene.get(), tool.data(), count));
  fs_object floor = fs_object_init("floor", FS_PRIMITIVE_PLANE);
  floor.contact = {FS_KEEP_FRONT, 0, 1, 1e6, each, 0, {}};  // hardly stiff
  floor.tool_points = points;
  set(rig.scene.get(), floor);
  rig.fake.on_read = [](FakeDevice& fake, double time) {
    fake.state.pose.position.z = 0.02 - speed * time;
    fake.state.twist.linear.z = -speed;
  };
  rig.start(protected_options());
  rig.step(400);
  fs_response felt{};
  OK(fs_scene_get_hand(rig.scene.get(), nullptr, &felt, nullptr));
  return (felt.wrench.force.z - felt.stiffness.zz * (0.02 - speed * rig.fake.time)) / speed;
}

}  // namespace

// A contact damps at each point that can touch it: so often it counts, and no oftener.
START_TEST(damping_counts_by_the_points_that_can_touch) {
  const double all = 0.7 * 0.3 / 0.0005 - 5;  // N s/m, what the loop renders beside the local damping
  EXPECT_NEAR(damping_felt(1, 300), 300, 3);
  EXPECT_NEAR(damping_felt(1, 1000), all, 0.01 * all);
  EXPECT_NEAR(damping_felt(16, 20), 320, 3.2);
  EXPECT_NEAR(damping_felt(16, 300), all, 0.01 * all);
  EXPECT_NEAR(damping_felt(16, 300, 1), 300, 3);
}
END_TEST

START_TEST(slew_spreads_a_step) {
  Rig rig("slew");
  fs_servo_options options = protected_options();
  options.max_stiffness = options.damping = -1;
  options.slew_limit = 100;  // 0.1 N in a tick
  rig.start(options);
  rig.step(5);
  set(rig.scene.get(), lift(2));
  for (int k = 1; k <= 25; ++k) {
    rig.step(1);
    EXPECT_NEAR(rig.sent().z, std::fmin(2, 0.1 * k), 1e-9);
  }
  const uint64_t guarded = stats_of(rig.scene.get()).guarded;
  ck_assert_uint_ge(guarded, 19);
  ck_assert_uint_le(guarded, 20);
  rig.fake.state.flags = 0;  // a fault does not wait for the limit
  rig.step(1);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  rig.fake.state.flags = FS_STATE_READY;
  rig.step(1);
  EXPECT_NEAR(rig.sent().z, 0.1, 1e-9);
  OK(fs_servo_set_enabled(rig.servo.get(), false));
  rig.step(1);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
}
END_TEST

// With all protections off, what the scene gives is what is sent.
START_TEST(off_is_off) {
  Rig rig("off");
  fill(rig.scene.get(), profiles());
  rig.fake.info.force_max = 1e6;
  rig.fake.info.torque_max = 1e6;
  Random random(9);
  rig.fake.on_read = [&](FakeDevice& fake, double) { fake.state.pose = random.pose(0.05); };
  fs_servo_options options = protected_options();
  options.slew_limit = options.damping = options.max_stiffness = options.speed_limit = options.blend = -1;
  rig.start(options);
  ck_assert_uint_eq(stats_of(rig.scene.get()).protections_off, 127);
  for (int k = 0; k < 2000; ++k) {
    rig.step(1);
    fs_tick tick;
    size_t count = 0;
    OK(fs_servo_get_record(rig.servo.get(), &tick, 1, &count));
    ck_assert_int_eq(std::memcmp(&tick.response.wrench, &tick.sent, sizeof tick.sent), 0);
  }
  ck_assert_uint_eq(stats_of(rig.scene.get()).guarded, 0);
}
END_TEST

// ---------------------------------------------------------------------------------------------------- local models

namespace {

// A device with a controller behind a link, which only keeps what it gets.
struct Remote {
  FakeDevice fake{"remote"};
  fs_model model{};
  uint64_t models = 0;
  double measured_delay = 0;  // s; 0: none

  Remote() {
    fake.info.torque_axes = 0;
    fake.info.mass = 0.3;
    fake.info.damping = 1;
    fake.info.delay = 0.010;
    fake.info.link_rate = 100;
    fake.info.controller_rate = 2000;
    fake.info.controller_damping = 5;
    fake.state.pose.orientation.w = 1;
    fake.on_model = [this](FakeDevice&, const fs_model& written) {
      ck_assert(written.struct_size == sizeof written && written.reserved == 0);
      model = written;
      ++models;
      return FS_OK;
    };
    fake.on_link = [this](FakeDevice&, fs_link& out) {
      out.delay = measured_delay;
      return measured_delay > 0 ? FS_OK : FS_ERROR_UNSUPPORTED;
    };
  }
};

double entry(const fs_mat3& m, int i, int k) {
  const double all[]{m.xx, m.xy, m.xz, m.yx, m.yy, m.yz, m.zx, m.zy, m.zz};
  return all[3 * i + k];
}
void expect_matrix(const fs_mat3& m, const fs_mat3& expected, double tolerance) {
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(entry(m, i, k), entry(expected, i, k), tolerance);
  }
}

}  // namespace

START_TEST(models_are_written) {
  Remote remote;
  const Scene scene = make_scene();
  const Device device = remote.fake.open();
  set(scene.get(), spring(300));
  fs_servo_options options = protected_options();
  options.speed_limit = -1;  // this hand jumps
  options.slew_limit = 1e9;
  Servo servo = start_servo(scene.get(), device.get(), options);
  remote.fake.state.pose.position = {0.01, 0, -0.005};
  OK(fs_servo_step(servo.get(), 3));
  ck_assert_uint_eq(remote.models, 3);
  ck_assert_uint_eq(remote.fake.writes, 0);
  ck_assert_uint_eq(remote.model.number, 3);
  EXPECT_NEAR(remote.model.time, 0.003, 1e-12);
  EXPECT_NEAR(remote.model.hold, 0.1, 0);
  EXPECT_VECTOR(remote.model.x0.position, remote.fake.state.pose.position, 0);
  EXPECT_VECTOR(remote.model.f0.force, (fs_vec3{-3, 0, 1.5}), 1e-9);  // the controller damps, not the servo
  expect_matrix(remote.model.dfdx, {-300, 0, 0, 0, -300, 0, 0, 0, -300}, 1e-6);
  const fs_servo_stats stats = stats_of(scene.get());
  ck_assert_double_eq(stats.damping, 5);
  const double bound = 2.5 * 6 / 0.02;
  EXPECT_NEAR(stats.max_stiffness, bound, 1e-9);
  // The norm of the model is bounded.
  set(scene.get(), spring(2000));
  remote.fake.state.pose.position = {0.001, 0, 0};
  OK(fs_servo_step(servo.get(), 100));  // what changes is blended
  for (int i = 0; i < 3; ++i) ck_assert_double_le(std::fabs(entry(remote.model.dfdx, i, i)), bound * (1 + 1e-12));
  // Where the force is limited, the model only turns it: 20 N along x become 10.
  remote.fake.state.pose.position = {0.01, 0, 0};
  set(scene.get(), spring(700));
  fs_object more = lift(13);
  OK(fs_pose_from_z({0, 0, 0}, {-1, 0, 0}, &more.pose));
  set(scene.get(), more);
  OK(fs_servo_step(servo.get(), 100));
  EXPECT_VECTOR(remote.model.f0.force, (fs_vec3{-10, 0, 0}), 1e-9);
  expect_matrix(remote.model.dfdx, {0, 0, 0, 0, -350, 0, 0, 0, -350}, 1e-6);
  // Lost and back.
  remote.fake.read_status = FS_ERROR_DISCONNECTED;
  fs_servo_step(servo.get(), 1);
  EXPECT_VECTOR(remote.model.f0.force, (fs_vec3{}), 0);
  expect_matrix(remote.model.dfdx, {}, 0);
  EXPECT_NEAR(remote.model.x0.orientation.w, 1, 0);
  ck_assert(remote.model.number == 0 && remote.model.time == 0);  // it answers no state
  remote.fake.read_status = FS_OK;
  OK(fs_servo_step(servo.get(), 1));
  EXPECT_VECTOR(remote.model.f0.force, (fs_vec3{-10, 0, 0}), 1e-9);
  remote.fake.state.pose.position.x = NAN;
  fs_servo_step(servo.get(), 1);
  EXPECT_VECTOR(remote.model.f0.force, (fs_vec3{}), 0);
  expect_matrix(remote.model.dfdx, {}, 0);
  ck_assert(stats_of(scene.get()).faults & FS_FAULT_NUMBER);
  OK(fs_servo_set_enabled(servo.get(), false));
  OK(fs_servo_step(servo.get(), 1));
  servo.reset();  // ends with a plain 0
  ck_assert_uint_gt(remote.fake.writes, 0);
  EXPECT_VECTOR(remote.fake.written.force, (fs_vec3{}), 0);
}
END_TEST

// The norm of the model is bounded for the delay that the driver measures; another bound comes in even steps.
START_TEST(models_follow_the_delay) {
  Remote remote;
  const Scene scene = make_scene();
  const Device device = remote.fake.open();
  fs_servo_options options = protected_options();
  options.max_stiffness = -1;
  const Servo servo = start_servo(scene.get(), device.get(), options);
  set(scene.get(), spring(2000));
  remote.fake.state.pose.position = {0.001, 0, 0};
  const auto size = [&] { return -remote.model.dfdx.xx; };
  OK(fs_servo_step(servo.get(), 100));
  EXPECT_NEAR(size(), 2.5 * 6 / 0.02, 1e-9);
  for (const double delay : {0.050, 0.010}) {
    remote.measured_delay = delay;
    const double before = size(), after = 2.5 * 6 / (delay + 0.01);
    for (int k = 0; k < 200; ++k) {
      const double last = size();
      OK(fs_servo_step(servo.get(), 1));
      ck_assert_double_le(std::fabs(size() - last), 1.001 * std::fabs(after - before) / 20);
    }
    EXPECT_NEAR(size(), after, 1e-9);
  }
}
END_TEST

START_TEST(without_a_controller_forces_are_written) {
  Remote remote;
  for (const bool takes_models : {false, true}) {
    if (takes_models) remote.fake.info.controller_rate = 0;
    const Scene scene = make_scene();
    const Device device = open_device(takes_models ? "fakemodel:remote" : "fake:remote");
    set(scene.get(), spring(300));
    remote.fake.state.pose.position = {0.01, 0, 0};
    const Servo servo = start_servo(scene.get(), device.get(), protected_options());
    OK(fs_servo_step(servo.get(), 20));  // the slew limit of such a poor loop is low
    ck_assert_uint_eq(remote.models, 0);
    // 300 N/m are more than such a loop can render.
    EXPECT_VECTOR(remote.fake.written.force, (fs_vec3{-0.01 * stats_of(scene.get()).max_stiffness, 0, 0}), 1e-9);
    fs_device_info info = fs_device_info_init();
    OK(fs_device_get_info(device.get(), &info));
    ck_assert_double_eq(info.controller_rate, 0);
    // The pose comes only 100 times a second: that is the period of the loop.
    EXPECT_NEAR(stats_of(scene.get()).max_stiffness, 165, 0.1);  // half of what shakes it; the formula gives 200
  }
}
END_TEST

START_TEST(bad_infos) {
  Remote remote;
  const struct {
    const char* field;
    double fs_device_info::*member;
    double value;
  } cases[]{{"link_rate", &fs_device_info::link_rate, -1},
            {"link_rate", &fs_device_info::link_rate, NAN},
            {"controller_rate", &fs_device_info::controller_rate, 99},
            {"controller_rate", &fs_device_info::controller_rate, infinite},
            {"controller_delay", &fs_device_info::controller_delay, 11},
            {"controller_damping", &fs_device_info::controller_damping, -5},
            {"watchdog", &fs_device_info::watchdog, -2},
            {"watchdog", &fs_device_info::watchdog, 11}};
  for (const auto& c : cases) {
    const fs_device_info good = remote.fake.info;
    remote.fake.info.*c.member = c.value;
    fs_device* device = nullptr;
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_device_open("fakemodel:remote", &device), c.field);
    remote.fake.info = good;
  }
}
END_TEST

// ------------------------------------------------------------------------------------------- bounds of what is rendered

namespace {

double applied(fs_scene* scene, const std::string& name) { return report_of(scene, name.c_str()).stiffness_applied; }

fs_object wall(const char* name, double stiffness, double limit, double z = 0) {
  return fs_wall_init(name, {0, 0, z}, {0, 0, 1}, stiffness, limit);
}
fs_object hazard(int number, fs_vec3 place, double force, double width, double reach) {
  fs_object o = fs_object_init(("hazard " + std::to_string(number)).c_str(), FS_PRIMITIVE_POINT);
  o.pose.position = place;
  o.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, force, width, force);
  o.front.reach = reach;
  return o;
}

// The default simulator and servo; the hand is drawn to 30 mm below the surface of a wall at 0.
struct Simulated {
  Scene scene = make_scene();
  Device device = open_device("sim:?hold=0,0,-0.03");
  Servo servo;
  void run(uint64_t ticks) {
    fs_servo_options options = fs_servo_options_init();
    options.mode = FS_SERVO_VIRTUAL;
    if (!servo) servo = start_servo(scene.get(), device.get(), options);
    OK(fs_servo_step(servo.get(), ticks));
  }
};

// N/m, what is left of a wall of `stiffness` beside these.
double wall_beside(const std::vector<fs_object>& others, double stiffness = 200) {
  Simulated s;
  set(s.scene.get(), wall("wall", stiffness, 8));
  for (const fs_object& o : others) set(s.scene.get(), o);
  s.run(4000);
  return applied(s.scene.get(), "wall");
}

std::vector<fs_object> ring(int count, double reach) {  // of 2 N, 80 mm about the middle of the workspace
  std::vector<fs_object> out;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * 3.14159265358979 * i / count;
    out.push_back(hazard(i, {0.08 * std::cos(angle), 0.08 * std::sin(angle), 0}, 2, 0.015, reach));
  }
  return out;
}

}  // namespace

START_TEST(little_wants_are_met_first) {
  std::vector<fs_object> points;
  for (int i = 0; i < 10; ++i) points.push_back(hazard(i, {0.03, 0, 0}, 1e-3, 0.02, 0.08));
  std::vector<fs_object> beyond;
  for (int i = 0; i < 40; ++i) beyond.push_back(hazard(i, {1e-3 * (i % 10), 0.12, 1e-3 * (i / 10)}, 2, 0.015, 0));
  const struct {
    const char* beside;
    double slope;
  } rows[]{{"nothing", wall_beside({})},
           {"ten points of 1 mN", wall_beside(points)},
           {"ten hazards of 2 N on a ring of 80 mm", wall_beside(ring(10, 0.045))},
           {"the same without an end of their reach", wall_beside(ring(10, 0))},
           {"forty of them", wall_beside(ring(40, 0.045))},
           {"forty Gaussian points of 2 N beyond its reach", wall_beside(beyond)}};
  for (const auto& row : rows) {
    std::printf("  a wall of 200 N/m beside %s: %.1f\n", row.beside, row.slope);
    ck_assert_msg(row.slope >= 199, "beside %s a wall gets %g of 200 N/m", row.beside, row.slope);
  }
}
END_TEST

// A jump of a little force needs no steep slope.
START_TEST(little_jumps_want_little) {
  std::vector<fs_object> points;
  for (int i = 0; i < 10; ++i) points.push_back(hazard(i, {0.01, 0, 0}, 1e-3, 0.02, 0.08));
  const double slope = wall_beside(points, 4000);
  ck_assert_msg(slope >= 3990, "beside ten points of 1 mN a wall gets %g of 4000 N/m", slope);
}
END_TEST

// "As stiff as can be" takes what others leave.
START_TEST(as_stiff_as_can_be_takes_what_is_left) {
  for (const size_t count : {1, 2, 6, 16}) {
    Simulated s;
    std::vector<fs_vec3> points;
    for (size_t i = 0; i < count; ++i) points.push_back({1e-3 * std::cos(i), 1e-3 * std::sin(i), 0});
    OK(fs_scene_set_tool(s.scene.get(), points.data(), count));
    for (const char* const name : {"first", "second"}) {
      fs_object o = fs_object_init(name, FS_PRIMITIVE_PLANE);
      o.contact.keep = FS_KEEP_FRONT;
      o.contact.limit = 20;
      if (name[0] == 'f') o.contact.stiffness = 60;
      if (name[0] == 's') o.pose.position.z = -0.01;
      set(s.scene.get(), o);
    }
    s.run(3000);
    const double first = applied(s.scene.get(), "first"), second = applied(s.scene.get(), "second");
    const double all = stats_of(s.scene.get()).max_stiffness;
    std::printf("  a tool of %zu points: %.1f of 60 N/m a point, and %.1f\n", count, first, second);
    ck_assert_double_ge(first, 59);
    EXPECT_NEAR(static_cast<double>(count) * (first + second), all, 1e-6 * all);
  }
}
END_TEST

START_TEST(equal_wants_get_equal_bounds) {
  Simulated s;
  constexpr int count = 20;
  for (int i = 0; i < count; ++i) {  // the hand is in all of them
    fs_object o = wall(("wall " + std::to_string(i)).c_str(), 1000, 20);
    const double angle = 2 * 3.14159265358979 * i / count;
    OK(fs_pose_from_z({0, 0, 0}, {0.2 * std::cos(angle), 0.2 * std::sin(angle), 1}, &o.pose));
    set(s.scene.get(), o);
  }
  s.run(3000);
  const double all = stats_of(s.scene.get()).max_stiffness;
  for (int i = 0; i < count; ++i) EXPECT_NEAR(applied(s.scene.get(), "wall " + std::to_string(i)), all / count, 1e-6 * all);
}
END_TEST

namespace {

// A hand that goes where it likes, but no faster than it can.
struct Wandering {
  static constexpr double period = 1e-3, fastest = 1.9, hardest = 50;  // s, m/s, m/s2
  Rig rig{"wandering"};
  fs_vec3 x{}, v{};

  void start(double radius, double height, const fs_servo_options& options = protected_options()) {
    rig.fake.info.mass = 0.3;
    rig.fake.info.workspace_radius = radius;
    rig.fake.info.workspace_height = height;
    rig.fake.on_read = [this](FakeDevice& fake, double) {
      fake.state.pose.position = x;
      fake.state.twist.linear = v;
    };
    rig.start(options);
  }
  void go_to(fs_vec3 goal, int ticks) {  // as fast as it can, so that it stops there
    for (; ticks > 0; --ticks) {
      const fs_vec3 way = goal - x;
      const double far = norm(way);
      const fs_vec3 wanted = far > 1e-6 ? (std::fmin(fastest, std::sqrt(hardest * far)) / far) * way : fs_vec3{};
      const fs_vec3 change = wanted - v;
      const double most = hardest * period;
      v = v + (norm(change) > most ? most / norm(change) : 1) * change;
      x = x + period * v;
      rig.step(1);
      look();
    }
  }
  // The largest slope of the force where the hand is: the norm of the matrix, as power iteration finds it.
  double slope() const {
    fs_response r{};
    OK(fs_scene_get_hand(rig.scene.get(), nullptr, &r, nullptr));
    const fs_mat3& m = r.stiffness;
    fs_vec3 u{0.48, 0.6, 0.64};
    double size = 0;
    for (int i = 0; i < 30; ++i) {
      u = {m.xx * u.x + m.xy * u.y + m.xz * u.z, m.yx * u.x + m.yy * u.y + m.yz * u.z, m.zx * u.x + m.zy * u.y + m.zz * u.z};
      size = norm(u);
      if (!(size > 0)) return 0;
      u = (1 / size) * u;
    }
    return size;
  }
  double most = 0;  // N/m
  void look() { most = std::fmax(most, slope()); }
};

}  // namespace

// What the hand cannot reach for now does not count, and counts before the hand is there, however fast it comes. What it has left
// counts for a second, and is given back in another.
START_TEST(out_of_reach_is_out_of_mind) {
  enum { points, planes, points_without_an_end, kind_count };
  for (int kind = 0; kind < kind_count; ++kind) {
    Wandering s;
    for (int i = 0; i < 8; ++i) {
      fs_object o = fs_object_init(("far " + std::to_string(i)).c_str(), kind == planes ? FS_PRIMITIVE_PLANE : FS_PRIMITIVE_POINT);
      OK(fs_pose_from_z({0.3 + 1e-4 * i, 0, 0}, {-1, 0, 0}, &o.pose));
      o.front = attract(4000, 2);
      if (kind != points_without_an_end) o.front.reach = 0.02;
      set(s.rig.scene.get(), o);
    }
    set(s.rig.scene.get(), wall("wall", 4000, 20));
    s.start(0.4, 0.4);
    const double all = stats_of(s.rig.scene.get()).max_stiffness;
    const auto of_wall = [&] { return applied(s.rig.scene.get(), "wall"); };
    s.go_to({0, 0, 0}, 300);
    ck_assert_msg(of_wall() > 3999, "far from objects of kind %d the wall gets %g N/m", kind, of_wall());
    s.most = 0;
    s.go_to({0.3, 0, -1e-3}, 500);
    ck_assert_msg(of_wall() <= all / 8, "amid objects of kind %d the wall gets %g N/m of %g", kind, of_wall(), all);
    ck_assert_msg(s.most > 0.5 * all && s.most <= all * (1 + 1e-6), "kind %d: a slope of %g N/m, %g are rendered", kind, s.most, all);
    for (int i = 1; i <= 10; ++i) {
      s.go_to({0, 0, -1e-3}, 100);
      set(s.rig.scene.get(), hazard(0, {0, 0, 0}, 1e-5 * i, 0.1, 0));  // that something else changes makes no difference
    }
    ck_assert_msg(of_wall() <= all / 8, "kind %d: 1 s after the hand set off the wall gets %g N/m", kind, of_wall());
    s.go_to({0, 0, -1e-3}, 1500);
    ck_assert_msg(of_wall() > 3999, "kind %d: what the hand has left still counts, the wall %g N/m", kind, of_wall());
  }
}
END_TEST

// Without a speed limit all that the hand could reach counts, also after the clutch has put the device's workspace elsewhere.
START_TEST(the_clutch_moves_the_workspace) {
  Wandering s;
  fs_servo_options options = protected_options();
  options.speed_limit = -1;
  options.max_stiffness = 2000;
  s.start(0.1, 0.2, options);
  fs_scene* const scene = s.rig.scene.get();
  s.go_to({0, 0, 0}, 100);
  OK(fs_scene_set_clutch(scene, true));
  s.go_to({-0.09, 0, 0}, 500);
  OK(fs_scene_set_clutch(scene, false));
  s.go_to({-0.09, 0, 0}, 500);  // the workspace reaches to 0.19 m of the scene
  for (const char* name : {"one", "other"}) {
    fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
    o.pose.position = {0.16, 0, 0};
    o.front = attract(2000, 2);
    o.front.reach = 0.01;
    set(scene, o);
  }
  s.go_to({-0.09, 0, 0}, 500);
  ck_assert_double_le(applied(scene, "one"), 1000 * (1 + 1e-6));
}
END_TEST

// What is disabled shares until it has faded out.
START_TEST(what_fades_out_shares) {
  Wandering s;
  fs_object other = wall("other", 4000, 20);
  for (const fs_object& o : {wall("wall", 4000, 20), other}) set(s.rig.scene.get(), o);
  fs_servo_options options = protected_options();
  options.fade = 1;
  s.start(0.4, 0.4, options);
  const double all = stats_of(s.rig.scene.get()).max_stiffness;
  s.go_to({0, 0, -1e-3}, 1500);
  EXPECT_NEAR(applied(s.rig.scene.get(), "wall"), all / 2, 1e-6 * all);
  other.enabled = false;
  set(s.rig.scene.get(), other);
  s.go_to({0, 0, -1e-3}, 800);
  EXPECT_NEAR(applied(s.rig.scene.get(), "wall"), all / 2, 1e-6 * all);
  s.go_to({0, 0, -1e-3}, 500);
  EXPECT_NEAR(applied(s.rig.scene.get(), "wall"), 4000, 1e-6 * all);
  ck_assert_double_le(s.most, all * (1 + 1e-6));
}
END_TEST

// What an object gives up for another one it gets back in full, however little that was.
START_TEST(a_bound_is_given_back_in_full) {
  Wandering s;
  fs_object small = wall("small", 60, 4);
  fs_servo_options options = protected_options();
  options.max_stiffness = 1000;
  for (const fs_object& o : {wall("wall", 1000, 4), small}) set(s.rig.scene.get(), o);
  s.start(0.4, 0.4, options);
  s.go_to({0, 0, -1e-3}, 3000);
  EXPECT_NEAR(applied(s.rig.scene.get(), "wall"), 940, 1e-3);
  OK(fs_object_remove(s.rig.scene.get(), "small"));
  s.go_to({0, 0, -1e-3}, 4000);
  EXPECT_NEAR(applied(s.rig.scene.get(), "wall"), 1000, 1e-3);
  ck_assert_double_le(s.most, 1000 * (1 + 1e-6));
}
END_TEST

// What is given back to a wall that the hand leans on comes as a slow change of the force, not as a push.
START_TEST(a_bound_rises_slowly) {
  Wandering s;
  fs_servo_options options = protected_options();
  options.max_stiffness = 1000;
  for (const fs_object& o : {wall("wall", 1000, 40), wall("below", 1000, 40, -0.02)}) set(s.rig.scene.get(), o);
  s.start(0.4, 0.4, options);
  s.go_to({0, 0, -5e-3}, 1500);
  const auto force = [&] {
    fs_response r{};
    OK(fs_scene_get_hand(s.rig.scene.get(), nullptr, &r, nullptr));
    return r.wrench.force.z;
  };
  EXPECT_NEAR(force(), 2.5, 1e-3);
  OK(fs_object_remove(s.rig.scene.get(), "below"));
  double greatest = 0;
  for (int i = 0; i < 20; ++i) {
    const double before = force();
    s.go_to({0, 0, -5e-3}, 50);
    greatest = std::fmax(greatest, force() / before);
  }
  EXPECT_NEAR(force(), 5, 1e-3);
  std::printf("  a wall that gets twice as much grows by %.0f %% in 50 ms at most\n", 100 * (greatest - 1));
  ck_assert_double_le(greatest, 1.3);
}
END_TEST

// The bounds of many are entered in portions, between which others change the scene.
START_TEST(many_share_while_others_change_the_scene) {
  Wandering s;
  fs_scene* const scene = s.rig.scene.get();
  constexpr int count = 600;
  const auto set_wall = [&](int number, double stiffness) { set(scene, wall(("wall " + std::to_string(number)).c_str(), stiffness, 20)); };
  for (int i = 0; i < count; ++i) set_wall(i, 1000);
  set(scene, hazard(0, {0, 0, 90}, 1, 0.01, 0.1));
  s.start(0.4, 0.4);
  const double all = stats_of(scene).max_stiffness;
  double most = 0;
  std::atomic<bool> ends{false};
  std::thread other([&] {
    for (int i = 0; !ends; ++i) {
      const fs_pose pose{{1e-3 * (i % 100), 0, 90}, {1, 0, 0, 0}};
      OK(fs_object_move(scene, "hazard 0", &pose, nullptr, FS_NOW));
    }
  });
  Random random(1);
  for (int round = 0; round < (is_sanitized ? 2 : times(4, 20)); ++round) {
    const int first = static_cast<int>(random.below(3));
    for (int i = first; i < count; i += 3) set_wall(i, random.coin() ? 1000 : random.log_between(0.01, 1000));
    s.go_to({0, 0, -2e-3}, 60);  // what is set has the bound of an object alone until then
    s.most = 0;
    s.go_to({0, 0, -1e-3 * static_cast<double>(random.below(5))}, 400);
    most = std::fmax(most, s.most / all);
    ck_assert_msg(most <= 1 + 1e-6, "a slope of %g of what is rendered", most);
  }
  ends = true;
  other.join();
  for (int i = 0; i < count; ++i) set_wall(i, 1000);
  s.go_to({0, 0, -2e-3}, 3000);
  double sum = 0;
  for (int i = 0; i < count; ++i) sum += applied(scene, "wall " + std::to_string(i));
  std::printf("  %d walls: at most %.3f, in the end %.3f of what is rendered\n", count, most, sum / all);
  EXPECT_NEAR(sum, all, 1e-6 * all);
}
END_TEST

// A large ball touches walls that are far from the hand.
START_TEST(walls_that_a_ball_touches_share) {
  Wandering s;
  constexpr int count = 20;
  OK(fs_scene_set_tool_radius(s.rig.scene.get(), 0.31));
  for (int i = 0; i < count; ++i) set(s.rig.scene.get(), wall(("wall " + std::to_string(i)).c_str(), 1000, 20, -0.3));
  s.start(0.4, 0.4);
  s.go_to({}, 3000);
  const double all = stats_of(s.rig.scene.get()).max_stiffness;
  for (int i = 0; i < count; ++i) {
    EXPECT_NEAR(applied(s.rig.scene.get(), "wall " + std::to_string(i)), all / count, 1e-6 * all);
  }
}
END_TEST

// At whatever place of whatever scene the hand is, the slopes of all that it feels there add up to no more than is rendered.
START_TEST(slopes_add_up_to_no_more) {
  const int count = is_sanitized ? 5 : times(20, 150);
  double most = 0;
  for (int seed = 0; seed < count; ++seed) {
    Random random(static_cast<uint64_t>(seed) + 1);
    Wandering s;
    const double size = random.log_between(0.02, 0.3);
    const uint64_t objects = 1 + random.below(random.coin(0.2) ? 100 : 12);
    for (uint64_t i = 0; i < objects; ++i) {
      const bool is_plane = random.coin(0.3);
      fs_object o = fs_object_init(("o" + std::to_string(i)).c_str(), is_plane ? FS_PRIMITIVE_PLANE : FS_PRIMITIVE_POINT);
      o.pose = random.pose(size);
      const auto kind = static_cast<fs_profile_kind>(1 + random.below(6));
      const double limit = random.log_between(1e-3, 20), stiffness = random.log_between(50, 20000), reach = random.log_between(0.1, 1) * size;
      const fs_sense sense = random.coin() ? FS_SENSE_ATTRACTIVE : FS_SENSE_REPULSIVE;
      double gain = limit, offset = 0;
      if (kind == FS_PROFILE_LINEAR_INCREASING) gain = stiffness;
      if (kind == FS_PROFILE_LINEAR_DECREASING) gain = -stiffness, offset = stiffness * reach;
      if (kind == FS_PROFILE_GAUSSIAN) offset = random.log_between(0.02, 1) * size;
      if (kind == FS_PROFILE_QUADRATIC) gain = stiffness / reach;
      if (kind == FS_PROFILE_INVERSE) gain = limit * reach;
      o.front = fs_profile_init(kind, sense, gain, offset, limit);
      if (random.coin()) o.front.reach = reach;
      if (is_plane && random.coin()) std::swap(o.front, o.back);
      if (is_plane && random.coin(0.3)) {
        o.contact.keep = FS_KEEP_FRONT;
        o.contact.stiffness = random.coin() ? 0 : stiffness;
        o.contact.limit = limit;
        if (random.coin()) o.front = o.back = fs_profile{};
      }
      set(s.rig.scene.get(), o);
    }
    s.start(2 * size, 2 * size);
    const double all = stats_of(s.rig.scene.get()).max_stiffness;
    for (int k = 0; k < 10; ++k) s.go_to(random.in_box(size), 100);
    most = std::fmax(most, s.most / all);
    ck_assert_msg(s.most <= all * (1 + 1e-6), "seed %d: a slope of %g N/m, %g are rendered", seed, s.most, all);
  }
  std::printf("  %d scenes, %d places: at most %.3f of what is rendered\n", count, 1000 * count, most);
}
END_TEST

int main() {
  Suite* suite = suite_create("protections");
  add_case(suite, "loop", {the_loop_is_told, what_is_asked_is_bounded});
  add_case(suite, "guard", {damping_takes_energy, damping_stabilises, encoder_steps_are_not_felt_at_rest,
                            encoder_steps_are_felt_in_slow_motion,
                            damping_is_felt_in_motion, damping_counts_by_the_points_that_can_touch, slew_spreads_a_step, off_is_off});
  add_case(suite, "model", {models_are_written, models_follow_the_delay, without_a_controller_forces_are_written, bad_infos});
  add_case(suite, "shares", {little_wants_are_met_first, little_jumps_want_little, as_stiff_as_can_be_takes_what_is_left,
                             equal_wants_get_equal_bounds, out_of_reach_is_out_of_mind, the_clutch_moves_the_workspace, what_fades_out_shares,
                             a_bound_is_given_back_in_full, a_bound_rises_slowly,
                             many_share_while_others_change_the_scene, walls_that_a_ball_touches_share, slopes_add_up_to_no_more});
  return run_suite(suite);
}
