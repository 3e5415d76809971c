// The C++ header: handles that give themselves back, errors as exceptions, lists and groups.
#include <forceserver/forceserver.hpp>

#include "api/world.h"

using namespace forceserver;
using namespace scenes;

static fs_object point(const char* name) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
  o.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 100, 0, 5);
  return o;
}

START_TEST(errors_are_exceptions) {
  const Scene scene = Scene::create();
  try {
    scene.object_remove("nobody");
    ck_abort_msg("nothing was thrown");
  } catch (const Error& error) {
    ck_assert_int_eq(error.status(), FS_ERROR_NOT_FOUND);
    ck_assert(std::strstr(error.what(), "nobody"));
  }
  try {
    static_cast<void>(scene.object_get(std::string("nobody\0else", 11)));
    ck_abort_msg("nothing was thrown");
  } catch (const Error& error) {
    ck_assert_int_eq(error.status(), FS_ERROR_INVALID);
    ck_assert_str_eq(error.what(), "name has a byte 0, must be without");
  }
  try {
    static_cast<void>(Device::open("nothing:"));
    ck_abort_msg("nothing was thrown");
  } catch (const std::exception& error) {
    ck_assert_str_eq(error.what(), fs_last_error());
  }
}
END_TEST

START_TEST(handles_give_themselves_back) {
  const fs_vec3 points[]{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const uint32_t corners[]{0, 1, 2};
  Shape shape = Shape::create_mesh(points, 3, corners, 1);
  const Shape other = shape.retain();
  ck_assert_ptr_eq(shape.get(), other.get());
  fs_object o = fs_object_init("mesh", FS_PRIMITIVE_MESH);
  o.shape = shape.get();
  Scene scene = Scene::create();
  scene.object_set(o);
  shape.reset();
  ck_assert(!shape);
  ck_assert_uint_eq(other.get_info().open_edges, 3);
  Object got = scene.object_get("mesh");
  ck_assert_ptr_eq(got.shape, other.get());
  scene = Scene();                    // the shape lives on in `got`
  const Object moved = std::move(got);
  ck_assert_ptr_null(got.shape);
  size_t count = 0;
  ck_assert_ptr_nonnull(fs_shape_get_points(moved.shape, &count));
  ck_assert_uint_eq(count, 3);
}
END_TEST

START_TEST(a_scene_is_felt) {
  const Scene scene = Scene::create();
  scene.object_set(point("a"));
  const Tool tool = Tool::create(scene, nullptr, 0);
  fs_state state{};
  state.pose = at(0.01, 0, 0);
  EXPECT_NEAR(tool.evaluate(state).wrench.force.x, -1, 1e-12);
  tool.tool_reset();
  fs_vec3 x{0.02, 0, 0}, force;
  scene.evaluate_field(nullptr, FS_NOW, &x, 1, &force);
  EXPECT_NEAR(force.x, -2, 1e-12);

  const Device device = Device::open("sim:?hold=0.01,0,0");
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  const Servo servo = Servo::start(scene, device, &options);
  servo.step(100);
  ck_assert_uint_eq(scene.get_servo_stats().ticks, 100);
  ck_assert_uint_eq(servo.get_record().size(), 100);
  fs_state hand;
  scene.get_hand(&hand);
  ck_assert(hand.flags & FS_STATE_READY);
  const Server server = Server::start(servo, new_endpoint());
  ck_assert(server);
  ck_assert(!device_list().empty());
}
END_TEST

START_TEST(lists_are_whole) {
  const Scene scene = Scene::create();
  for (int i = 0; i < 300; ++i) scene.object_set(point(("o" + std::to_string(i)).c_str()));
  ck_assert_uint_eq(scene.get_reports().size(), 300);
  ck_assert_uint_eq(scene.get_motions().size(), 300);
  ck_assert_uint_eq(scene.get_tool().size(), 1);
}
END_TEST

START_TEST(groups_are_committed_or_taken_back) {
  const Scene scene = Scene::create();
  {
    Group group(scene);
    scene.object_set(point("a"));
    group.commit();
  }
  try {
    Group group(scene);
    scene.object_set(point("b"));
    scene.object_remove("nobody");
    group.commit();
  } catch (const Error&) {
  }
  ck_assert_uint_eq(scene.get_reports().size(), 1);
  Group open(scene);
  try {
    Group nested(scene);
    ck_abort_msg("nothing was thrown");
  } catch (const Error& error) {
    ck_assert_int_eq(error.status(), FS_ERROR_STATE);
  }
  scene.object_set(point("c"));
  open.commit();
  ck_assert_uint_eq(scene.get_reports().size(), 2);
}
END_TEST

int main() {
  Suite* suite = suite_create("the C++ header");
  add_case(suite, "classes", {errors_are_exceptions, handles_give_themselves_back, a_scene_is_felt, lists_are_whole,
                              groups_are_committed_or_taken_back});
  return run_suite(suite);
}
