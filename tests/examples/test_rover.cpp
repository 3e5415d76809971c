// The rover of the quickstart and the testbed: the hand feels a plane whose normal is the axle, as the paper has it.
#include "../../examples/quickstart_source/landscape.h"
#include "api/support.h"

using namespace scenes;

static const char* const name = "rover";
static const double period = 0.04;

// A rover on a scene whose clock the test sets, and the rover's directions.
struct Driven {
  Terrain terrain = load_terrain(TERRAIN_FILE, exaggeration);
  Scene scene = make_scene();
  Rover rover;
  fs_vec3 forward, left, up;  // of unit length, at right angles

  explicit Driven(double heading) {
    rover.heading = heading;
    rover.drive(terrain, {0, 0, 0}, period);
    add();
  }
  explicit Driven(const Rover& other) : rover(other) { add(); }
  void add() {
    OK(fs_scene_set_time(scene.get(), 10));
    add_rover(scene.get(), name, rover, terrain);
    look();
  }
  // Only from the rover and the ground: it drives where it heads, and its wheels are on the ground.
  void look() {
    const fs_vec3 ground = terrain.normal(rover.position.x, rover.position.y, 800);
    const fs_vec3 level = {std::cos(rover.heading), std::sin(rover.heading), 0};
    up = unit(ground);
    forward = unit(level + (-dot(level, up) / up.z) * fs_vec3{0, 0, 1});
    left = cross(up, forward);
  }
  fs_vec3 force(fs_vec3 x, double time = FS_NOW) {
    fs_vec3 out;
    OK(fs_evaluate_field(scene.get(), name, time, &x, 1, &out));
    return out;
  }
};

static const double headings[] = {-2.8, -1.5707963267948966, -0.6, 0, 0.9, 1.5707963267948966, 2.2, 3.141592653589793};

START_TEST(it_resists_sideways_motion) {
  for (const double heading : headings) {
    Driven d(heading);
    for (const double side : {-900.0, -300.0, 300.0, 900.0}) {
      const fs_vec3 force = d.force(d.rover.position + side * d.left);
      ck_assert_msg(dot(force, d.left) * side < 0, "%g m to the left it pushes further away", side);
      ck_assert_msg(std::fabs(dot(force, d.left)) > 0.2, "%g m to the left it pushes with %g N only", side,
                    std::fabs(dot(force, d.left)));
      EXPECT_NEAR(dot(force, d.forward), 0, 1e-9);
      EXPECT_NEAR(dot(force, d.up), 0, 1e-9);
    }
  }
}
END_TEST

START_TEST(forward_and_up_are_free) {
  for (const double heading : headings) {
    Driven d(heading);
    for (const double way : {-5000.0, -700.0, 700.0, 5000.0}) {
      EXPECT_NEAR(norm(d.force(d.rover.position + way * d.forward)), 0, 1e-9);
      EXPECT_NEAR(norm(d.force(d.rover.position + way * d.up)), 0, 1e-9);
    }
    const fs_vec3 beside = d.force(d.rover.position + 400.0 * d.left);
    const fs_vec3 there = d.force(d.rover.position + 400.0 * d.left + 3000.0 * d.forward - 2000.0 * d.up);
    EXPECT_VECTOR(there, beside, 1e-9);
  }
}
END_TEST

START_TEST(the_plane_goes_with_the_rover) {  // between two calls by its twist: it is where the rover will be then
  for (const double heading : headings) {
    Driven d(heading);
    const fs_vec3 goal = d.rover.position + 90000.0 * d.left;
    double time = 10;
    for (int i = 0; i < 40; ++i) {
      OK(fs_scene_set_time(d.scene.get(), time += period));
      drive_rover(d.scene.get(), name, d.rover, d.terrain, goal, period, time);
      OK(fs_scene_set_time(d.scene.get(), time + 0.01));  // a little later
    }
    Rover ahead = d.rover;
    ahead.drive(d.terrain, goal, period);
    Driven next(ahead);
    d.look();
    ck_assert(dot(next.forward, d.left) > 0.01);  // otherwise it did not turn
    for (const double side : {-600.0, 600.0}) {
      const fs_vec3 x = next.rover.position + side * next.left + 1000.0 * next.forward;
      EXPECT_VECTOR(d.force(x, time + period), next.force(x), 0.004);
      ck_assert(norm(d.force(x, time) - next.force(x)) > 0.02);  // without its twist
    }
  }
}
END_TEST

START_TEST(what_the_tables_tell) {  // the parts of a force along the directions of a rover that drives and turns
  Driven d(0.7);
  const fs_vec3 goal = d.rover.position + 9000.0 * d.left;
  drive_rover(d.scene.get(), name, d.rover, d.terrain, goal, period, 10);
  OK(fs_scene_set_time(d.scene.get(), 10 + period));
  d.rover.drive(d.terrain, goal, period);
  d.look();
  fs_pose pose;
  ck_assert(!find_rover(d.scene.get(), "nobody", &pose));
  ck_assert(find_rover(d.scene.get(), name, &pose));
  EXPECT_VECTOR(pose.position, d.rover.position, 0.01);
  Felt felt;
  felt.add(3.0 * d.forward + 4.0 * d.up - 12.0 * d.left, pose, 0.5);
  felt.add({}, pose, 0.5);
  EXPECT_NEAR(felt.seconds, 0.5, 0);
  EXPECT_NEAR(felt.most, 13, 1e-9);
  EXPECT_NEAR(felt.mean(felt.sum), 13, 1e-9);
  EXPECT_NEAR(felt.mean(felt.forward), 3, 0.01);
  EXPECT_NEAR(felt.mean(felt.up), 4, 0.01);
  EXPECT_NEAR(felt.mean(felt.sideways), 12, 0.01);
}
END_TEST

int main() {
  Suite* suite = suite_create("rover");
  add_case(suite, "plane", {it_resists_sideways_motion, forward_and_up_are_free, the_plane_goes_with_the_rover,
                            what_the_tables_tell});
  return run_suite(suite);
}
