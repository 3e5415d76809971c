// Several changes at once: begin, commit, cancel; and sync.
#include <atomic>
#include <thread>
#include <vector>

#include "api/support.h"

using namespace scenes;

static fs_object spring(const char* name, double x = 0) {
  fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
  o.front = attract(100, 100);
  o.pose = at(x, 0, 0);
  return o;
}

struct Grouped {
  Scene scene = make_scene();
  Tool tool = make_tool(scene.get());
  double felt() { return force_at(tool.get(), {0, 0.1, 0}).y; }  // -10 for each spring at the origin
  bool has(const char* name) {
    fs_object out = fs_object_init("", FS_PRIMITIVE_POINT);
    const fs_status status = fs_object_get(scene.get(), name, &out);
    fs_object_release(&out);
    ck_assert(status == FS_OK || status == FS_ERROR_NOT_FOUND);
    return status == FS_OK;
  }
  void set(const char* name) {
    const fs_object o = spring(name);
    OK(fs_object_set(scene.get(), &o));
  }
};

START_TEST(commit) {
  Grouped g;
  g.set("old");
  OK(fs_scene_begin(g.scene.get()));
  g.set("a");
  g.set("b");
  OK(fs_object_remove(g.scene.get(), "old"));
  EXPECT_NEAR(g.felt(), -10, 1e-12);  // evaluation does not see it
  ck_assert(g.has("a") && g.has("b") && !g.has("old"));  // getters do
  ck_assert_uint_eq(object_count(g.scene.get()), 2);
  const fs_pose pose = at(0, 0.05, 0);
  OK(fs_object_move(g.scene.get(), "a", &pose, nullptr, FS_NOW));
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_move(g.scene.get(), "old", &pose, nullptr, FS_NOW));
  EXPECT_NEAR(g.felt(), -10, 1e-12);
  OK(fs_scene_commit(g.scene.get()));
  EXPECT_NEAR(g.felt(), -15, 1e-12);
  ck_assert(g.has("a") && g.has("b") && !g.has("old"));
}
END_TEST

START_TEST(cancel) {
  Grouped g;
  g.set("old");
  const uint64_t revision = report_of(g.scene.get(), "old").revision;
  const fs_pose pose = at(0, 0.05, 0);
  const fs_vec3 tool_point{0, 0, 1};
  fs_frame frame = fs_frame_init();
  frame.scale = 7;
  OK(fs_scene_begin(g.scene.get()));
  g.set("a");
  g.set("old");
  OK(fs_object_move(g.scene.get(), "old", &pose, nullptr, FS_NOW));
  OK(fs_object_remove(g.scene.get(), "old"));
  OK(fs_scene_set_tool(g.scene.get(), &tool_point, 1));
  OK(fs_scene_set_frame(g.scene.get(), &frame));
  OK(fs_scene_cancel(g.scene.get()));
  EXPECT_NEAR(g.felt(), -10, 1e-12);
  ck_assert(g.has("old") && !g.has("a"));
  ck_assert_uint_eq(report_of(g.scene.get(), "old").revision, revision);
  fs_vec3 point{};
  size_t count = 0;
  OK(fs_scene_get_tool(g.scene.get(), &point, 1, &count));
  EXPECT_VECTOR(point, (fs_vec3{}), 0);
  OK(fs_scene_get_frame(g.scene.get(), nullptr, &frame));
  ck_assert_double_eq(frame.scale, 1);
  g.set("b");  // and the scene goes on
  EXPECT_NEAR(g.felt(), -20, 1e-12);
}
END_TEST

START_TEST(clear_and_anew) {  // a scene replaced in one tick
  Grouped g;
  for (const char* name : {"a", "b", "c"}) g.set(name);
  OK(fs_scene_begin(g.scene.get()));
  OK(fs_scene_clear(g.scene.get()));
  ck_assert_uint_eq(object_count(g.scene.get()), 0);
  g.set("b");
  EXPECT_NEAR(g.felt(), -30, 1e-12);
  OK(fs_scene_commit(g.scene.get()));
  EXPECT_NEAR(g.felt(), -10, 1e-12);

  OK(fs_scene_begin(g.scene.get()));
  OK(fs_scene_clear(g.scene.get()));
  g.set("x");
  OK(fs_scene_cancel(g.scene.get()));
  EXPECT_NEAR(g.felt(), -10, 1e-12);
  ck_assert(g.has("b") && !g.has("x"));
}
END_TEST

START_TEST(a_failed_call_adds_nothing) {
  Grouped g;
  g.set("a");
  OK(fs_scene_begin(g.scene.get()));
  fs_object bad = spring("a");
  bad.front.gain = -1;
  EXPECT(FS_ERROR_INVALID, fs_object_set(g.scene.get(), &bad));
  bad = spring("b");
  bad.lifetime = -1;
  EXPECT(FS_ERROR_INVALID, fs_object_set(g.scene.get(), &bad));
  EXPECT(FS_ERROR_NOT_FOUND, fs_object_remove(g.scene.get(), "b"));
  g.set("c");
  OK(fs_scene_commit(g.scene.get()));
  ck_assert(g.has("a") && !g.has("b") && g.has("c"));
  EXPECT_NEAR(g.felt(), -20, 1e-12);
}
END_TEST

START_TEST(not_now) {
  Grouped g;
  EXPECT(FS_ERROR_STATE, fs_scene_commit(g.scene.get()));
  EXPECT(FS_ERROR_STATE, fs_scene_cancel(g.scene.get()));
  OK(fs_scene_begin(g.scene.get()));
  g.set("a");
  EXPECT(FS_ERROR_STATE, fs_scene_begin(g.scene.get()));
  ck_assert_uint_gt(std::strlen(fs_last_error()), 5);
  OK(fs_scene_commit(g.scene.get()));  // the first one went on
  ck_assert(g.has("a"));
  EXPECT(FS_ERROR_STATE, fs_scene_commit(g.scene.get()));
  OK(fs_scene_begin(g.scene.get()));
  OK(fs_scene_cancel(g.scene.get()));
  EXPECT(FS_ERROR_STATE, fs_scene_cancel(g.scene.get()));
  OK(fs_scene_begin(g.scene.get()));
  OK(fs_scene_commit(g.scene.get()));  // an empty group is a group
  OK(fs_scene_begin(g.scene.get()));   // a group that nobody commits goes with its scene
  g.set("b");
}
END_TEST

START_TEST(other_threads_join) {
  Grouped g;
  OK(fs_scene_begin(g.scene.get()));
  std::thread([&] {
    const fs_object o = spring("theirs");
    ck_assert_int_eq(fs_object_set(g.scene.get(), &o), FS_OK);
    ck_assert_int_eq(fs_scene_begin(g.scene.get()), FS_ERROR_STATE);
  }).join();
  EXPECT_NEAR(g.felt(), 0, 0);
  ck_assert(g.has("theirs"));
  std::thread([&] { ck_assert_int_eq(fs_scene_commit(g.scene.get()), FS_OK); }).join();
  EXPECT_NEAR(g.felt(), -10, 1e-12);
}
END_TEST

START_TEST(frame_and_tool_in_a_group) {
  Grouped g;
  g.set("a");
  const fs_vec3 point{0, 0.2, 0};
  OK(fs_scene_begin(g.scene.get()));
  OK(fs_scene_set_tool(g.scene.get(), &point, 1));
  fs_vec3 got{};
  size_t count = 0;
  OK(fs_scene_get_tool(g.scene.get(), &got, 1, &count));
  EXPECT_VECTOR(got, point, 0);
  OK(fs_scene_commit(g.scene.get()));
  fs_tool* raw = nullptr;
  OK(fs_tool_create(g.scene.get(), nullptr, 0, &raw));
  EXPECT_NEAR(force_at(Tool(raw).get(), {}).y, -20, 1e-12);
}
END_TEST

START_TEST(fields_do_not_see_the_group) {
  Grouped g;
  g.set("old");
  const fs_vec3 x{0, 0.1, 0};
  auto field = [&](const char* name) {
    fs_vec3 f{};
    const fs_status status = fs_evaluate_field(g.scene.get(), name, FS_NOW, &x, 1, &f);
    ck_assert(status == FS_OK || status == FS_ERROR_NOT_FOUND);
    return f.y;
  };
  EXPECT_NEAR(field("old"), -10, 1e-12);
  OK(fs_scene_begin(g.scene.get()));
  OK(fs_object_remove(g.scene.get(), "old"));
  g.set("new");
  g.set("newer");
  EXPECT_NEAR(field(nullptr), -10, 1e-12);
  EXPECT_NEAR(field("new"), 0, 0);  // it is not there yet, nor is anything in its place
  EXPECT_NEAR(field("newer"), 0, 0);
  OK(fs_scene_commit(g.scene.get()));
  EXPECT_NEAR(field(nullptr), -20, 1e-12);
  EXPECT_NEAR(field("new"), -10, 1e-12);
}
END_TEST

START_TEST(a_group_is_one_tick) {  // of the servo too
  Rig rig("group");
  rig.fake.state.pose = at(0, 0.01, 0);
  fs_servo_options options = virtual_options();
  options.ramp = options.fade = -1;
  rig.start(options);
  OK(fs_scene_begin(rig.scene.get()));
  for (const char* name : {"a", "b", "c"}) {
    const fs_object o = spring(name);
    OK(fs_object_set(rig.scene.get(), &o));
    rig.step(3);
    EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  }
  OK(fs_scene_commit(rig.scene.get()));
  EXPECT_VECTOR(rig.sent(), (fs_vec3{}), 0);
  rig.step(1);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{0, -3, 0}), 1e-12);
}
END_TEST

START_TEST(sync_waits) {
  const Scene scene = make_scene();
  OK(fs_scene_sync(scene.get(), 0));  // no servo: at once
  EXPECT(FS_ERROR_INVALID, fs_scene_sync(scene.get(), -1));
  EXPECT(FS_ERROR_INVALID, fs_scene_sync(scene.get(), NAN));

  Rig rig("sync");
  rig.start(virtual_options());
  rig.step(1);
  const fs_object o = spring("a");
  OK(fs_object_set(rig.scene.get(), &o));
  EXPECT(FS_ERROR_TIMEOUT, fs_scene_sync(rig.scene.get(), 0));
  EXPECT(FS_ERROR_TIMEOUT, fs_scene_sync(rig.scene.get(), 0.02));  // nobody steps
  rig.step(1);
  OK(fs_scene_sync(rig.scene.get(), 0));
  OK(fs_object_set(rig.scene.get(), &o));
  std::atomic<bool> done{false};
  std::thread stepper([&] {
    while (!done) {
      rig.step(1);
      std::this_thread::yield();
    }
  });
  const fs_status status = fs_scene_sync(rig.scene.get(), 30);
  done = true;
  stepper.join();
  EXPECT(FS_OK, status);
}
END_TEST

int main() {
  Suite* suite = suite_create("group");
  add_case(suite, "groups", {commit, cancel, clear_and_anew, a_failed_call_adds_nothing, not_now, other_threads_join,
                             frame_and_tool_in_a_group, fields_do_not_see_the_group, a_group_is_one_tick, sync_waits});
  return run_suite(suite);
}
