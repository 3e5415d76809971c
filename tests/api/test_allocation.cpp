// Calls marked [rt] neither allocate nor free memory, on no thread that evaluates, whatever other threads do to the
// scene meanwhile. This program replaces malloc and its family; operator new uses these too.
#include <atomic>
#include <cerrno>
#include <thread>
#include <vector>

#include "api/world.h"
#include "device/waiting_device.h"

using namespace scenes;

static thread_local bool is_armed;
static thread_local unsigned long seen;

extern "C" {
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
void __libc_free(void*);

static void note() { seen += is_armed; }

void* malloc(size_t size) { note(); return __libc_malloc(size); }
void* calloc(size_t n, size_t size) { note(); return __libc_calloc(n, size); }
void* realloc(void* p, size_t size) { note(); return __libc_realloc(p, size); }
void* memalign(size_t alignment, size_t size) { note(); return __libc_memalign(alignment, size); }
void* aligned_alloc(size_t alignment, size_t size) { note(); return __libc_memalign(alignment, size); }
int posix_memalign(void** out, size_t alignment, size_t size) {
  note();
  *out = __libc_memalign(alignment, size);
  return *out ? 0 : ENOMEM;
}
void free(void* p) { if (p) note(); __libc_free(p); }
}

// How often this thread allocated or freed within f.
template <class F>
static unsigned long count(F f) {
  seen = 0;
  is_armed = true;
  f();
  is_armed = false;
  return seen;
}

START_TEST(the_counter_counts) {
  int* volatile number = nullptr;  // without it the compiler removes the allocation and the release
  void* volatile block = nullptr;
  ck_assert_uint_eq(count([&] { number = new int; delete number; }), 2);
  ck_assert_uint_eq(count([&] { block = malloc(8); free(block); }), 2);
  ck_assert_uint_eq(count([&] { std::vector<double> v(100); block = v.data(); }), 2);
  // An allocation inside the library is counted.
  ck_assert_uint_gt(count([] { make_scene(); }), 2);
  ck_assert_uint_eq(count([] {}), 0);
}
END_TEST

// Every primitive with every kind of profile, a custom expression, moving objects.
static Content everything() {
  Content content = profiles();
  Content more = moving(1);
  for (fs_object& o : more.objects) content.objects.push_back(o);
  for (Shape& s : more.shapes) content.shapes.push_back(std::move(s));
  for (Curve& c : more.curves) content.curves.push_back(std::move(c));
  const fs_contact contact{FS_KEEP_EITHER, 0, 1000, 5, 1, 0.5, {}};
  content.add("table", FS_PRIMITIVE_PLANE, {0, 0, -0.02}).contact = contact;
  content.add_shape("solid", make_mesh(sphere_mesh(0.02, 3000)), {0.02, 0, 0}).contact = contact;
  static const Surface rough = [] {
    fs_surface_settings settings = sticky(0.5, 0.2, 1e-3);
    OK(fs_surface_set_impact(&settings, FS_IMPACT_HARD));
    settings.columns = settings.rows = 2;
    settings.column_width = settings.row_width = 1e-3;
    settings.repeats = true;
    return make_texture(settings, {0, -1e-4, -1e-4, 0});
  }();
  fs_object& relief = content.add("relief", FS_PRIMITIVE_PLANE, {0, 0, -0.01});
  relief.contact = contact;
  relief.contact.friction = 0;
  relief.surface = rough.get();
  if (has_expressions()) {
    fs_object& o = content.add("expression", FS_PRIMITIVE_PLANE);
    o.front = o.back = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 0.5, 0, 1);
    o.front.curve = o.back.curve = content.keep(make_expression("1+sin(20*t)*exp(-d/0.1)"), {});
  }
  return content;
}

// A thread that does all sorts of things to a scene until it is told to stop.
class Editor {
 public:
  Editor(fs_scene* scene, const Content& content) : thread_([this, scene, &content] {
    Random random(7);
    while (!is_over_) {
      const fs_object& o = content.objects[random.below(content.objects.size())];
      const fs_pose pose = random.pose(0.05);
      switch (random.below(5)) {
        case 0: fs_object_set(scene, &o); break;
        case 1: fs_object_remove(scene, o.name); break;
        case 2:  // the old shape, and maybe the snapshot that held it last, are dropped in a tick
          if (o.primitive == FS_PRIMITIVE_MESH) {
            fs_object other = o;
            const Shape shape = make_mesh(sphere_mesh(0.01, 100));
            other.shape = shape.get();
            fs_object_set(scene, &other);
          }
          break;
        default: fs_object_move(scene, o.name, &pose, nullptr, FS_NOW);
      }
      ++rounds_;
    }
  }) {}
  ~Editor() { stop(); }
  void stop() {
    is_over_ = true;
    if (thread_.joinable()) thread_.join();
  }
  uint64_t rounds() const { return rounds_; }

 private:
  std::atomic<bool> is_over_{false};
  std::atomic<uint64_t> rounds_{0};
  std::thread thread_;
};

START_TEST(a_tool) {
  const Scene scene = make_scene();
  const Content content = everything();
  fill(scene.get(), content);
  const fs_vec3 points[]{{0, 0, 0}, {0.01, 0, 0}};
  fs_tool* raw = nullptr;
  OK(fs_tool_create(scene.get(), points, 2, &raw));
  const Tool tool(raw);
  Random random(3);
  fs_response response;
  fs_status worst = FS_OK;
  double time = 0;
  ck_assert_uint_eq(count([&] {  // from the first call on
    for (int k = 0; k < 2000; ++k) {
      const fs_state state = hand_at(random.in_box(0.08));
      worst = std::min(worst, fs_evaluate(tool.get(), &state, &response));
      if (k % 100 == 0) worst = std::min(worst, fs_tool_reset(tool.get()));
      worst = std::min(worst, fs_scene_get_time(scene.get(), &time));
    }
  }), 0);
  ck_assert_int_eq(worst, FS_OK);
  // A call that fails does not allocate either.
  fs_state bad{};
  bad.time = NAN;
  fs_evaluate(tool.get(), &bad, &response);
  ck_assert_uint_eq(count([&] { fs_evaluate(tool.get(), &bad, &response); }), 0);

  Editor editor(scene.get(), content);
  unsigned long total = 0;
  while (editor.rounds() < 3000) {
    const fs_state state = hand_at(random.in_box(0.08));
    total += count([&] { fs_evaluate(tool.get(), &state, &response); });
  }
  ck_assert_uint_eq(total, 0);
}
END_TEST

static void drive(fs_servo_mode mode, const char* uri = "sim:?path=figure8") {
  const Scene scene = make_scene();
  const Device device = open_device(uri);
  const Content content = everything();
  fill(scene.get(), content);
  fs_servo_options options = fs_servo_options_init();
  options.mode = mode;
  options.fade = 0.05;
  if (mode == FS_SERVO_VIRTUAL) options.max_stiffness = -1;  // else the budget is worked out between the steps
  const Servo servo = start_servo(scene.get(), device.get(), options);
  ck_assert_uint_eq(count([&] {
    for (int k = 0; k < 200; ++k) fs_servo_step(servo.get(), 1);
  }), 0);
  Editor editor(scene.get(), content);
  unsigned long total = 0;
  uint64_t ticks = 0;
  fs_state state;
  fs_response response;
  fs_wrench sent;
  while (editor.rounds() < 3000 || ticks < 3000) {
    total += count([&] {
      fs_servo_step(servo.get(), 1);
      fs_scene_get_hand(scene.get(), &state, &response, &sent);
      if (ticks % 500 == 0) fs_servo_set_enabled(servo.get(), ticks % 1000 != 0);
    });
    ++ticks;
  }
  editor.stop();
  ck_assert_uint_eq(total, 0);
  // All objects are removed at once, and frame, tool and clutch change with them.
  OK(fs_scene_clear(scene.get()));
  const fs_vec3 points[]{{0, 0, 0}, {0.01, 0, 0}};
  OK(fs_scene_set_tool(scene.get(), points, 2));
  fs_frame frame = fs_frame_init();
  frame.scale = 2;
  OK(fs_scene_set_frame(scene.get(), &frame));
  OK(fs_scene_set_clutch(scene.get(), true));
  ck_assert_uint_eq(count([&] { fs_servo_step(servo.get(), mode == FS_SERVO_VIRTUAL ? 200 : 1); }), 0);
  OK(fs_scene_set_clutch(scene.get(), false));
  ck_assert_uint_eq(count([&] {
    for (int k = 0; k < 200; ++k) fs_servo_step(servo.get(), 1);
  }), 0);
}

START_TEST(a_virtual_servo) { drive(FS_SERVO_VIRTUAL); }
END_TEST
START_TEST(a_servo_with_local_models) { drive(FS_SERVO_CALLER, "sim:?path=figure8&link=model"); }
END_TEST
START_TEST(a_callers_servo) { drive(FS_SERVO_CALLER); }
END_TEST
START_TEST(a_servo_whose_delay_changes) {
  FakeDevice fake("restless");
  fake.info.mass = 0.3;
  fake.info.damping = 1;
  int looks = 0;
  fake.on_link = [&](FakeDevice&, fs_link& out) {
    out.delay = ++looks % 4 == 2 ? 0.020 : 0.002;  // longer at once, shorter three looks later
    return FS_OK;
  };
  for (int i = 0; i < 50 && looks <= 4; ++i) drive(FS_SERVO_CALLER, "fakereallink:restless");  // it is looked at 25 times a second
  ck_assert_int_gt(looks, 4);
}
END_TEST

// Neither moves through shared memory nor reading the hand there allocate.
// The states come and the forces go in the library's thread, which the servo does not wait for.
START_TEST(a_driver_that_waits) {
  WaitingDevice device("waiting");
  drive(FS_SERVO_CALLER, "waiting:0");
  ck_assert_uint_gt(device.sent().size(), 0);
}
END_TEST
START_TEST(a_connected_scene) {
  Rig rig("connected");
  rig.start(virtual_options());
  const std::string endpoint = new_endpoint();
  const Server server = start_server(rig.servo.get(), endpoint, fs_server_options_init());
  const Scene scene = connect(endpoint, "me");
  const Content content = everything();
  fill(scene.get(), content);
  Random random(5);
  fs_state state;
  fs_response response;
  fs_wrench sent;
  double time = 0;
  fs_status worst = FS_OK;
  const fs_twist twist{{0.1, 0, 0}, {0, 0, 1}};
  const auto look_and_move = [&] {
    for (const fs_object& o : content.objects) {
      const fs_pose pose = random.pose(0.05);
      worst = std::min(worst, fs_object_move(scene.get(), o.name, &pose, random.coin() ? &twist : nullptr, FS_NOW));
    }
    worst = std::min(worst, fs_scene_get_hand(scene.get(), &state, &response, &sent));
    worst = std::min(worst, fs_scene_get_time(scene.get(), &time));
  };
  ck_assert_uint_eq(count([&] {
    for (int k = 0; k < 1000; ++k) look_and_move();
  }), 0);
  ck_assert_int_eq(worst, FS_OK);
  Got(scene.get(), content.objects[0].name);  // this brings the moved object into this process's scene
  ck_assert_uint_eq(count(look_and_move), 0);
  ck_assert_int_eq(worst, FS_OK);
}
END_TEST

START_TEST(the_tick_with_clients) {  // of which two are limited together
  Rig rig("clients");
  rig.start(virtual_options());
  const std::string endpoint = new_endpoint();
  fs_server_options options = fs_server_options_init();
  options.force_limit = 3;
  const Server server = start_server(rig.servo.get(), endpoint, options);
  const Scene here = connect(endpoint, "a"), there = connect(endpoint, "b@x"), too = connect(endpoint, "c@x");
  for (const Scene* scene : {&here, &there, &too}) {
    const fs_object o = push("push", 2);
    OK(fs_object_set(scene->get(), &o));
    ck_assert(eventually([&] {
      rig.step(1);
      return fs_scene_sync(scene->get(), 0.01) == FS_OK;
    }));
  }
  rig.step(2000);
  EXPECT_VECTOR(rig.sent(), (fs_vec3{0, 0, 5}), 1e-9);
  ck_assert_uint_eq(count([&] { rig.step(100); }), 0);
}
END_TEST

START_TEST(poses) {
  Random random(8);
  fs_status worst = FS_OK;
  ck_assert_uint_eq(count([&] {
    for (int k = 0; k < 1000; ++k) {
      const fs_frame frame{random.pose(1), random.log_between(0.1, 10), 1, {}};
      fs_motion motion{};
      motion.pose = random.pose(1);
      motion.twist = {random.in_box(1), random.in_box(1)};
      motion.horizon = 0.1;
      fs_pose pose;
      worst = std::min(worst, fs_motion_at(&motion, random.between(-0.1, 0.2), &pose));
      worst = std::min(worst, fs_frame_to_device(&frame, &pose, &pose));
      worst = std::min(worst, fs_frame_to_scene(&frame, &pose, &pose));
    }
  }), 0);
  ck_assert_int_eq(worst, FS_OK);
}
END_TEST

START_TEST(faults) {  // faults do not allocate either
  Rig rig("faults");
  fill(rig.scene.get(), hello());
  rig.start(virtual_options());
  rig.step(100);
  ck_assert_uint_eq(count([&] { rig.step(10); }), 0);
  rig.fake.read_status = FS_ERROR_DISCONNECTED;
  fs_servo_step(rig.servo.get(), 1);
  ck_assert_uint_eq(count([&] { fs_servo_step(rig.servo.get(), 10); }), 0);
  rig.fake.read_status = FS_OK;
  rig.fake.state.pose.position.x = NAN;
  ck_assert_uint_eq(count([&] { fs_servo_step(rig.servo.get(), 10); }), 0);
  rig.fake.state.pose.position.x = 0;
  ck_assert_uint_eq(count([&] {
    fs_servo_set_enabled(rig.servo.get(), true);
    fs_servo_step(rig.servo.get(), 10);
  }), 0);
}
END_TEST

int main() {
  Suite* suite = suite_create("allocation");
  add_case(suite, "allocation", {the_counter_counts, a_tool, a_virtual_servo, a_servo_with_local_models, a_callers_servo,
                                a_servo_whose_delay_changes, a_driver_that_waits, a_connected_scene, the_tick_with_clients, poses, faults});
  return run_suite(suite);
}
