// Many threads at one scene while its servo runs: editors of all kinds, two tools, and a servo with a thread of its
// own. Nothing is timed; under the thread sanitizer this must be silent.

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

#include "api/support.h"
#include "scenes/folder.h"

using namespace scenes;

static std::atomic<bool> is_over;
static std::atomic<uint64_t> wrong;  // results that no thread may get

static void check(bool good, const char* what) {
  if (good) return;
  if (wrong++ < 5) std::fprintf(stderr, "  %s: %s\n", what, fs_last_error());
}
static void check(fs_status status, const char* what) { check(status == FS_OK, what); }

static uint64_t repeat(const std::function<void(Random&)>& work, uint64_t seed) {
  Random random(seed);
  uint64_t rounds = 0;
  while (!is_over) {
    work(random);
    ++rounds;
  }
  return rounds;
}

static std::string name_of(Random& random, const char* prefix) { return prefix + std::to_string(random.below(12)); }

// Sets, changes and removes its own objects, meshes among them.
static void edit(fs_scene* scene, const Shape& mesh, Random& random) {
  const std::string name = name_of(random, "edit");
  fs_object o = fs_object_init(name.c_str(), random.coin() ? FS_PRIMITIVE_POINT : FS_PRIMITIVE_MESH);
  if (o.primitive == FS_PRIMITIVE_MESH) o.shape = mesh.get();
  o.pose = random.pose(0.05);
  o.front = attract(random.between(10, 300), 2);
  o.enabled = random.coin(0.9);
  o.lifetime = random.coin(0.2) ? 0.05 : 0;
  check(fs_object_set(scene, &o), "set");
  o.front.gain *= 2;
  check(fs_object_change(scene, &o, FS_PART_PROFILES | FS_PART_OTHER), "change");
  if (random.coin(0.3)) check(fs_object_remove(scene, name.c_str()), "remove");
}

static void move(fs_scene* scene, Random& random) {
  const std::string name = name_of(random, "move");
  const fs_pose pose = random.pose(0.05);
  const fs_twist twist{random.in_box(0.1), random.in_box(1)};
  check(fs_object_move(scene, name.c_str(), &pose, random.coin() ? &twist : nullptr, FS_NOW), "move");
}

// Both objects of a pair exist, or neither: a group is seen as a whole.
static void group(fs_scene* scene, Random& random) {
  if (fs_scene_begin(scene) != FS_OK) {
    check(false, "begin");
    return;
  }
  const bool there = random.coin();
  for (const char* name : {"left", "right"}) {
    fs_object o = fs_object_init(name, FS_PRIMITIVE_PLANE);  // 1 N up and 1 N down: together nothing
    o.pose = at(0, 0, -1e6);
    o.front = constant(name[0] == 'l' ? FS_SENSE_ATTRACTIVE : FS_SENSE_REPULSIVE, 1);
    if (there) {
      check(fs_object_set(scene, &o), "set in a group");
    } else {
      fs_object_remove(scene, name);
    }
  }
  check(random.coin(0.8) ? fs_scene_commit(scene) : fs_scene_cancel(scene), "commit");
}

static void look(fs_scene* scene, const std::string& path, Random& random) {
  std::vector<fs_report> reports(64);
  size_t count = 0;
  check(fs_scene_get_reports(scene, reports.data(), reports.size(), &count), "reports");
  for (size_t i = 0; i < count && i < reports.size(); ++i) {
    check(reports[i].weight >= 0 && reports[i].weight <= 1, "weight");
  }
  std::vector<fs_motion> motions(64);
  check(fs_scene_get_motions(scene, nullptr, motions.data(), motions.size(), &count), "motions");
  for (size_t i = 0; i < count && i < motions.size(); ++i) {
    const fs_motion& m = motions[i];
    const fs_quat q = m.pose.orientation;
    const double length = q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z;
    check(m.name[0] && std::fabs(length - 1) < 1e-9 && m.motion_revision >= m.revision, "motion");
  }
  fs_view view;
  check(fs_scene_get_view(scene, nullptr, &view), "view");
  fs_event event;
  check(fs_scene_next_event(scene, random.coin() ? 0 : 0.001, &event), "event");
  fs_servo_stats stats = fs_servo_stats_init();
  check(fs_scene_get_servo_stats(scene, &stats), "stats");
  fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
  if (fs_object_get(scene, name_of(random, "move").c_str(), &got) == FS_OK) fs_object_release(&got);
  if (random.coin(0.05)) check(fs_scene_save(scene, path.c_str()), "save");
  fs_vec3 x{0.01, 0, 0}, f;
  check(fs_evaluate_field(scene, nullptr, FS_NOW, &x, 1, &f), "field");
  check(std::isfinite(norm(f)), "field");
}

static void feel(fs_scene* scene, fs_tool* tool, Random& random) {
  const fs_state state = hand_at(random.in_box(0.05));
  fs_response response;
  check(fs_evaluate(tool, &state, &response), "evaluate");
  // At most 12 edited and 12 moved objects of 2 N; the pair adds nothing, as neither of the two is ever seen alone.
  check(norm(response.wrench.force) < 24 * 2 + 1e-9, "force");
  fs_state hand;
  fs_response felt;
  fs_wrench sent;
  check(fs_scene_get_hand(scene, &hand, &felt, &sent), "hand");
  check(norm(sent.force) < 100, "sent");
  if (random.coin(0.01)) check(fs_tool_reset(tool), "reset");
}

START_TEST(all_at_once) {
  const Scene scene = make_scene();
  const Device device = open_device("sim:?path=figure8");
  const Shape mesh = make_mesh(torus_mesh(0.03, 0.01, 200));
  for (int i = 0; i < 12; ++i) {
    fs_object o = fs_object_init(("move" + std::to_string(i)).c_str(), FS_PRIMITIVE_POINT);
    o.front = attract(100, 2);
    OK(fs_object_set(scene.get(), &o));
  }
  fs_servo_options options = fs_servo_options_init();
  options.fade = 0.02;
  const Servo servo = start_servo(scene.get(), device.get(), options);
  const Tool first = make_tool(scene.get()), second = make_tool(scene.get());
  const Folder folder;
  const std::string path = folder / "scene.json";
  is_over = false;
  wrong = 0;
  uint64_t rounds[6]{};
  const std::function<void(Random&)> works[]{
      [&](Random& r) { edit(scene.get(), mesh, r); },        [&](Random& r) { move(scene.get(), r); },
      [&](Random& r) { group(scene.get(), r); },             [&](Random& r) { look(scene.get(), path, r); },
      [&](Random& r) { feel(scene.get(), first.get(), r); }, [&](Random& r) { feel(scene.get(), second.get(), r); }};
  std::vector<std::thread> threads;
  for (size_t i = 0; i < 6; ++i) threads.emplace_back([&, i] { rounds[i] = repeat(works[i], i); });
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  while (std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    fs_servo_set_enabled(servo.get(), true);
  }
  is_over = true;
  for (std::thread& thread : threads) thread.join();
  ck_assert_uint_eq(wrong, 0);
  for (uint64_t r : rounds) ck_assert_uint_gt(r, 0);
  OK(fs_scene_sync(scene.get(), 30));
  std::vector<fs_tick> record(2000);
  size_t count = 0;
  OK(fs_servo_get_record(servo.get(), record.data(), record.size(), &count));
  ck_assert_uint_gt(count, 0);
  for (size_t i = 0; i < count && i < record.size(); ++i) ck_assert(std::isfinite(norm(record[i].sent.force)));
  const uint64_t ticks = stats_of(scene.get()).ticks;
  std::printf("  edits, moves, groups, looks, evaluations of two tools:");
  for (uint64_t r : rounds) std::printf(" %lu", (unsigned long)r);
  std::printf("; %lu ticks\n", (unsigned long)ticks);
}
END_TEST

// The values of fs_scene_get_hand are of one tick: the force is that of the spring at the hand's position.
START_TEST(the_hand_is_whole) {
  const Scene scene = make_scene();
  const Device device = open_device("sim:?path=figure8");
  fill(scene.get(), hello());
  fs_servo_options options = fs_servo_options_init();
  options.rate = 10000;
  const Servo servo = start_servo(scene.get(), device.get(), options);
  OK(fs_scene_sync(scene.get(), 30));
  is_over = false;
  wrong = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 2; ++i) {
    threads.emplace_back([&] {
      repeat([&](Random&) {
        fs_state state;
        fs_response response;
        check(fs_scene_get_hand(scene.get(), &state, &response, nullptr), "hand");
        const fs_vec3 p = state.pose.position, pull = -200.0 * p;
        const fs_vec3 force = norm(pull) > 3 ? 3 / norm(pull) * pull : pull;
        check(!(state.flags & FS_STATE_READY) || norm(response.wrench.force - force) < 1e-9, "torn");
      }, 0);
    });
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  is_over = true;
  for (std::thread& thread : threads) thread.join();
  ck_assert_uint_eq(wrong, 0);
}
END_TEST

// Handles are created and destroyed in several threads; one thread may destroy what another created.
START_TEST(handles_come_and_go) {
  const Scene scene = make_scene();
  const Content content = ball(100);
  fill(scene.get(), content);
  is_over = false;
  wrong = 0;
  std::vector<std::thread> threads;
  for (uint64_t i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      repeat([&](Random& random) {
        fs_tool* tool = nullptr;
        check(fs_tool_create(scene.get(), nullptr, 0, &tool), "tool");
        const fs_state state = hand_at(random.in_box(0.05));
        fs_response response;
        check(fs_evaluate(tool, &state, &response), "evaluate");
        fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
        check(fs_object_get(scene.get(), "ball", &got), "get");
        fs_shape_destroy(fs_shape_retain(got.shape));
        fs_object_release(&got);
        fs_tool_destroy(tool);
      }, i);
    });
  }
  for (int k = 0; k < 300; ++k) OK(fs_object_set(scene.get(), &content.objects[0]));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  is_over = true;
  for (std::thread& thread : threads) thread.join();
  ck_assert_uint_eq(wrong, 0);
}
END_TEST

// Servos start and stop while others edit and wait.
START_TEST(servos_come_and_go) {
  const Scene scene = make_scene();
  const Device device = open_device("sim:");
  fill(scene.get(), hello());
  is_over = false;
  wrong = 0;
  std::thread editor([&] {
    repeat([&](Random& random) {
      const fs_pose pose = random.pose(0.01);
      check(fs_object_move(scene.get(), "spring", &pose, nullptr, FS_NOW), "move");
      fs_wrench sent;
      const fs_status status = fs_scene_get_hand(scene.get(), nullptr, nullptr, &sent);
      check(status == FS_OK || status == FS_ERROR_STATE, "hand");
      fs_event event;
      check(fs_scene_next_event(scene.get(), 0.001, &event), "event");
    }, 1);
  });
  std::thread waiter([&] {
    repeat([&](Random&) {
      const fs_status status = fs_scene_sync(scene.get(), 0.01);
      check(status == FS_OK || status == FS_ERROR_TIMEOUT, "sync");
    }, 2);
  });
  for (int k = 0; k < 20; ++k) {
    fs_servo_options options = fs_servo_options_init();
    options.mode = k % 2 ? FS_SERVO_VIRTUAL : FS_SERVO_THREAD;
    const Servo servo = start_servo(scene.get(), device.get(), options);
    if (k % 2) fs_servo_step(servo.get(), 50);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  is_over = true;
  editor.join();
  waiter.join();
  ck_assert_uint_eq(wrong, 0);
}
END_TEST

// Many positions at once are evaluated by several threads, which give what each position gives.
START_TEST(a_field_of_many_positions) {
  const Scene scene = make_scene();
  fill(scene.get(), ball(100));
  Random random(1);
  std::vector<fs_vec3> places(4000), at_once(places.size()), some(places.size());
  for (fs_vec3& x : places) x = random.in_box(0.1);
  OK(fs_evaluate_field(scene.get(), nullptr, FS_NOW, places.data(), places.size(), at_once.data()));
  for (size_t i = 0; i < places.size(); i += 500) {
    OK(fs_evaluate_field(scene.get(), nullptr, FS_NOW, &places[i], 500, &some[i]));
  }
  for (size_t i = 0; i < places.size(); ++i) EXPECT_VECTOR(at_once[i], some[i], 0);
}
END_TEST

int main() {
  Suite* suite = suite_create("threads");
  add_case(suite, "threads", {all_at_once, the_hand_is_whole, handles_come_and_go, servos_come_and_go,
                              a_field_of_many_positions});
  return run_suite(suite);
}
