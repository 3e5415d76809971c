// The simulated controller behind a link: its delay and rate are exact, its force fades when nothing comes, and local
// models stand where plain forces over the same link swing.
#include <algorithm>
#include <array>
#include <vector>

#include <forceserver/forceserver.h>

#include "scenes/random.h"
#include "support.h"

#include "driver/registry.h"

using namespace fs;

namespace {

constexpr char exact[] = "encoder=ideal&friction=0";

std::string uri_of(const std::string& link, double ms, double hz, const std::string& rest) {
  char text[200];
  std::snprintf(text, sizeof text, "sim:?link=%s&link_ms=%g&link_hz=%g&%s&", link.c_str(), ms, hz, exact);
  return text + rest;
}

START_TEST(info_tells_link_and_controller) {
  const auto force = open_device("sim:?link=force&delay_ms=2"), model = open_device("sim:?link=model&link_ms=20&link_hz=50");
  ck_assert_double_eq_tol(force->info().delay, 0.012, 1e-12);  // both delays
  ck_assert_double_eq_tol(force->info().link_rate, 100, 1e-9);
  ck_assert_double_eq(force->info().controller_rate, 0);
  ck_assert_double_eq_tol(model->info().delay, 0.020, 1e-12);
  ck_assert_double_eq_tol(model->info().link_rate, 50, 1e-9);
  ck_assert_double_eq_tol(model->info().controller_rate, 1000, 1e-9);
  ck_assert_double_eq(model->info().controller_delay, 0);
  ck_assert_double_eq(model->info().controller_damping, 5);
  ck_assert_double_eq(open_device("sim:")->info().link_rate, 0);
}
END_TEST

// A force that answers the first pose acts link_ms after that pose, to the controller's millisecond.
START_TEST(the_delay_is_that_of_the_loop) {
  for (const int ms : {0, 4, 10, 40}) {
    const auto device = open_device(uri_of("force", ms, 100, "hand=released"));
    int answered = 0, moved = 0;  // ticks
    for (int k = 1; k < 200 && !moved; ++k) {
      const fs_state state = read_at(*device, k * tick);
      const bool is_ready = state.flags & FS_STATE_READY;
      if (is_ready && !answered) {
        answered = k;
        ck_assert_double_le(std::fabs(k * tick - state.time - ms * tick / 2), 0.0011);  // half of the way
      }
      if (is_ready && state.pose.position.x != 0) {
        moved = k;
        // Seen in the first pose that was sent after the force came, which takes half of the way again.
        const double came = (1 + ms) * tick;  // the first pose is sent at the first tick
        ck_assert_double_ge(state.time, came - 1e-9);
        ck_assert_double_le(state.time, came + 0.0111);
      }
      device->write({{1, 0, 0}, {}});
    }
    ck_assert_int_gt(moved, 0);
  }
}
END_TEST

// The force that holds a spring's handle aside goes when no command comes: after 0.1 s, within 0.1 s.
START_TEST(the_force_fades_on_silence) {
  for (const char* link : {"force", "model"}) {
    const auto device = open_device(uri_of(link, 2, 200, "hand_mass=0.1&hand_damping=50&hand_stiffness=1000"));
    int k = 0;
    for (; k < 1000; ++k) {
      read_at(*device, k * tick);
      device->write({{5, 0, 0}, {}});
    }
    const double aside = 5.0 / 1000;
    double x[3];
    const int ends[]{80, 150, 500};  // ms of silence
    for (int i = 0; i < 3; ++i) {
      for (; k < 1000 + ends[i]; ++k) read_at(*device, k * tick);
      x[i] = read_at(*device, k * tick).pose.position.x;
    }
    ck_assert_double_eq_tol(x[0], aside, 0.01 * aside);
    ck_assert_double_lt(x[1], 0.95 * aside);
    ck_assert_double_gt(x[1], 0.2 * aside);
    ck_assert_double_lt(x[2], 0.01 * aside);
    device->write({{5, 0, 0}, {}});  // and it comes back
    for (int end = k + 300; k < end; ++k) {
      read_at(*device, k * tick);
      device->write({{5, 0, 0}, {}});
    }
    ck_assert_double_eq_tol(read_at(*device, k * tick).pose.position.x, aside, 0.05 * aside);
  }
}
END_TEST

// The controller renders f0 + dfdx (x - x0), damps it, and keeps to the device's maximum.
START_TEST(the_controller_renders_the_model) {
  const auto device = open_device(uri_of("model", 2, 1000, "hand=released&hold=0.02,0,0"));
  const Pose origin = identity_pose();
  fs_state state{};
  for (int k = 0; k < 3000; ++k) {
    state = read_at(*device, k * tick);
    device->write_model(origin, {{0, 0, 1}, {}}, -200.0 * identity());
  }
  ck_assert_double_eq_tol(state.pose.position.x, 0, 1e-5);
  ck_assert_double_eq_tol(state.pose.position.z, 1.0 / 200, 1e-5);
  const auto strong = open_device(uri_of("model", 0, 1000, "hand_mass=0.1&hand_damping=100&hand_stiffness=1000"));
  for (int k = 0; k < 2000; ++k) {
    state = read_at(*strong, k * tick);
    strong->write_model({{0.1, 0, 0}, {1, 0, 0, 0}}, {}, -10000.0 * identity());
  }
  ck_assert_double_eq_tol(state.pose.position.x, 0.025, 1e-4);  // 25 N, not 1000
}
END_TEST

// A torque per radian turns the wrist back, and a model counts for its own hold time.
START_TEST(the_controller_renders_torque_and_hold) {
  const fs_driver& sim = *find_driver("sim");
  void* self = nullptr;
  ck_assert_int_eq(sim.open("?link=model&link_ms=2&link_hz=1000&wrist=active&hand=released&encoder=ideal&friction=0", &self), FS_OK);
  fs_model model{};
  model.struct_size = sizeof model;
  model.x0 = identity_pose();
  model.hold = 0.1;
  fs_state state{};
  int k = 0;
  const auto run = [&](int ticks, bool writes) {
    for (const int end = k + ticks; k < end; ++k) {
      ck_assert(sim.advance(self, 1 + k * tick) == FS_OK && sim.read(self, &state) == FS_OK);
      if (writes) sim.write_model(self, &model);
    }
    return log_rotation(state.pose.orientation).z;
  };
  model.f0.torque = {0, 0, 0.05};
  const double turned = run(200, true);
  ck_assert_double_gt(turned, 0.01);
  model.f0.torque = {};
  model.dtdr = -2.0 * identity();
  double least = turned;
  for (int i = 0; i < 100; ++i) least = std::fmin(least, run(20, true));
  ck_assert_double_lt(least, 0.5 * turned);
  sim.close(self);

  for (const double hold : {0.02, 0.3}) {
    ck_assert_int_eq(sim.open("?link=model&link_ms=2&link_hz=1000&encoder=ideal&friction=0&hand_mass=0.1&hand_damping=50&"
                              "hand_stiffness=1000", &self), FS_OK);
    model = {};
    model.struct_size = sizeof model;
    model.x0 = identity_pose();
    model.f0.force = {5, 0, 0};
    model.hold = hold;
    k = 0;
    run(1000, true);
    const double aside = state.pose.position.x;
    run(200, false);
    ck_assert(aside > 4e-3 && (hold < 0.1 ? state.pose.position.x < 0.5 * aside : state.pose.position.x > 0.9 * aside));
    sim.close(self);
  }
}
END_TEST

struct Handles {
  fs_scene* scene = nullptr;
  fs_device* device = nullptr;
  fs_servo* servo = nullptr;
  ~Handles() {
    fs_servo_stop(servo);
    fs_device_close(device);
    fs_scene_destroy(scene);
  }
};

void ok(fs_status status) {
  if (status != FS_ERROR_DISCONNECTED) ck_assert_msg(status >= 0, "%s", fs_last_error());
}

fs_profile linear(double stiffness, double limit = 20) {
  return fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, stiffness, 0, limit);
}

// A scene whose slopes reach `stiffness` (N/m) together.
using Fill = void (*)(fs_scene* scene, double stiffness);
void wall(fs_scene* scene, double stiffness) {
  fs_object o = fs_object_init("wall", FS_PRIMITIVE_PLANE);
  o.back = linear(stiffness);
  ok(fs_object_set(scene, &o));
}
void solid_wall(fs_scene* scene, double stiffness) {
  fs_object o = fs_object_init("solid", FS_PRIMITIVE_PLANE);
  o.contact = {FS_KEEP_FRONT, 0, stiffness, 20, 0, 0, {}};
  ok(fs_object_set(scene, &o));
}
void weak_point(fs_scene* scene, double stiffness) {  // the force is limited: the stiffness changes within millimetres
  fs_object o = fs_object_init("point", FS_PRIMITIVE_POINT);
  o.front = linear(stiffness, 3);
  ok(fs_object_set(scene, &o));
}
void point(fs_scene* scene, double stiffness) {
  fs_object o = fs_object_init("point", FS_PRIMITIVE_POINT);
  o.front = linear(stiffness);
  ok(fs_object_set(scene, &o));
}
void corner(fs_scene* scene, double stiffness) {
  wall(scene, stiffness / 2);
  fs_object o = fs_object_init("side", FS_PRIMITIVE_PLANE);
  o.back = linear(stiffness / 2);
  ok(fs_pose_from_z({0, 0, 0}, {1, 0, 0.2}, &o.pose));
  ok(fs_object_set(scene, &o));
}

struct Outcome {
  double swing = 0;  // m, from end to end, in the last of eight seconds
  fs_servo_stats stats = fs_servo_stats_init();
};

// stiffness: N/m, of the scene, whatever the servo can render; 0: what the servo says that it can render.
Outcome run(const std::string& uri, Fill fill, double stiffness) {
  Handles h;
  ok(fs_scene_create(&h.scene));
  ok(fs_device_open(uri.c_str(), &h.device));
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  if (stiffness > 0 && uri.find("link=force") != std::string::npos) options.max_stiffness = -1;  // to see it swing
  ok(fs_servo_start(h.scene, h.device, &options, &h.servo));
  Outcome out;
  ok(fs_scene_get_servo_stats(h.scene, &out.stats));
  fill(h.scene, stiffness > 0 ? stiffness : out.stats.max_stiffness);
  ok(fs_servo_step(h.servo, 7000));
  Vec3 low{1, 1, 1}, high{-1, -1, -1};
  for (int k = 0; k < 1000; ++k) {
    ok(fs_servo_step(h.servo, 1));
    fs_state state;
    ok(fs_scene_get_hand(h.scene, &state, nullptr, nullptr));
    const Vec3 x = state.pose.position;
    low = {std::min(low.x, x.x), std::min(low.y, x.y), std::min(low.z, x.z)};
    high = {std::max(high.x, x.x), std::max(high.y, x.y), std::max(high.z, x.z)};
  }
  out.swing = largest_coordinate(high - low);
  ok(fs_scene_get_servo_stats(h.scene, &out.stats));
  ck_assert_uint_eq(out.stats.faults, 0);
  return out;
}

START_TEST(models_stand_where_forces_swing) {
  for (const char* hand : {"hand=nominal&hold=0,0,-0.01", "hand=firm&hold=0,0,-0.01", "hand=light&hold=0,0,-0.01"}) {
    const Outcome force = run(uri_of("force", 10, 100, hand), wall, 1000), model = run(uri_of("model", 10, 100, hand), wall, 1000);
    ck_assert_msg(force.swing > 1e-3, "%s: forces stand, with a swing of %g m", hand, force.swing);
    ck_assert_msg(model.swing < 1e-5, "%s: models swing by %g m", hand, model.swing);
    ck_assert_double_eq(model.stats.damping, 5);
    ck_assert_double_eq_tol(model.stats.max_stiffness, 2.5 * 6 / 0.02, 1e-6);
  }
}
END_TEST

struct Link {
  double ms, hz;
};
constexpr Link links[]{{2, 500}, {5, 100}, {10, 500}, {10, 100}, {20, 100}, {10, 25}, {50, 20}};
constexpr std::pair<Fill, const char*> tasks[]{
    {wall, "hand=light&hold=0.003,0.002,-0.01"}, {wall, "hand=light&hold=0.003,0.002,-0.001"},
    {solid_wall, "hand=light&hold=0.003,0.002,-0.003"}, {point, "hand=released&hold=0.01,0.01,0"},
    {point, "hand=light&hold=0.01,0.01,0"}, {weak_point, "hand=released&hold=0.01,0.01,0"},
    {weak_point, "hand=light&hold=0.01,0.01,0"}, {corner, "hand=light&hold=-0.01,0.01,-0.01"},
    {wall, "hand=nominal&hold=0.003,0.002,-0.01"}, {point, "hand=firm&hold=0.01,0.01,0"},
    {wall, "hand=light&mass=0.05&hold=0,0,-0.01"}, {weak_point, "hand=released&mass=0.05&hold=0.01,0.01,0"}};

// With as much stiffness as the servo allows.
START_TEST(what_is_allowed_stands) {
  int number = 0;
  for (const char* way : {"model", "force"}) {
    for (const Link& link : links) {
      for (const auto& [fill, hand] : tasks) {
        if (number++ % scenes::times(3, 1) != 0) continue;
        const Outcome outcome = run(uri_of(way, link.ms, link.hz, hand), fill, 0);
        ck_assert_msg(outcome.swing < 5e-5, "%s, %g ms, %g Hz, %s: %g N/m swings by %g m", way, link.ms, link.hz, hand,
                      outcome.stats.max_stiffness, outcome.swing);
      }
    }
  }
}
END_TEST

}  // namespace

int main() {
  Suite* suite = suite_create("link");
  TCase* all = tcase_create("link");
  tcase_set_timeout(all, 500);
  for (const TTest* test : {info_tells_link_and_controller, the_delay_is_that_of_the_loop, the_force_fades_on_silence,
                            the_controller_renders_the_model, the_controller_renders_torque_and_hold, models_stand_where_forces_swing, what_is_allowed_stands}) {
    tcase_add_test(all, test);
  }
  suite_add_tcase(suite, all);
  return run_suite(suite);
}
