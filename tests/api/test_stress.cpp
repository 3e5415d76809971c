// Six threads do to one scene, for 2 s, all that the contract allows: groups, frames, fields, reports, files, and servos
// that come and go with their servers. Each call gives FS_OK or a status that it documents for this, and nothing crashes.
// With tests/run --all for 20 s.
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <thread>
#include <vector>

#include "api/world.h"

using namespace scenes;

static std::atomic<bool> is_over;
static std::atomic<uint64_t> wrong;

static fs_status check(fs_status status, const char* what, std::initializer_list<fs_status> others = {}) {
  for (const fs_status other : others) {
    if (status == other) return status;
  }
  if (status != FS_OK && wrong++ < 5) std::fprintf(stderr, "  %s: %s: %s\n", what, fs_status_name(status), fs_last_error());
  return status;
}

// What the threads share.
struct Stage {
  const Scene own = make_scene();
  fs_scene* const scene = own.get();
  const std::string endpoint = new_endpoint();
  const Folder folder;
  std::vector<Shape> shapes;
  std::vector<Curve> curves;

  Stage() {
    shapes.push_back(make_mesh(sphere_mesh(0.02, 300)));
    shapes.push_back(make_mesh(torus_mesh(0.03, 0.01, 200)));
    const double table[]{1, 2, 0.5};
    curves.push_back(make_table(table, 3, 0.01));
    if (has_expressions()) curves.push_back(make_expression("0.5*(1+sin(30*t))*exp(-d/0.02)"));
  }

  fs_object object(const std::string& name, Random& random) const {
    const bool is_mesh = random.coin(0.2);
    fs_object o = fs_object_init(name.c_str(), is_mesh ? FS_PRIMITIVE_MESH : random.coin() ? FS_PRIMITIVE_POINT : FS_PRIMITIVE_PLANE);
    if (is_mesh) o.shape = shapes[random.below(shapes.size())].get();
    o.pose = random.pose(0.05);
    o.front = attract(random.between(10, 300), 1);
    if (random.coin(0.3)) {
      o.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1, 0, 1);
      o.front.curve = curves[random.below(curves.size())].get();
    }
    if (o.primitive != FS_PRIMITIVE_POINT && random.coin(0.3)) o.contact = {FS_KEEP_EITHER, 0, 500, 1, 0.3, 0.2, {}};
    o.enabled = random.coin(0.9);
    o.lifetime = random.coin(0.1) ? 0.02 : 0;
    return o;
  }
};

static std::string name_of(Random& random) { return "o" + std::to_string(random.below(100)); }

static void use_groups(const Stage& stage, Random& random) {
  check(fs_scene_begin(stage.scene), "begin");
  for (size_t k = random.coin(0.2) ? 90 : random.below(8); k > 0; --k) {
    const std::string name = name_of(random);
    if (random.coin(0.25)) {
      check(fs_object_remove(stage.scene, name.c_str()), "remove in a group", {FS_ERROR_NOT_FOUND});
    } else {
      const fs_object o = stage.object(name, random);
      check(fs_object_set(stage.scene, &o), "set in a group");
    }
  }
  if (random.coin(0.2)) check(fs_scene_clear(stage.scene), "clear in a group");
  check(random.coin(0.8) ? fs_scene_commit(stage.scene) : fs_scene_cancel(stage.scene), "the end of a group");
}

static void change_views(const Stage& stage, Random& random) {
  for (size_t k = random.below(40); k > 0; --k) {
    fs_frame frame = fs_frame_init();
    frame.pose = random.pose(0.01);
    check(fs_scene_set_frame(stage.scene, &frame), "set_frame");
  }
  const fs_vec3 points[]{{0, 0, 0}, random.in_box(0.02)};
  if (random.coin(0.2)) check(fs_scene_set_tool(stage.scene, points, 1 + random.below(2)), "set_tool");
  if (random.coin(0.2)) check(fs_scene_set_clutch(stage.scene, random.coin()), "set_clutch");
  if (random.coin(0.1)) check(fs_scene_set_accuracy(stage.scene, random.coin() ? 0 : 0.01), "set_accuracy");
  if (random.coin(0.1)) check(fs_scene_set_max_stiffness(stage.scene, random.coin() ? 0 : 500), "set_max_stiffness");
  for (size_t k = random.below(10); k > 0; --k) {
    const fs_pose pose = random.pose(0.05);
    check(fs_object_move(stage.scene, name_of(random).c_str(), &pose, nullptr, FS_NOW), "move", {FS_ERROR_NOT_FOUND});
  }
}

static void evaluate_all(const Stage& stage, Random& random) {
  std::vector<fs_vec3> places(random.coin(0.1) ? 3000 : 3), forces(places.size());
  for (fs_vec3& x : places) x = random.in_box(0.05);
  const std::string name = name_of(random);
  const bool is_one = random.coin(0.7);
  const fs_status status = check(fs_evaluate_field(stage.scene, is_one ? name.c_str() : nullptr, FS_NOW, places.data(),
                                                   places.size(), forces.data()), "evaluate_field", {FS_ERROR_NOT_FOUND});
  if (status == FS_OK && !std::isfinite(norm(forces[0]))) ++wrong;
  if (random.coin(0.8)) return;
  fs_tool* made = nullptr;
  check(fs_tool_create(stage.scene, nullptr, 0, &made), "tool_create");
  const Tool tool(made);
  for (int k = 0; k < 20; ++k) {
    const fs_state state = hand_at(random.in_box(0.05));
    fs_response response;
    check(fs_evaluate(tool.get(), &state, &response), "evaluate");
  }
}

static void look_at_all(const Stage& stage, Random& random) {
  fs_scene* const scene = stage.scene;
  std::vector<fs_report> reports(200);
  std::vector<fs_motion> motions(200);
  size_t count = 0;
  check(fs_scene_get_reports(scene, reports.data(), reports.size(), &count), "reports");
  check(fs_scene_get_report(scene, name_of(random).c_str(), &reports[0]), "report", {FS_ERROR_NOT_FOUND});
  check(fs_scene_get_motions(scene, nullptr, motions.data(), motions.size(), &count), "motions");
  fs_view view;
  check(fs_scene_get_view(scene, nullptr, &view), "view");
  fs_event event;
  check(fs_scene_next_event(scene, 0, &event), "event");
  fs_servo_stats stats = fs_servo_stats_init();
  check(fs_scene_get_servo_stats(scene, &stats), "stats", {FS_ERROR_STATE});
  fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
  if (check(fs_object_get(scene, name_of(random).c_str(), &got), "get", {FS_ERROR_NOT_FOUND}) == FS_OK) {
    got.front.gain = 2;
    check(fs_object_change(scene, &got, FS_PART_PROFILES), "change", {FS_ERROR_NOT_FOUND});
    fs_object_release(&got);
  }
  const std::string path = stage.folder / "scene.json";
  if (random.coin(0.1)) check(fs_scene_save(scene, path.c_str()), "save");
  if (random.coin(0.05)) check(fs_scene_load(scene, path.c_str()), "load", {FS_ERROR_NOT_FOUND});
  check(fs_scene_sync(scene, 0.002), "sync", {FS_ERROR_TIMEOUT});
}

// Servos of the scene, one after the other; the first calls after each start come before its first tick.
static void run_servos(const Stage& stage, Random& random) {
  const Device device = open_device("sim:?path=figure8"), other = open_device("sim:");
  fs_servo_options options = fs_servo_options_init();
  options.mode = random.coin() ? FS_SERVO_VIRTUAL : FS_SERVO_THREAD;
  options.fade = 0.02;
  if (random.coin(0.3)) options.blend = -1;
  const Servo servo = start_servo(stage.scene, device.get(), options);
  fs_servo* second = nullptr;
  check(fs_servo_start(stage.scene, other.get(), &options, &second), "a second servo", {FS_ERROR_STATE});
  if (second) ++wrong;
  wait_a_little(random.between(0, 2e-3));
  fs_server* server = nullptr;
  if (random.coin()) check(fs_server_start(servo.get(), stage.endpoint.c_str(), nullptr, &server), "server");
  const Server owner(server);
  for (size_t k = random.below(60); k > 0; --k) {
    if (options.mode == FS_SERVO_VIRTUAL) check(fs_servo_step(servo.get(), 1 + random.below(3)), "step");
    wait_a_little(random.between(0, 5e-4));
  }
  check(fs_servo_set_enabled(servo.get(), true), "enable");
}

// Other scenes: one in this process with a servo of its own, and a client of the server, which comes and goes.
static void run_scenes(const Stage& stage, Random& random) {
  const Scene scene = make_scene();
  const Device device = open_device("sim:");
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  const Servo servo = start_servo(scene.get(), device.get(), options);
  fs_scene* joined = nullptr;
  check(fs_scene_connect(stage.endpoint.c_str(), "client", &joined), "connect",
        {FS_ERROR_NOT_FOUND, FS_ERROR_TIMEOUT, FS_ERROR_DISCONNECTED, FS_ERROR_EXISTS, FS_ERROR_FULL, FS_ERROR_IO});
  const Scene client(joined);
  for (int k = 0; k < 20; ++k) {
    const fs_object o = stage.object(name_of(random), random);
    check(fs_object_set(scene.get(), &o), "set in another scene");
    check(fs_servo_step(servo.get(), 1), "step of another scene");
    if (client) check(fs_object_set(client.get(), &o), "set of a client", {FS_ERROR_DISCONNECTED, FS_ERROR_TIMEOUT});
  }
}

START_TEST(six_threads) {
  const Stage stage;
  is_over = false;
  wrong = 0;
  void (*const works[])(const Stage&, Random&){use_groups, change_views, evaluate_all, look_at_all, run_servos, run_scenes};
  uint64_t rounds[std::size(works)]{};
  std::vector<std::thread> threads;
  for (size_t i = 0; i < std::size(works); ++i) {
    threads.emplace_back([&, i] {
      for (Random random(i); !is_over; ++rounds[i]) works[i](stage, random);
    });
  }
  std::this_thread::sleep_for(std::chrono::seconds(std::getenv("FORCESERVER_ALL_TESTS") ? 10 : 2));
  is_over = true;
  for (std::thread& thread : threads) thread.join();
  std::printf("  groups, views, fields, looks, servos, scenes:");
  for (const uint64_t r : rounds) std::printf(" %lu", static_cast<unsigned long>(r));
  std::printf("\n");
  ck_assert_uint_eq(wrong, 0);
  for (const uint64_t r : rounds) ck_assert_uint_gt(r, 0);
}
END_TEST

int main() {
  Suite* suite = suite_create("stress");
  add_case(suite, "stress", {six_threads});
  return run_suite(suite);
}
