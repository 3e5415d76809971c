// What is felt for a moment when a surface is hit: the closed form, when it comes, and within which bounds a servo gives it.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>

#include "scenes/folder.h"
#include "api/hand.h"

using namespace scenes;

namespace {

fs_surface_settings ringing(double gain, double frequency, double decay) {
  fs_surface_settings out = fs_surface_settings_init();
  out.impact_gain = gain;
  out.impact_frequency = frequency;
  out.impact_decay = decay;
  return out;
}

// All protections but the ramp, the damping and the limit of the speed: so that only the impact is felt.
fs_servo_options protected_options() {
  fs_servo_options out = fs_servo_options_init();
  out.mode = FS_SERVO_VIRTUAL;
  out.rate = 1000;
  out.ramp = out.speed_limit = out.damping = -1;
  return out;
}

double turn(double frequency) { return 2 * std::numbers::pi * frequency; }

// A hand above a table so soft that only its impact is felt.
struct Table : Hand {
  Surface surface;
  fs_object object = fs_object_init("table", FS_PRIMITIVE_PLANE);

  explicit Table(const fs_surface_settings& settings = ringing(10, 50, 40), double limit = 1000) : surface(make_surface(settings)) {
    object.surface = surface.get();
    put(object, solid(FS_KEEP_FRONT, 1e-6, limit));
  }
  // From a height to just below the surface, m/s: the force along z of each tick from the contact on.
  std::vector<double> hit(double speed, int ticks = 100, double height = 0.02) {
    slide({0, 0, height});
    wait(60);
    for (double z = height; z > -1e-9; z -= speed * dt) go({0, 0, z});
    return ring(speed, ticks);
  }
  std::vector<double> ring(double speed, int ticks) {
    std::vector<double> out{go({0, 0, x.z - speed * dt}).z};
    while (static_cast<int>(out.size()) < ticks) out.push_back(go(x).z);
    return out;
  }
  void wait(int ticks) {
    for (int i = 0; i < ticks; ++i) go(x);
  }
};

double peak(const std::vector<double>& forces) {
  double out = 0;
  for (const double force : forces) out = std::max(out, std::fabs(force));
  return out;
}

// ---------------------------------------------------------------------------------------------------------------- tools

START_TEST(it_is_a_damped_sine) {
  for (const double speed : {0.03, 0.2, 1.5}) {
    Table table;
    const std::vector<double> forces = table.hit(speed);
    for (size_t i = 0; i < forces.size(); ++i) {
      const double t = i * dt;
      EXPECT_NEAR(forces[i], 10 * speed * std::exp(-40 * t) * std::sin(turn(50) * t), 1e-5);
    }
  }
}
END_TEST

START_TEST(only_what_comes_fast_enough_strikes) {
  ck_assert_double_lt(peak(Table().hit(0.0195)), 1e-6);
  ck_assert_double_gt(peak(Table().hit(0.0205)), 0.1);
  // The object's own way counts: it comes towards a hand at rest.
  Table table;
  table.slide({0, 0, 0.005});
  table.object.twist.linear = {0, 0, 0.1};
  table.object.time = table.time;
  OK(fs_object_set(table.scene.get(), &table.object));
  double most = 0;
  for (int i = 0; i < 150; ++i) most = std::max(most, table.go(table.x).z);
  EXPECT_NEAR(most, 10 * 0.1 * std::exp(-40 * 0.005), 0.03);
  // A way along the surface does not.
  Table along;
  along.slide({0, 0, 1e-5});
  along.wait(60);
  for (int i = 0; i < 200; ++i) ck_assert_double_lt(std::fabs(along.go({0.001 * i, 0, 1e-5 - 1e-6 * i}).z), 1e-6);
}
END_TEST

START_TEST(it_strikes_again_only_from_freedom) {
  const auto again = [](double height, int ticks) {
    Table table;
    table.hit(0.2, 400);
    table.slide({0, 0, height}, 1);
    table.wait(ticks);
    table.slide({0, 0, -1e-6}, 5e-5);  // 0.05 m/s
    return peak(table.ring(0, 60)) > 0.1;
  };
  ck_assert(again(2e-3, 30));    // with the way back it has been free for 70 ms
  ck_assert(!again(2e-3, 5));    // for 45 ms
  ck_assert(!again(0.9e-3, 500));
  ck_assert(again(1.2e-3, 200));
  // What is set where the hand is, or replaces what it touches, gives none.
  Table table;
  table.hit(0.2, 400);
  const Surface other = make_surface(ringing(20, 50, 40));
  table.object.surface = other.get();
  OK(fs_object_set(table.scene.get(), &table.object));
  for (int i = 0; i < 100; ++i) ck_assert_double_lt(std::fabs(table.go({0, 0, table.x.z - 5e-5}).z), 1e-3);
  fs_object lid = table.object;
  std::strcpy(lid.name, "lid");
  OK(fs_object_set(table.scene.get(), &lid));
  for (int i = 0; i < 100; ++i) ck_assert_double_lt(std::fabs(table.go({0, 0, table.x.z - 5e-5}).z), 1e-3);
}
END_TEST

// It goes on where the hand leaves, and the force of the whole object stays within its limit.
START_TEST(it_decays_in_the_air_too) {
  Table table(ringing(10, 50, 40));
  table.hit(0.2, 2);
  for (int i = 2; i < 60; ++i) {
    const double t = i * dt, force = table.go({0, 0, 1e-4 * i}).z;
    EXPECT_NEAR(force, 2 * std::exp(-40 * t) * std::sin(turn(50) * t), 1e-5);
  }
  Table weak(ringing(100, 50, 40), 1);
  const std::vector<double> forces = weak.hit(1.5);
  ck_assert_double_le(peak(forces), 1 + 1e-9);
  ck_assert_double_gt(peak(forces), 0.7);
}
END_TEST

START_TEST(points_share_it) {
  Table one;
  const double most = peak(one.hit(0.2));
  Table many;
  std::vector<fs_vec3> points;
  for (int i = 0; i < 32; ++i) points.push_back({0.001 * i, 0, 0});
  fs_tool* tool;
  OK(fs_tool_create(many.scene.get(), points.data(), points.size(), &tool));
  many.tool = Tool(tool);
  EXPECT_NEAR(peak(many.hit(0.2)), most, 1e-4);
}
END_TEST

// On meshes as on planes; and no force steps at whatever is done to the surface while it rings.
START_TEST(nothing_steps_while_it_rings) {
  Random random(5);
  for (int round = 0; round < times(40, 400); ++round) {
    Rig rig("impact");
    const Surface surface = make_surface(ringing(random.log_between(1, 100), random.log_between(20, 125), random.log_between(1, 100)));
    const Surface other = make_surface(ringing(5, 30, 20));
    const Shape sphere = make_mesh(sphere_mesh(0.03, 320));
    const bool is_mesh = random.coin();
    fs_object o = fs_object_init("ball", is_mesh ? FS_PRIMITIVE_MESH : FS_PRIMITIVE_PLANE);
    o.shape = is_mesh ? sphere.get() : nullptr;
    if (is_mesh) o.pose.position = {0, 0, -0.03};
    o.contact = solid(FS_KEEP_FRONT, 500, 5);
    o.surface = surface.get();
    OK(fs_object_set(rig.scene.get(), &o));
    rig.fake.info.mass = 0.3;
    rig.fake.info.damping = 1;
    rig.fake.state.pose.position = {0, 0, 0.01};
    fs_servo_options options = protected_options();
    rig.start(options);
    rig.step(200);
    const double speed = random.log_between(0.02, 1);
    double z = 0.01;
    fs_vec3 before = rig.sent();
    const double slew = stats_of(rig.scene.get()).max_stiffness * 3;
    const int changes_at = static_cast<int>(random.below(60));
    for (int i = 0; i < 200; ++i) {
      const bool is_down = z < -0.001;
      const double step = is_down ? 0 : speed * dt;
      z -= step;
      rig.fake.state.pose.position = {0, 0, z};
      rig.fake.state.twist.linear = {0, 0, -step / dt};
      if (i == changes_at + static_cast<int>(0.01 / speed / dt)) {
        switch (random.below(5)) {
          case 0: o.surface = other.get(); OK(fs_object_set(rig.scene.get(), &o)); break;
          case 1: o.surface = nullptr; OK(fs_object_set(rig.scene.get(), &o)); break;
          case 2: OK(fs_object_remove(rig.scene.get(), "ball")); break;
          case 3: o.primitive = FS_PRIMITIVE_PLANE, o.shape = nullptr, o.pose.position = {}; OK(fs_object_set(rig.scene.get(), &o)); break;
          default: {
            fs_frame frame = fs_frame_init();
            frame.pose.position = {0, 0, 0.002};
            OK(fs_scene_set_frame(rig.scene.get(), &frame));
          }
        }
      }
      rig.step(1);
      // A quarter of the slew limit for impacts, and the way of the hand.
      const double change = norm(rig.sent() - before), explained = dt * slew / 4 + 2 * 1000 * (step + 1e-4) + 0.02;
      ck_assert_msg(change <= explained, "round %d, tick %d: %g N, explained are %g", round, i, change, explained);
      before = rig.sent();
    }
  }
}
END_TEST

// ---------------------------------------------------------------------------------------------------------------- servo

struct Loop {
  double mass, rate, delay;
};

// What a servo sends while a hand meets a table at this speed and stays there. Its report of the table: in told.
std::vector<double> struck(const Loop& loop, const fs_surface_settings& settings, double speed, fs_report& told, double scale = 1,
                           bool is_bounded = true, double* most_stiffness = nullptr) {
  Rig rig("impact");
  const Surface surface = make_surface(settings);
  fs_object o = fs_object_init("table", FS_PRIMITIVE_PLANE);
  o.contact = solid(FS_KEEP_FRONT, 1e-3, 1e6);
  o.surface = surface.get();
  OK(fs_object_set(rig.scene.get(), &o));
  fs_frame frame = fs_frame_init();
  frame.scale = scale;
  OK(fs_scene_set_frame(rig.scene.get(), &frame));
  rig.fake.info.mass = loop.mass;
  rig.fake.info.damping = 1;
  rig.fake.info.force_max = 1000;
  rig.fake.info.delay = loop.delay;
  rig.fake.state.pose.position = {0, 0, 0.01};
  fs_servo_options options = protected_options();
  options.rate = loop.rate;
  if (!is_bounded) options.max_stiffness = options.slew_limit = -1;
  rig.start(options);
  rig.step(200);
  if (most_stiffness) *most_stiffness = stats_of(rig.scene.get()).max_stiffness;
  std::vector<double> out;
  double z = 0.01;
  while (out.size() < 0.3 * loop.rate) {
    const bool is_moving = z > -1e-6;
    if (is_moving) z -= speed / loop.rate;
    rig.fake.state.pose.position = {0, 0, z};
    rig.fake.state.twist.linear = {0, 0, is_moving ? -speed : 0};
    rig.step(1);
    if (!is_moving) out.push_back(rig.sent().z);
  }
  told = report_of(rig.scene.get(), "table");
  return out;
}

// At every rate and delay: how fast all of it changes, the momentum of its first half wave, and its frequency.
START_TEST(a_servo_bounds_it) {
  for (const double mass : {0.05, 0.3, 3.0}) {
    for (const double rate : {500.0, 1000.0, 4000.0}) {
      for (const double delay : {0.0, 0.002, 0.02}) {
        for (const double frequency : {20.0, 100.0, 300.0}) {
          for (const double speed : {0.05, 0.3, 1.5}) {
            fs_report told;
            double most_stiffness = 0;
            const std::vector<double> forces =
                struck({mass, rate, delay}, ringing(1000, frequency, 60), speed, told, 1, true, &most_stiffness);
            double steepest = 0, momentum = 0;
            size_t i = 0;
            for (; i < forces.size() && forces[i] >= -1e-12; ++i) momentum += forces[i] / rate;
            for (i = 1; i < forces.size(); ++i) steepest = std::max(steepest, std::fabs(forces[i] - forces[i - 1]) * rate);
            ck_assert_double_le(steepest, 3 * most_stiffness / 4 * 1.001 + 1e-6);
            ck_assert_double_le(momentum, 0.5 * mass * speed * 1.05);
            ck_assert_double_gt(peak(forces), 0);
            ck_assert(told.impact_lost > 0 && told.impact_lost < 1);
            // Two zeros are half a period apart.
            std::vector<double> zeros;
            for (i = 1; i < forces.size() && zeros.size() < 3; ++i) {
              if (forces[i - 1] * forces[i] < 0) zeros.push_back(i - 1 + forces[i - 1] / (forces[i - 1] - forces[i]));
            }
            ck_assert_uint_ge(zeros.size(), 2);
            ck_assert_double_le(rate / (2 * (zeros[1] - zeros[0])), frequency + 3);
            ck_assert_double_le(rate / (2 * (zeros[1] - zeros[0])), rate / 8 + 3);
          }
        }
      }
    }
  }
}
END_TEST

START_TEST(what_is_lost_is_told) {
  for (const double gain : {1.0, 10.0, 100.0, 1000.0}) {
    for (const double scale : {1.0, 0.001, 50.0}) {
      fs_report told;
      const std::vector<double> forces = struck({0.3, 1000, 0}, ringing(gain / scale, 50, 1), 0.3, told, scale);
      // At 5 ms, the top of the first wave.
      EXPECT_NEAR(forces[4], gain * 0.3 * (1 - told.impact_lost) * std::exp(-0.005), 1e-3 * gain * 0.3);
      ck_assert((told.impact_lost > 0) == (gain >= 10));
    }
  }
  // And in an event.
  Rig rig("impact");
  const Surface surface = make_surface(ringing(100, 50, 20));
  fs_object o = fs_object_init("table", FS_PRIMITIVE_PLANE);
  o.contact = solid(FS_KEEP_FRONT, 500, 1e6);
  o.surface = surface.get();
  OK(fs_object_set(rig.scene.get(), &o));
  rig.fake.info.mass = 0.3;
  rig.fake.info.damping = 1;
  rig.fake.state.pose.position = {0, 0, 0.01};
  rig.start(protected_options());
  rig.step(500);
  const double part = 100 * (1 - report_of(rig.scene.get(), "table").impact_lost);
  char wanted[80];
  std::snprintf(wanted, sizeof wanted, "with %.0f %% of its impact at 0.3 m/s", part);
  fs_event event{};
  bool is_told = false;
  while (fs_scene_next_event(rig.scene.get(), 0, &event) == FS_OK && event.kind != FS_EVENT_NONE) {
    is_told |= event.kind == FS_EVENT_CAPPED && std::strstr(event.text, wanted);
  }
  ck_assert_msg(is_told, "no event says \"%s\"", wanted);
  // Without the bounds all of it is felt, and impact_lost is 0.
  fs_report told;
  const std::vector<double> raw = struck({0.3, 1000, 0}, ringing(1000, 50, 1), 0.3, told, 1, false);
  EXPECT_NEAR(raw[4], 300 * std::exp(-0.005), 0.3);
  EXPECT_NEAR(told.impact_lost, 0, 0);
}
END_TEST

// In a carved hole it begins at the bottom.
START_TEST(it_begins_where_the_texture_pushes) {
  fs_surface_settings settings = ringing(10, 50, 40);
  settings.columns = settings.rows = 1;
  const Surface carved = make_texture(settings, {-0.01});
  Hand hand;
  fs_object o = fs_object_init("table", FS_PRIMITIVE_PLANE);
  o.surface = carved.get();
  hand.put(o, solid(FS_KEEP_FRONT, 1e-6, 1000));
  hand.slide({0, 0, 0.02});
  for (int i = 0; i < 60; ++i) hand.go(hand.x);
  double most = 0;
  for (double z = 0.02; z > -0.0095; z -= 0.2 * dt) most = std::max(most, norm(hand.go({0, 0, z})));
  EXPECT_NEAR(most, 0, 1e-9);
  for (int i = 0; i < 20; ++i) most = std::max(most, norm(hand.go({0, 0, std::max(-0.0105, hand.x.z - 0.2 * dt)})));
  ck_assert_double_gt(most, 1);
}
END_TEST

// Several solids, each struck in the same tick, share what there is.
START_TEST(impacts_share_the_bounds) {
  Rig rig("impact");
  const Surface surface = make_surface(ringing(1000, 50, 20));
  std::vector<std::string> names;
  for (int i = 0; i < 5; ++i) {
    fs_object o = fs_object_init(("table " + std::to_string(i)).c_str(), FS_PRIMITIVE_PLANE);
    o.contact = solid(FS_KEEP_FRONT, 1e-3 * (1 + i), 1e6);
    o.surface = surface.get();
    OK(fs_object_set(rig.scene.get(), &o));
  }
  rig.fake.info.mass = 0.3;
  rig.fake.info.damping = 1;
  rig.fake.info.force_max = 1000;
  rig.fake.state.pose.position = {0, 0, 0.01};
  fs_servo_options options = protected_options();
  rig.start(options);
  rig.step(200);
  double z = 0.01, momentum = 0, most = 0, before = 0;
  bool is_first = true;
  for (int i = 0; i < 200; ++i) {
    const bool is_moving = z > -1e-6;
    if (is_moving) z -= 0.3 * dt;
    rig.fake.state.pose.position = {0, 0, z};
    rig.fake.state.twist.linear = {0, 0, is_moving ? -0.3 : 0};
    rig.step(1);
    most = std::max(most, std::fabs(rig.sent().z - before) / dt);
    before = rig.sent().z;
    is_first &= before >= 0;
    if (is_first) momentum += before * dt;
  }
  const double limit = 3 * stats_of(rig.scene.get()).max_stiffness / 4;
  ck_assert_double_le(momentum, 0.3 * 0.5 * 0.3 * 1.05);
  ck_assert_double_le(most, limit);
  ck_assert_double_gt(most, 0.95 * limit);
}
END_TEST

// A handle that nobody holds flies against the table, and leaves it no faster than it came, whatever the impact.
START_TEST(the_hand_leaves_no_faster_than_it_came) {
  double fastest = 0;
  for (const double frequency : {1.0, 5.0, 20.0, 60.0, 125.0}) {
    for (const double decay : {1.0, 20.0, 200.0}) {
      for (const double stiffness : {100.0, 1000.0, 4000.0}) {
        for (const double speed : {0.05, 0.4}) {
          Rig rig("impact");
          const Surface surface = make_surface(ringing(1e5, frequency, decay));
          fs_object o = fs_object_init("table", FS_PRIMITIVE_PLANE);
          o.contact = solid(FS_KEEP_FRONT, stiffness, 1e6);
          o.surface = surface.get();
          OK(fs_object_set(rig.scene.get(), &o));
          const double mass = 0.3;
          rig.fake.info.mass = mass;
          rig.fake.info.damping = 1;
          rig.fake.info.force_max = 1000;
          double z = 0.005, v = -speed;
          rig.fake.state.pose.position = {0, 0, z};
          fs_servo_options options = protected_options();
          rig.start(options);
          rig.step(300);
          for (int i = 0; i < 600 && z < 0.02; ++i) {
            rig.step(1);
            v += (rig.sent().z - rig.fake.info.damping * v) / mass * dt;
            z += v * dt;
            rig.fake.state.pose.position = {0, 0, z};
            rig.fake.state.twist.linear = {0, 0, v};
            fastest = std::max(fastest, v / speed);
          }
        }
      }
    }
  }
  if (std::getenv("VERBOSE")) std::printf("  the fastest left with %.2f of its speed\n", fastest);
  ck_assert_double_le(fastest, 1);
  ck_assert_double_gt(fastest, 0.3);
}
END_TEST

// ------------------------------------------------------------------------------------------------------------- settings

START_TEST(wrong_settings_are_refused) {
  fs_surface* out;
  const auto refuse = [&](const fs_surface_settings& settings, const char* word) {
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_surface_create(&settings, &out), word);
  };
  refuse(ringing(-1, 50, 20), "impact_gain is -1, must be within 0..1000000");
  refuse(ringing(NAN, 50, 20), "impact_gain");
  refuse(ringing(1, 0, 20), "impact_frequency is 0, must be within 1..100000");
  refuse(ringing(1, INFINITY, 20), "impact_frequency");
  refuse(ringing(1, 50, 0), "impact_decay is 0, must be within 1..1000000");
  refuse(ringing(0, 50, 0), "impact_frequency is 50, must be 0 without an impact_gain");
  refuse(ringing(0, 0, 1), "impact_decay");
  fs_surface_settings settings = sticky(0.5, 0.4, 0.001);
  OK(fs_surface_set_impact(&settings, FS_IMPACT_MEDIUM));
  ck_assert(settings.impact_gain == 8 && settings.impact_frequency == 100 && settings.impact_decay == 80);
  EXPECT_NEAR(settings.static_friction, 0.5, 0);
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_surface_set_impact(&settings, static_cast<fs_impact>(4)), "impact is 4, must be an fs_impact");
  EXPECT(FS_ERROR_INVALID, fs_surface_set_impact(nullptr, FS_IMPACT_SOFT));
  OK(fs_surface_set_impact(&settings, FS_IMPACT_NONE));
  EXPECT_NEAR(settings.impact_gain, 0, 0);
}
END_TEST

START_TEST(files_keep_it) {
  const Folder folder;
  const std::string path = folder / "impact.json";
  Scene from = make_scene(), to = make_scene();
  const Surface surface = make_surface(ringing(7.5, 123.25, 61));
  fs_object o = fs_object_init("table", FS_PRIMITIVE_PLANE);
  o.contact = solid(FS_KEEP_FRONT, 1000, 5);
  o.surface = surface.get();
  OK(fs_object_set(from.get(), &o));
  OK(fs_scene_save(from.get(), path.c_str()));
  OK(fs_scene_load(to.get(), path.c_str()));
  fs_object got = fs_object_init("", FS_PRIMITIVE_PLANE);
  OK(fs_object_get(to.get(), "table", &got));
  fs_surface_settings settings = fs_surface_settings_init();
  OK(fs_surface_get_settings(got.surface, &settings));
  ck_assert(settings.impact_gain == 7.5 && settings.impact_frequency == 123.25 && settings.impact_decay == 61);
  fs_object_release(&got);
}
END_TEST

}  // namespace

int main() {
  Suite* suite = suite_create("impact");
  add_case(suite, "tools",
           {it_is_a_damped_sine, only_what_comes_fast_enough_strikes, it_strikes_again_only_from_freedom, it_decays_in_the_air_too,
            points_share_it, nothing_steps_while_it_rings});
  add_case(suite, "servo",
           {a_servo_bounds_it, what_is_lost_is_told, it_begins_where_the_texture_pushes, impacts_share_the_bounds, the_hand_leaves_no_faster_than_it_came});
  add_case(suite, "settings", {wrong_settings_are_refused, files_keep_it});
  return run_suite(suite);
}
