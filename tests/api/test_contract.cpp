// Every function of the headers is called with good arguments, and with null for each pointer in turn, which gives
// INVALID and never a crash. contract_list.py sees that no function of the headers is missing here.
#include <unistd.h>

#include <cstdio>
#include <functional>
#include <vector>

#include "api/support.h"
#include "scenes/folder.h"

using namespace scenes;

// One of everything.
struct World {
  FakeDevice fake{"world"}, other_fake{"other"}, lone_fake{"lone"};
  Scene scene_owner = make_scene(), spare_scene = make_scene(), lone_scene = make_scene();
  Content content = ball(100);
  Tool tool_owner = make_tool(scene_owner.get());
  Device device_owner = fake.open(), spare_device = other_fake.open(), lone_device = lone_fake.open();
  Servo servo_owner = start_servo(scene_owner.get(), device_owner.get(), virtual_options());
  Servo lone_owner = start_servo(lone_scene.get(), lone_device.get(), virtual_options());
  std::string endpoint = "shm:contract-" + std::to_string(getpid()), other_endpoint = endpoint + "-other";
  Server server_owner;
  Scene connected_owner;
  Curve curve_owner;
  fs_scene* scene = scene_owner.get();
  fs_scene* connected = nullptr;
  fs_client client{};
  fs_client_view client_view{};
  fs_recorded_tick recorded_tick{};
  fs_tool* tool = tool_owner.get();
  fs_device* device = spare_device.get();
  fs_servo *servo = servo_owner.get(), *lone_servo = lone_owner.get();  // the second has no server
  fs_shape* shape = content.shapes[0].get();
  fs_curve* curve;
  fs_object object = content.objects[0];
  fs_profile profile = attract(100, 2);
  fs_pose pose = at(0, 0, 0);
  fs_twist twist{};
  fs_frame frame = fs_frame_init();
  fs_state state{};
  fs_wrench wrench{};
  fs_answer answer{};
  fs_driver_info driver_info{};
  fs_response response{};
  fs_report report{};
  fs_motion motion{};
  fs_view view{};
  fs_event event{};
  fs_driver driver{};
  fs_tick tick{};
  fs_device_entry entry{};
  fs_device_info device_info = fs_device_info_init();
  fs_shape_info shape_info = fs_shape_info_init();
  fs_servo_options servo_options = virtual_options();
  fs_server_options server_options = fs_server_options_init();
  fs_servo_stats stats = fs_servo_stats_init();
  std::vector<fs_vec3> points{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  std::vector<uint32_t> triangle{0, 1, 2};
  std::vector<double> doubles{1, 2, 3};
  double number = 0;
  size_t count = 0;
  fs_surface_settings settings = fs_surface_settings_init(), rough = settings;
  std::vector<double> heights{0, -1e-3, 0};
  fs_surface* surface = nullptr;
  ~World() { fs_surface_destroy(surface); }
  const Folder folder;
  std::string scene_path = folder / "scene.json", mesh_path = folder / "mesh.obj";

  World() {
    curve_owner = make_table(doubles.data(), 3, 0.1);
    curve = curve_owner.get();
    require(fs_surface_create(&settings, &surface), "fs_surface_create");
    rough.columns = 3;
    rough.rows = 1;
    rough.column_width = 1e-3;
    require(fs_object_set(scene, &object), "fs_object_set");
    require(fs_servo_step(servo, 5), "fs_servo_step");
    fs_server* server = nullptr;
    require(fs_server_start(servo, endpoint.c_str(), nullptr, &server), "fs_server_start");
    server_owner.reset(server);
    require(fs_scene_connect(endpoint.c_str(), "world", &connected), "fs_scene_connect");
    connected_owner.reset(connected);
    require(fs_scene_save(scene, scene_path.c_str()), "fs_scene_save");
    std::FILE* file = std::fopen(mesh_path.c_str(), "w");
    std::fputs("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", file);
    std::fclose(file);
    driver.struct_size = sizeof driver;
    driver.scheme = "contract";
    driver.open = [](const char*, void**) { return fs_fail(FS_ERROR_NOT_FOUND, "nothing behind it"); };
    driver.close = [](void*) {};
    driver.get_info = [](void*, fs_device_info*) { return FS_OK; };
    driver.read = [](void*, fs_state*) { return FS_OK; };
    driver.write = [](void*, const fs_wrench*) { return FS_OK; };
  }
};

// p, or null if n is i.
template <class T>
static T* but(int turn, int i, T* p) {
  return turn == i ? nullptr : p;
}

static void give_back(fs_scene* scene) { fs_scene_destroy(scene); }
static void give_back(fs_shape* shape) { fs_shape_destroy(shape); }
static void give_back(fs_curve* curve) { fs_curve_destroy(curve); }
static void give_back(fs_surface* surface) { fs_surface_destroy(surface); }
static void give_back(fs_tool* tool) { fs_tool_destroy(tool); }
static void give_back(fs_device* device) { fs_device_close(device); }
static void give_back(fs_servo* servo) { fs_servo_stop(servo); }
static void give_back(fs_server* server) { fs_server_stop(server); }

// Gives back what a call made, so that it can be called again.
template <class T>
static fs_status made(T** out, fs_status status) {
  if (out && status == FS_OK) {
    give_back(*out);
    *out = nullptr;
  }
  return status;
}

struct Call {
  const char* function;
  int pointers;       // number of pointers that must not be null
  fs_status good;     // the status when none is null
  std::function<fs_status(World&, int n)> call;  // n: which one is null; -1: none
};

static fs_scene* new_scene;
static fs_shape* new_shape;
static fs_curve* new_curve;
static fs_surface* new_surface;
static fs_tool* new_tool;
static fs_device* new_device;
static fs_servo* new_servo;
static fs_server* new_server;

static const std::vector<Call> calls{
    {"fs_pose_from_z", 1, FS_OK, [](World& w, int n) { return fs_pose_from_z({}, {0, 0, 1}, but(n, 0, &w.pose)); }},
    {"fs_profile_evaluate", 3, FS_OK, [](World& w, int n) {
       return fs_profile_evaluate(but(n, 0, &w.profile), 0, 0, but(n, 1, w.doubles.data()), 3,
                                  but(n, 2, w.doubles.data()));
     }},
    {"fs_object_evaluate_law", 3, FS_OK, [](World& w, int n) {
       return fs_object_evaluate_law(but(n, 0, &w.object), 0, 0, but(n, 1, w.doubles.data()), 3,
                                     but(n, 2, w.doubles.data()));
     }},
    {"fs_shape_create_polyline", 2, FS_OK, [](World& w, int n) {
       fs_shape** out = but(n, 1, &new_shape);
       return made(out, fs_shape_create_polyline(but(n, 0, w.points.data()), 3, false, out));
     }},
    {"fs_shape_create_mesh", 3, FS_OK, [](World& w, int n) {
       fs_shape** out = but(n, 2, &new_shape);
       return made(out, fs_shape_create_mesh(but(n, 0, w.points.data()), 3, but(n, 1, w.triangle.data()), 1, out));
     }},
    {"fs_shape_load", 2, FS_OK, [](World& w, int n) {
       fs_shape** out = but(n, 1, &new_shape);
       return made(out, fs_shape_load(but(n, 0, w.mesh_path.c_str()), 1, out));
     }},
    {"fs_shape_build", 1, FS_OK, [](World& w, int n) { return fs_shape_build(but(n, 0, w.shape)); }},
    {"fs_shape_get_progress", 2, FS_OK, [](World& w, int n) {
       return fs_shape_get_progress(but(n, 0, w.shape), but(n, 1, &w.number));
     }},
    {"fs_shape_get_info", 2, FS_OK, [](World& w, int n) {
       return fs_shape_get_info(but(n, 0, w.shape), but(n, 1, &w.shape_info));
     }},
    {"fs_curve_create_table", 2, FS_OK, [](World& w, int n) {
       fs_curve** out = but(n, 1, &new_curve);
       return made(out, fs_curve_create_table(but(n, 0, w.doubles.data()), 3, 0.1, out));
     }},
    {"fs_curve_create_expression", 2, has_expressions() ? FS_OK : FS_ERROR_UNSUPPORTED, [](World&, int n) {
       fs_curve** out = but(n, 1, &new_curve);
       return made(out, fs_curve_create_expression(but(n, 0, "d"), out));
     }},

    {"fs_surface_create", 2, FS_OK, [](World& w, int n) {
       fs_surface** out = but(n, 1, &new_surface);
       return made(out, fs_surface_create(but(n, 0, &w.settings), out));
     }},
    {"fs_surface_create_texture", 3, FS_OK, [](World& w, int n) {
       fs_surface** out = but(n, 2, &new_surface);
       return made(out, fs_surface_create_texture(but(n, 0, &w.rough), but(n, 1, w.heights.data()), 3, out));
     }},
    {"fs_surface_create_expression", 3, FS_OK, [](World& w, int n) {
       fs_surface** out = but(n, 2, &new_surface);
       return made(out, fs_surface_create_expression(but(n, 0, &w.rough), but(n, 1, "-1e-2*x"), out));
     }},
    {"fs_surface_set_impact", 1, FS_OK, [](World& w, int n) {
       return fs_surface_set_impact(but(n, 0, &w.settings), FS_IMPACT_HARD);
     }},
    {"fs_surface_get_settings", 2, FS_OK, [](World& w, int n) {
       return fs_surface_get_settings(but(n, 0, w.surface), but(n, 1, &w.settings));
     }},

    {"fs_scene_create", 1, FS_OK, [](World&, int n) {
       fs_scene** out = but(n, 0, &new_scene);
       return made(out, fs_scene_create(out));
     }},
    {"fs_scene_connect", 3, FS_OK, [](World& w, int n) {
       fs_scene** out = but(n, 2, &new_scene);
       return made(out, fs_scene_connect(but(n, 0, w.endpoint.c_str()), but(n, 1, "me"), out));
     }},
    {"fs_object_set", 2, FS_OK, [](World& w, int n) {
       return fs_object_set(but(n, 0, w.scene), but(n, 1, &w.object));
     }},
    {"fs_object_get", 3, FS_OK, [](World& w, int n) {
       fs_object got = fs_object_init("", FS_PRIMITIVE_POINT);
       const fs_status status = fs_object_get(but(n, 0, w.scene), but(n, 1, "ball"), but(n, 2, &got));
       fs_object_release(&got);
       return status;
     }},
    {"fs_object_change", 2, FS_OK, [](World& w, int n) {
       return fs_object_change(but(n, 0, w.scene), but(n, 1, &w.object), FS_PART_POSE);
     }},
    {"fs_object_move", 3, FS_OK, [](World& w, int n) {  // twist may be null
       return fs_object_move(but(n, 0, w.scene), but(n, 1, "ball"), but(n, 2, &w.pose), nullptr, FS_NOW);
     }},
    {"fs_object_remove", 2, FS_OK, [](World& w, int n) {
       const fs_status status = fs_object_remove(but(n, 0, w.scene), but(n, 1, "ball"));
       require(fs_object_set(w.scene, &w.object), "fs_object_set");
       return status;
     }},
    {"fs_scene_clear", 1, FS_OK, [](World& w, int n) {
       const fs_status status = fs_scene_clear(but(n, 0, w.scene));
       require(fs_object_set(w.scene, &w.object), "fs_object_set");
       return status;
     }},
    {"fs_scene_begin", 1, FS_OK, [](World& w, int n) { return fs_scene_begin(but(n, 0, w.scene)); }},
    {"fs_scene_commit", 1, FS_OK, [](World& w, int n) { return fs_scene_commit(but(n, 0, w.scene)); }},
    {"fs_scene_cancel", 1, FS_ERROR_STATE, [](World& w, int n) { return fs_scene_cancel(but(n, 0, w.scene)); }},
    {"fs_scene_sync", 1, FS_OK, [](World& w, int n) {
       require(fs_servo_step(w.servo, 1), "fs_servo_step");
       return fs_scene_sync(but(n, 0, w.scene), 0);
     }},
    {"fs_scene_save", 2, FS_OK, [](World& w, int n) {
       return fs_scene_save(but(n, 0, w.scene), but(n, 1, w.scene_path.c_str()));
     }},
    {"fs_scene_load", 2, FS_OK, [](World& w, int n) {
       return fs_scene_load(but(n, 0, w.scene), but(n, 1, w.scene_path.c_str()));
     }},
    {"fs_frame_to_scene", 3, FS_OK, [](World& w, int n) {
       return fs_frame_to_scene(but(n, 0, &w.frame), but(n, 1, &w.pose), but(n, 2, &w.pose));
     }},
    {"fs_frame_to_device", 3, FS_OK, [](World& w, int n) {
       return fs_frame_to_device(but(n, 0, &w.frame), but(n, 1, &w.pose), but(n, 2, &w.pose));
     }},
    {"fs_scene_set_frame", 2, FS_OK, [](World& w, int n) {
       return fs_scene_set_frame(but(n, 0, w.scene), but(n, 1, &w.frame));
     }},
    {"fs_scene_get_frame", 2, FS_OK, [](World& w, int n) {  // client null: its own
       return fs_scene_get_frame(but(n, 0, w.scene), nullptr, but(n, 1, &w.frame));
     }},
    {"fs_scene_set_clutch", 1, FS_OK, [](World& w, int n) { return fs_scene_set_clutch(but(n, 0, w.scene), false); }},
    {"fs_scene_set_tool", 2, FS_OK, [](World& w, int n) {
       return fs_scene_set_tool(but(n, 0, w.scene), but(n, 1, w.points.data()), 1);
     }},
    {"fs_scene_get_tool", 3, FS_OK, [](World& w, int n) {
       return fs_scene_get_tool(but(n, 0, w.scene), but(n, 1, w.points.data()), 3, but(n, 2, &w.count));
     }},
    {"fs_scene_get_view", 2, FS_OK, [](World& w, int n) {  // client null: its own
       return fs_scene_get_view(but(n, 0, w.scene), nullptr, but(n, 1, &w.view));
     }},
    {"fs_scene_set_tool_radius", 1, FS_OK, [](World& w, int n) { return fs_scene_set_tool_radius(but(n, 0, w.scene), 0); }},
    {"fs_scene_get_tool_radius", 2, FS_OK, [](World& w, int n) {
       return fs_scene_get_tool_radius(but(n, 0, w.scene), but(n, 1, &w.number));
     }},
    {"fs_scene_set_accuracy", 1, FS_OK, [](World& w, int n) { return fs_scene_set_accuracy(but(n, 0, w.scene), 0); }},
    {"fs_scene_set_max_stiffness", 1, FS_OK, [](World& w, int n) {
       return fs_scene_set_max_stiffness(but(n, 0, w.scene), 1000);
     }},
    {"fs_scene_get_time", 2, FS_OK, [](World& w, int n) {
       return fs_scene_get_time(but(n, 0, w.scene), but(n, 1, &w.number));
     }},
    {"fs_scene_set_time", 1, FS_OK, [](World& w, int n) {
       return fs_scene_set_time(but(n, 0, w.spare_scene.get()), 5);
     }},
    {"fs_scene_get_reports", 3, FS_OK, [](World& w, int n) {
       return fs_scene_get_reports(but(n, 0, w.scene), but(n, 1, &w.report), 1, but(n, 2, &w.count));
     }},
    {"fs_scene_get_report", 3, FS_OK, [](World& w, int n) {
       return fs_scene_get_report(but(n, 0, w.scene), but(n, 1, "ball"), but(n, 2, &w.report));
     }},
    {"fs_motion_at", 2, FS_OK, [](World& w, int n) { return fs_motion_at(but(n, 0, &w.motion), 1, but(n, 1, &w.pose)); }},
    {"fs_scene_get_motions", 3, FS_OK, [](World& w, int n) {  // client null: of all
       return fs_scene_get_motions(but(n, 0, w.scene), nullptr, but(n, 1, &w.motion), 1, but(n, 2, &w.count));
     }},
    {"fs_scene_get_motions_since", 3, FS_OK, [](World& w, int n) {  // client null: all
       return fs_scene_get_motions_since(but(n, 0, w.scene), nullptr, 0, but(n, 1, &w.motion), 1, but(n, 2, &w.count));
     }},
    {"fs_scene_next_event", 2, FS_OK, [](World& w, int n) {
       return fs_scene_next_event(but(n, 0, w.scene), 0, but(n, 1, &w.event));
     }},

    {"fs_tool_create", 2, FS_OK, [](World& w, int n) {  // points may be null
       fs_tool** out = but(n, 1, &new_tool);
       return made(out, fs_tool_create(but(n, 0, w.scene), nullptr, 0, out));
     }},
    {"fs_evaluate", 3, FS_OK, [](World& w, int n) {
       return fs_evaluate(but(n, 0, w.tool), but(n, 1, &w.state), but(n, 2, &w.response));
     }},
    {"fs_tool_reset", 1, FS_OK, [](World& w, int n) { return fs_tool_reset(but(n, 0, w.tool)); }},
    {"fs_evaluate_field", 3, FS_OK, [](World& w, int n) {  // name null: all
       std::vector<fs_vec3> forces(3);
       return fs_evaluate_field(but(n, 0, w.scene), nullptr, FS_NOW, but(n, 1, w.points.data()), 3,
                                but(n, 2, forces.data()));
     }},

    {"fs_device_list", 2, FS_OK, [](World& w, int n) {
       return fs_device_list(but(n, 0, &w.entry), 1, but(n, 1, &w.count));
     }},
    {"fs_device_open", 2, FS_OK, [](World&, int n) {
       fs_device** out = but(n, 1, &new_device);
       return made(out, fs_device_open(but(n, 0, "sim:"), out));
     }},
    {"fs_device_get_info", 2, FS_OK, [](World& w, int n) {
       return fs_device_get_info(but(n, 0, w.device), but(n, 1, &w.device_info));
     }},
    {"fs_device_read", 2, FS_OK, [](World& w, int n) {
       return fs_device_read(but(n, 0, w.device), but(n, 1, &w.state));
     }},
    {"fs_device_write", 2, FS_OK, [](World& w, int n) {
       return fs_device_write(but(n, 0, w.device), but(n, 1, &w.wrench));
     }},
    {"fs_device_control", 3, FS_ERROR_UNSUPPORTED, [](World& w, int n) {
       return fs_device_control(but(n, 0, w.device), but(n, 1, "home"), but(n, 2, &w.answer));
     }},

    {"fs_servo_start", 3, FS_OK, [](World& w, int n) {
       fs_servo** out = but(n, 2, &new_servo);
       return made(out, fs_servo_start(but(n, 0, w.spare_scene.get()), but(n, 1, w.spare_device.get()),
                                       &w.servo_options, out));
     }},
    {"fs_servo_step", 1, FS_OK, [](World& w, int n) { return fs_servo_step(but(n, 0, w.servo), 1); }},
    {"fs_servo_set_enabled", 1, FS_OK, [](World& w, int n) { return fs_servo_set_enabled(but(n, 0, w.servo), true); }},
    {"fs_scene_get_hand", 1, FS_OK, [](World& w, int n) {  // what is null is not asked for
       return fs_scene_get_hand(but(n, 0, w.scene), nullptr, nullptr, nullptr);
     }},
    {"fs_scene_get_servo_stats", 2, FS_OK, [](World& w, int n) {
       return fs_scene_get_servo_stats(but(n, 0, w.scene), but(n, 1, &w.stats));
     }},
    {"fs_scene_get_record", 3, FS_OK, [](World& w, int n) {
       return fs_scene_get_record(but(n, 0, w.scene), 0, but(n, 1, &w.recorded_tick), 1, but(n, 2, &w.count));
     }},
    {"fs_scene_get_device_info", 2, FS_OK, [](World& w, int n) {
       return fs_scene_get_device_info(but(n, 0, w.scene), but(n, 1, &w.device_info));
     }},
    {"fs_scene_stop_force", 1, FS_OK, [](World& w, int n) { return fs_scene_stop_force(but(n, 0, w.scene)); }},
    {"fs_scene_resume_force", 1, FS_OK, [](World& w, int n) { return fs_scene_resume_force(but(n, 0, w.scene)); }},
    {"fs_servo_get_record", 3, FS_OK, [](World& w, int n) {
       return fs_servo_get_record(but(n, 0, w.servo), but(n, 1, &w.tick), 1, but(n, 2, &w.count));
     }},
    {"fs_server_start", 3, FS_OK, [](World& w, int n) {
       fs_server** out = but(n, 2, &new_server);
       return made(out, fs_server_start(but(n, 0, w.lone_servo), but(n, 1, w.other_endpoint.c_str()), &w.server_options, out));
     }},
    {"fs_scene_get_clients", 3, FS_OK, [](World& w, int n) {
       return fs_scene_get_clients(but(n, 0, w.connected), but(n, 1, &w.client), 1, but(n, 2, &w.count));
     }},
    {"fs_scene_get_views", 3, FS_OK, [](World& w, int n) {
       return fs_scene_get_views(but(n, 0, w.connected), but(n, 1, &w.client_view), 1, but(n, 2, &w.count));
     }},

    {"fs_driver_list", 2, FS_OK, [](World& w, int n) {
       return fs_driver_list(but(n, 0, &w.driver_info), 1, but(n, 1, &w.count));
     }},
    {"fs_driver_register", 1, FS_OK, [](World& w, int n) { return fs_driver_register(but(n, 0, &w.driver)); }},
    {"fs_driver_load", 1, FS_ERROR_IO, [](World&, int n) {
       return fs_driver_load(but(n, 0, "/no/such/driver.so"));
     }},
};

START_TEST(every_pointer_in_turn) {
  World world;
  for (const Call& c : calls) {
    for (int n = c.pointers - 1; n >= 0; --n) {
      const fs_status status = c.call(world, n);
      ck_assert_msg(status == FS_ERROR_INVALID, "%s with pointer %d null: %s", c.function, n, fs_status_name(status));
      ck_assert_msg(std::strlen(fs_last_error()) > 8, "%s with pointer %d null: \"%s\"", c.function, n,
                    fs_last_error());
    }
    const fs_status status = c.call(world, -1);
    ck_assert_msg(status == c.good, "%s: %s (%s)", c.function, fs_status_name(status), fs_last_error());
    if (status != FS_OK) ck_assert_uint_gt(std::strlen(fs_last_error()), 15);
  }
}
END_TEST

// The functions that do not return a status.
static const char* const others[]{
    "fs_version", "fs_status_name", "fs_last_error", "fs_object_release", "fs_shape_retain", "fs_shape_destroy",
    "fs_shape_get_points", "fs_shape_get_triangles", "fs_curve_get_expression", "fs_curve_get_table", "fs_curve_retain",
    "fs_curve_destroy", "fs_surface_get_heights",
    "fs_surface_retain", "fs_surface_destroy", "fs_scene_destroy", "fs_tool_destroy", "fs_device_close", "fs_servo_stop", "fs_server_stop",
    "fs_fail", "fs_primitive_name", "fs_profile_kind_name", "fs_sense_name", "fs_object_state_name",
    "fs_event_kind_name", "fs_realtime_name", "fs_fault_name", "fs_state_reason"};

START_TEST(the_others) {
  World w;
  (void)others;
  ck_assert_ptr_nonnull(fs_version());
  ck_assert_ptr_nonnull(fs_status_name(FS_OK));
  ck_assert_ptr_nonnull(fs_last_error());
  fs_object_release(nullptr);
  ck_assert_ptr_null(fs_shape_retain(nullptr));
  ck_assert_ptr_null(fs_curve_retain(nullptr));
  ck_assert_ptr_null(fs_surface_retain(nullptr));
  fs_surface_destroy(fs_surface_retain(w.surface));
  fs_surface_destroy(nullptr);
  fs_shape_destroy(fs_shape_retain(w.shape));
  fs_curve_destroy(fs_curve_retain(w.curve));
  size_t count = 7;
  double step = 7;
  ck_assert_ptr_null(fs_shape_get_points(nullptr, &count));
  ck_assert_uint_eq(count, 0);
  count = 7;
  ck_assert_ptr_null(fs_shape_get_triangles(nullptr, &count));
  ck_assert_uint_eq(count, 0);
  fs_shape_get_points(w.shape, nullptr);
  fs_shape_get_triangles(w.shape, nullptr);
  ck_assert_ptr_null(fs_curve_get_expression(nullptr));
  count = 7;
  ck_assert_ptr_null(fs_curve_get_table(nullptr, &count, &step));
  ck_assert_uint_eq(count, 0);
  count = 7;
  ck_assert_ptr_null(fs_surface_get_heights(nullptr, &count));
  ck_assert_uint_eq(count, 0);
  ck_assert_ptr_null(fs_surface_get_heights(w.surface, nullptr));
  fs_curve_get_table(w.curve, nullptr, &step);
  fs_curve_get_table(w.curve, &count, nullptr);
  fs_curve_get_table(w.curve, nullptr, nullptr);
  fs_shape_destroy(nullptr);
  fs_curve_destroy(nullptr);
  fs_scene_destroy(nullptr);
  fs_tool_destroy(nullptr);
  fs_device_close(nullptr);
  fs_servo_stop(nullptr);
  fs_server_stop(nullptr);
  EXPECT_SENTENCE(FS_ERROR_IO, fs_fail(FS_ERROR_IO, "the cable is out: 0 V, 5 V expected"), "0 V, 5 V expected");
  ck_assert_int_eq(fs_fail(FS_ERROR_IO, nullptr), FS_ERROR_IO);
  ck_assert_ptr_nonnull(fs_last_error());
}
END_TEST

// Each value has the name that it has in the header; any other number has a name too.
START_TEST(names) {
#define NAMED(call) ck_assert_msg(std::string(#call).ends_with(std::string("(") + call + ")"), "%s: %s", #call, call)
  NAMED(fs_status_name(FS_OK));
  NAMED(fs_primitive_name(FS_PRIMITIVE_POINT));
  NAMED(fs_primitive_name(FS_PRIMITIVE_POLYLINE));
  NAMED(fs_primitive_name(FS_PRIMITIVE_PLANE));
  NAMED(fs_primitive_name(FS_PRIMITIVE_MESH));
  NAMED(fs_profile_kind_name(FS_PROFILE_NONE));
  NAMED(fs_profile_kind_name(FS_PROFILE_CONSTANT));
  NAMED(fs_profile_kind_name(FS_PROFILE_LINEAR_INCREASING));
  NAMED(fs_profile_kind_name(FS_PROFILE_LINEAR_DECREASING));
  NAMED(fs_profile_kind_name(FS_PROFILE_GAUSSIAN));
  NAMED(fs_profile_kind_name(FS_PROFILE_QUADRATIC));
  NAMED(fs_profile_kind_name(FS_PROFILE_INVERSE));
  NAMED(fs_profile_kind_name(FS_PROFILE_CUSTOM));
  NAMED(fs_sense_name(FS_SENSE_ATTRACTIVE));
  NAMED(fs_sense_name(FS_SENSE_REPULSIVE));
  NAMED(fs_object_state_name(FS_OBJECT_PENDING));
  NAMED(fs_object_state_name(FS_OBJECT_FELT));
  NAMED(fs_object_state_name(FS_OBJECT_FADING));
  NAMED(fs_object_state_name(FS_OBJECT_DISABLED));
  NAMED(fs_object_state_name(FS_OBJECT_REFUSED));
  NAMED(fs_event_kind_name(FS_EVENT_NONE));
  NAMED(fs_event_kind_name(FS_EVENT_READY));
  NAMED(fs_event_kind_name(FS_EVENT_REFUSED));
  NAMED(fs_event_kind_name(FS_EVENT_CAPPED));
  NAMED(fs_event_kind_name(FS_EVENT_EDITED));
  NAMED(fs_event_kind_name(FS_EVENT_EXPIRED));
  NAMED(fs_event_kind_name(FS_EVENT_DEVICE));
  NAMED(fs_event_kind_name(FS_EVENT_DISCONNECTED));
  NAMED(fs_event_kind_name(FS_EVENT_OVERFLOW));
  NAMED(fs_event_kind_name(FS_EVENT_CLIENT));
  NAMED(fs_realtime_name(FS_REALTIME_NONE));
  NAMED(fs_realtime_name(FS_REALTIME_NICE));
  NAMED(fs_realtime_name(FS_REALTIME_FIFO));
  NAMED(fs_realtime_name(FS_REALTIME_FIFO_LOCKED));
  NAMED(fs_fault_name(FS_FAULT_DEVICE));
  NAMED(fs_fault_name(FS_FAULT_SPEED));
  NAMED(fs_fault_name(FS_FAULT_NUMBER));
  NAMED(fs_fault_name(FS_FAULT_LATE));
#undef NAMED
  // Of several faults the name is that of the lowest bit; a loop gives all of them.
  std::string all;
  for (uint32_t faults = FS_FAULT_SPEED | FS_FAULT_LATE; faults; faults &= faults - 1) {
    all += std::string(fs_fault_name(faults)) + " ";
  }
  ck_assert_str_eq(all.c_str(), "FS_FAULT_SPEED FS_FAULT_LATE ");
  ck_assert_str_eq(fs_state_reason(FS_STATE_READY), "");
  ck_assert_str_eq(fs_fault_name(0), "no fault");
  ck_assert_str_eq(fs_fault_name(FS_FAULT_LATE << 1), "an unknown fs_fault");
  ck_assert_str_eq(fs_fault_name(1u << 31), "an unknown fs_fault");
  // A number that is no value, as a C program can have it.
  const auto strange = [](auto name, auto value, const char* text) {
    for (const uint32_t number : {99u, 0x7fffffffu, 0xffffffffu}) {
      std::memcpy(&value, &number, sizeof value);
      ck_assert_str_eq(name(value), text);
    }
  };
  strange(fs_primitive_name, FS_PRIMITIVE_POINT, "an unknown fs_primitive");
  strange(fs_profile_kind_name, FS_PROFILE_NONE, "an unknown fs_profile_kind");
  strange(fs_sense_name, FS_SENSE_ATTRACTIVE, "an unknown fs_sense");
  strange(fs_object_state_name, FS_OBJECT_FELT, "an unknown fs_object_state");
  strange(fs_event_kind_name, FS_EVENT_NONE, "an unknown fs_event_kind");
  strange(fs_realtime_name, FS_REALTIME_NONE, "an unknown fs_realtime");
}
END_TEST

START_TEST(pointers_that_may_be_null) {
  World w;
  const Scene scene = make_scene();
  const Servo servo = [&] {
    fs_servo* raw = nullptr;
    OK(fs_servo_start(scene.get(), w.spare_device.get(), nullptr, &raw));  // defaults: a thread of its own
    return Servo(raw);
  }();
  EXPECT(FS_ERROR_UNSUPPORTED, fs_servo_step(servo.get(), 1));
  EXPECT(FS_ERROR_UNSUPPORTED, fs_server_start(w.servo, "dds:0", nullptr, &new_server));
  OK(made(&new_server, fs_server_start(w.lone_servo, w.other_endpoint.c_str(), nullptr, &new_server)));
  OK(fs_scene_get_clients(w.connected, nullptr, 0, &w.count));
  OK(fs_scene_get_views(w.connected, nullptr, 0, &w.count));
  OK(fs_scene_get_record(w.connected, 0, nullptr, 0, &w.count));
  OK(fs_scene_get_hand(w.scene, &w.state, nullptr, nullptr));
  OK(fs_scene_get_hand(w.scene, nullptr, &w.response, nullptr));
  OK(fs_scene_get_hand(w.scene, nullptr, nullptr, &w.wrench));
  OK(fs_scene_get_reports(w.scene, nullptr, 0, &w.count));
  OK(fs_scene_get_motions(w.scene, nullptr, nullptr, 0, &w.count));
  OK(fs_scene_get_motions_since(w.scene, nullptr, 0, nullptr, 0, &w.count));
  OK(fs_device_list(nullptr, 0, &w.count));
  OK(fs_servo_get_record(w.servo, nullptr, 0, &w.count));
  OK(fs_scene_get_tool(w.scene, nullptr, 0, &w.count));
}
END_TEST

START_TEST(devices_and_their_names) {
  std::vector<fs_device_entry> entries(50);
  size_t count = 0;
  OK(fs_device_list(entries.data(), entries.size(), &count));
  bool has_sim = false;
  for (size_t i = 0; i < count && i < entries.size(); ++i) {
    has_sim = has_sim || std::strncmp(entries[i].uri, "sim:", 4) == 0;
    ck_assert_ptr_nonnull(std::memchr(entries[i].label, 0, sizeof entries[i].label));
  }
  ck_assert(has_sim);
  fs_device* device = nullptr;
  const struct {
    const char* uri;
    fs_status status;
    const char* names;
  } bad[]{{"", FS_ERROR_INVALID, ""},
          {"sim", FS_ERROR_INVALID, ""},
          {":", FS_ERROR_INVALID, ""},
          {"nosuchscheme:", FS_ERROR_NOT_FOUND, "nosuchscheme"},
          {"sim:?color=red", FS_ERROR_INVALID, "color"},
          {"sim:?hand=gentle", FS_ERROR_INVALID, "hand"},
          {"sim:?hand_mass=-1", FS_ERROR_INVALID, "hand_mass"},
          {"sim:?hold=1,2", FS_ERROR_INVALID, "hold"},
          {"sim:?seed=x", FS_ERROR_INVALID, "seed"},
          {"sim:?path=/no/such/file", FS_ERROR_NOT_FOUND, "/no/such/file"},
          {"sim:?link=radio", FS_ERROR_INVALID, "link"},
          {"fake:nobody", FS_ERROR_NOT_FOUND, "no test has made"}};
  const FakeDevice fake("somebody");  // the drivers are registered now
  for (const auto& b : bad) EXPECT_SENTENCE(b.status, fs_device_open(b.uri, &device), b.names);
  ck_assert_ptr_null(device);
  for (const char* uri : {"sim:", "sim:?hand=firm&seed=3", "sim:?path=figure8&encoder=ideal&friction=0",
                          "sim:?hold=0,0.01,0",
                          "sim:?hand_mass=0.3&hand_damping=2&hand_stiffness=150&delay_ms=2&wrist=active&mass=0.2"}) {
    OK(fs_device_open(uri, &device));
    fs_device_info info = fs_device_info_init();
    OK(fs_device_get_info(device, &info));
    ck_assert_uint_ge(info.force_axes, 3);
    ck_assert_double_gt(info.force_max, 0);
    ck_assert_double_gt(info.rate, 0);
    fs_device_close(device);
  }
}
END_TEST

START_TEST(drivers_that_are_refused) {
  World w;
  struct {
    fs_status status;
    void (*spoil)(fs_driver&);
  } bad[]{{FS_ERROR_VERSION, [](fs_driver& d) { d.struct_size = 4104; }},
          {FS_ERROR_INVALID, [](fs_driver& d) { d.struct_size = 16; }},
          {FS_ERROR_INVALID, [](fs_driver& d) { d.reserved = 1; }},
          {FS_ERROR_INVALID, [](fs_driver& d) { d.scheme = nullptr; }},
          {FS_ERROR_INVALID, [](fs_driver& d) { d.scheme = ""; }},
          {FS_ERROR_INVALID, [](fs_driver& d) { d.scheme = "With-Dash"; }},
          {FS_ERROR_INVALID, [](fs_driver& d) { d.scheme = "a:b"; }},
          {FS_ERROR_INVALID, [](fs_driver& d) { d.open = nullptr; }},
          {FS_ERROR_INVALID, [](fs_driver& d) { d.close = nullptr; }},
          {FS_ERROR_INVALID, [](fs_driver& d) { d.get_info = nullptr; }},
          {FS_ERROR_INVALID, [](fs_driver& d) { d.read = nullptr; }},
          {FS_ERROR_INVALID, [](fs_driver& d) { d.write = nullptr; }},
          {FS_ERROR_EXISTS, [](fs_driver& d) { d.scheme = "sim"; }}};
  for (const auto& b : bad) {
    fs_driver driver = w.driver;
    driver.scheme = "fine";
    b.spoil(driver);
    EXPECT(b.status, fs_driver_register(&driver));
  }
  w.driver.scheme = "twice";
  OK(fs_driver_register(&w.driver));
  EXPECT_SENTENCE(FS_ERROR_EXISTS, fs_driver_register(&w.driver), "twice");
  fs_device* device = nullptr;
  // the driver's own sentence
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_device_open("twice:", &device), "nothing behind it");
}
END_TEST

int main() {
  Suite* suite = suite_create("contract");
  add_case(suite, "contract", {every_pointer_in_turn, the_others, names, pointers_that_may_be_null,
                               devices_and_their_names, drivers_that_are_refused});
  return run_suite(suite);
}
