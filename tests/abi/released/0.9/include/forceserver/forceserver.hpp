// forceserver.hpp - the C functions for C++17 and later: handles that give themselves back, and errors as exceptions. Written
// by bindings/cpp/make_hpp.py from the C headers, whose comments hold here.
//
//     using namespace forceserver;
//     Scene scene = Scene::create();
//     fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
//     spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 5);
//     scene.object_set(spring);
//     Device device = Device::open("sim:");
//     Servo servo = Servo::start(scene, device);
//
// A method is the function of its name: scene.get_time() calls fs_scene_get_time, scene.object_set(o) calls fs_object_set. What a
// function writes to `out` the method returns. Where nothing may be thrown, as in a loop of your own in real time, call the C
// function: fs_evaluate(tool.get(), ..).
// A class is a std::unique_ptr of the C handle, and is empty until a static function makes one. As with a pointer, what it points
// at can be changed through a const one.
#ifndef FORCESERVER_FORCESERVER_HPP
#define FORCESERVER_FORCESERVER_HPP

#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <forceserver/forceserver.h>

namespace forceserver {

// A call that failed; what() is fs_last_error().
class Error : public std::runtime_error {
 public:
  explicit Error(fs_status status) : std::runtime_error(fs_last_error()), status_(status) {}
  Error(fs_status status, const std::string& text) : std::runtime_error(text), status_(status) {}
  fs_status status() const noexcept { return status_; }

 private:
  fs_status status_;
};

inline void throw_on_error(fs_status status) {
  if (status < 0) throw Error(status);
}

// To the C functions a string ends at its first byte 0.
inline const char* c_string(const std::string& text, const char* name) {
  if (text.find('\0') != std::string::npos) throw Error(FS_ERROR_INVALID, std::string(name) + " has a byte 0, must be without");
  return text.c_str();
}

template <auto give_back>
struct GiveBack {
  template <class T>
  void operator()(T* handle) const noexcept {
    give_back(handle);
  }
};

// What Scene::object_get returns: an fs_object with its shape and curves, which it gives back.
class Object : public fs_object {
 public:
  Object() : fs_object(fs_object_init("", FS_PRIMITIVE_POINT)) {}
  Object(Object&& other) noexcept : Object() { std::swap(static_cast<fs_object&>(*this), static_cast<fs_object&>(other)); }
  Object& operator=(Object&& other) noexcept {
    std::swap(static_cast<fs_object&>(*this), static_cast<fs_object&>(other));
    return *this;
  }
  ~Object() { fs_object_release(this); }
};

// A whole list, also where it grows meanwhile. f(out, capacity, count) calls the C function.
template <class T, class F>
std::vector<T> list_of(F&& f) {
  std::vector<T> out(64);
  for (std::size_t count = 0;; out.resize(count + 64)) {
    throw_on_error(f(out.data(), out.size(), &count));
    if (count > out.size()) continue;
    out.resize(count);
    return out;
  }
}

inline fs_pose pose_from_z(fs_vec3 position, fs_vec3 direction) {
  fs_pose out{};
  throw_on_error(fs_pose_from_z(position, direction, &out));
  return out;
}
inline void profile_evaluate(const fs_profile& profile, double max_stiffness, double t, const double* distances,
    size_t count, double* forces) {
  throw_on_error(fs_profile_evaluate(&profile, max_stiffness, t, distances, count, forces));
}
inline void object_evaluate_law(const fs_object& object, double max_stiffness, double t, const double* distances,
    size_t count, double* forces) {
  throw_on_error(fs_object_evaluate_law(&object, max_stiffness, t, distances, count, forces));
}
inline void surface_set_impact(fs_surface_settings* settings, fs_impact impact) {
  throw_on_error(fs_surface_set_impact(settings, impact));
}
inline fs_pose frame_to_scene(const fs_frame& frame, const fs_pose& pose) {
  fs_pose out{};
  throw_on_error(fs_frame_to_scene(&frame, &pose, &out));
  return out;
}
inline fs_pose frame_to_device(const fs_frame& frame, const fs_pose& pose) {
  fs_pose out{};
  throw_on_error(fs_frame_to_device(&frame, &pose, &out));
  return out;
}
inline fs_pose motion_at(const fs_motion& motion, double time) {
  fs_pose out{};
  throw_on_error(fs_motion_at(&motion, time, &out));
  return out;
}
inline std::vector<fs_device_entry> device_list() {
  return list_of<fs_device_entry>([&](fs_device_entry* out, std::size_t capacity, std::size_t* count) {
    return fs_device_list(out, capacity, count);
  });
}

// The force-objects of one application.
class Scene : public std::unique_ptr<fs_scene, GiveBack<fs_scene_destroy>> {
 public:
  using unique_ptr::unique_ptr;
  static Scene create() {
    fs_scene* out = nullptr;
    throw_on_error(fs_scene_create(&out));
    return Scene(out);
  }
  static Scene connect(const std::string& endpoint, const std::string& client_name) {
    fs_scene* out = nullptr;
    throw_on_error(fs_scene_connect(c_string(endpoint, "endpoint"), c_string(client_name, "client_name"), &out));
    return Scene(out);
  }
  void object_set(const fs_object& object) const { throw_on_error(fs_object_set(get(), &object)); }
  Object object_get(const std::string& name) const {
    Object out;
    throw_on_error(fs_object_get(get(), c_string(name, "name"), &out));
    return out;
  }
  void object_change(const fs_object& object, uint32_t parts) const { throw_on_error(fs_object_change(get(), &object, parts)); }
  void object_move(const std::string& name, const fs_pose& pose, const fs_twist* twist, double time) const {
    throw_on_error(fs_object_move(get(), c_string(name, "name"), &pose, twist, time));
  }
  void object_remove(const std::string& name) const { throw_on_error(fs_object_remove(get(), c_string(name, "name"))); }
  void clear() const { throw_on_error(fs_scene_clear(get())); }
  void begin() const { throw_on_error(fs_scene_begin(get())); }
  void commit() const { throw_on_error(fs_scene_commit(get())); }
  void cancel() const { throw_on_error(fs_scene_cancel(get())); }
  void sync(double timeout) const { throw_on_error(fs_scene_sync(get(), timeout)); }
  void save(const std::string& path) const { throw_on_error(fs_scene_save(get(), c_string(path, "path"))); }
  void load(const std::string& path) const { throw_on_error(fs_scene_load(get(), c_string(path, "path"))); }
  void set_frame(const fs_frame& frame) const { throw_on_error(fs_scene_set_frame(get(), &frame)); }
  fs_frame get_frame(const char* client = nullptr) const {
    fs_frame out = fs_frame_init();
    throw_on_error(fs_scene_get_frame(get(), client, &out));
    return out;
  }
  void set_clutch(bool held) const { throw_on_error(fs_scene_set_clutch(get(), held)); }
  void set_tool(const fs_vec3* points, size_t count) const { throw_on_error(fs_scene_set_tool(get(), points, count)); }
  std::vector<fs_vec3> get_tool() const {
    return list_of<fs_vec3>([&](fs_vec3* out, std::size_t capacity, std::size_t* count) {
      return fs_scene_get_tool(get(), out, capacity, count);
    });
  }
  void set_tool_radius(double radius) const { throw_on_error(fs_scene_set_tool_radius(get(), radius)); }
  double get_tool_radius() const {
    double out{};
    throw_on_error(fs_scene_get_tool_radius(get(), &out));
    return out;
  }
  fs_view get_view(const char* client = nullptr) const {
    fs_view out{};
    throw_on_error(fs_scene_get_view(get(), client, &out));
    return out;
  }
  void set_accuracy(double newtons) const { throw_on_error(fs_scene_set_accuracy(get(), newtons)); }
  void set_max_stiffness(double stiffness) const { throw_on_error(fs_scene_set_max_stiffness(get(), stiffness)); }
  double get_time() const {
    double out{};
    throw_on_error(fs_scene_get_time(get(), &out));
    return out;
  }
  void set_time(double time) const { throw_on_error(fs_scene_set_time(get(), time)); }
  std::vector<fs_report> get_reports() const {
    return list_of<fs_report>([&](fs_report* out, std::size_t capacity, std::size_t* count) {
      return fs_scene_get_reports(get(), out, capacity, count);
    });
  }
  fs_report get_report(const std::string& name) const {
    fs_report out{};
    throw_on_error(fs_scene_get_report(get(), c_string(name, "name"), &out));
    return out;
  }
  std::vector<fs_motion> get_motions(const char* client = nullptr) const {
    return list_of<fs_motion>([&](fs_motion* out, std::size_t capacity, std::size_t* count) {
      return fs_scene_get_motions(get(), client, out, capacity, count);
    });
  }
  std::vector<fs_motion> get_motions_since(const char* client, uint64_t since) const {
    return list_of<fs_motion>([&](fs_motion* out, std::size_t capacity, std::size_t* count) {
      return fs_scene_get_motions_since(get(), client, since, out, capacity, count);
    });
  }
  fs_event next_event(double timeout) const {
    fs_event out{};
    throw_on_error(fs_scene_next_event(get(), timeout, &out));
    return out;
  }
  void evaluate_field(const char* name, double time, const fs_vec3* positions, size_t count, fs_vec3* forces) const {
    throw_on_error(fs_evaluate_field(get(), name, time, positions, count, forces));
  }
  void stop_force() const { throw_on_error(fs_scene_stop_force(get())); }
  void resume_force() const { throw_on_error(fs_scene_resume_force(get())); }
  void get_hand(fs_state* state = nullptr, fs_response* response = nullptr, fs_wrench* sent = nullptr) const {
    throw_on_error(fs_scene_get_hand(get(), state, response, sent));
  }
  fs_servo_stats get_servo_stats() const {
    fs_servo_stats out = fs_servo_stats_init();
    throw_on_error(fs_scene_get_servo_stats(get(), &out));
    return out;
  }
  fs_device_info get_device_info() const {
    fs_device_info out = fs_device_info_init();
    throw_on_error(fs_scene_get_device_info(get(), &out));
    return out;
  }
  std::vector<fs_recorded_tick> get_record(uint64_t after) const {
    return list_of<fs_recorded_tick>([&](fs_recorded_tick* out, std::size_t capacity, std::size_t* count) {
      return fs_scene_get_record(get(), after, out, capacity, count);
    });
  }
  std::vector<fs_client> get_clients() const {
    return list_of<fs_client>([&](fs_client* out, std::size_t capacity, std::size_t* count) {
      return fs_scene_get_clients(get(), out, capacity, count);
    });
  }
  std::vector<fs_client_view> get_views() const {
    return list_of<fs_client_view>([&](fs_client_view* out, std::size_t capacity, std::size_t* count) {
      return fs_scene_get_views(get(), out, capacity, count);
    });
  }
};

// The points of a polyline or triangles of a mesh; immutable, shared by objects.
class Shape : public std::unique_ptr<fs_shape, GiveBack<fs_shape_destroy>> {
 public:
  using unique_ptr::unique_ptr;
  static Shape create_polyline(const fs_vec3* points, size_t count, bool closed) {
    fs_shape* out = nullptr;
    throw_on_error(fs_shape_create_polyline(points, count, closed, &out));
    return Shape(out);
  }
  static Shape create_mesh(const fs_vec3* points, size_t point_count, const uint32_t* triangles, size_t triangle_count) {
    fs_shape* out = nullptr;
    throw_on_error(fs_shape_create_mesh(points, point_count, triangles, triangle_count, &out));
    return Shape(out);
  }
  static Shape load(const std::string& path, double scale) {
    fs_shape* out = nullptr;
    throw_on_error(fs_shape_load(c_string(path, "path"), scale, &out));
    return Shape(out);
  }
  void build() const { throw_on_error(fs_shape_build(get())); }
  double get_progress() const {
    double out{};
    throw_on_error(fs_shape_get_progress(get(), &out));
    return out;
  }
  fs_shape_info get_info() const {
    fs_shape_info out = fs_shape_info_init();
    throw_on_error(fs_shape_get_info(get(), &out));
    return out;
  }
  Shape retain() const { return Shape(fs_shape_retain(get())); }  // one more of the same
};

// A custom profile function; immutable, shared by profiles.
class Curve : public std::unique_ptr<fs_curve, GiveBack<fs_curve_destroy>> {
 public:
  using unique_ptr::unique_ptr;
  static Curve create_table(const double* forces, size_t count, double step) {
    fs_curve* out = nullptr;
    throw_on_error(fs_curve_create_table(forces, count, step, &out));
    return Curve(out);
  }
  static Curve create_expression(const std::string& text) {
    fs_curve* out = nullptr;
    throw_on_error(fs_curve_create_expression(c_string(text, "text"), &out));
    return Curve(out);
  }
  Curve retain() const { return Curve(fs_curve_retain(get())); }  // one more of the same
};

// What a solid object's surface does, such as stick and slip; immutable, shared by objects.
class Surface : public std::unique_ptr<fs_surface, GiveBack<fs_surface_destroy>> {
 public:
  using unique_ptr::unique_ptr;
  static Surface create(const fs_surface_settings& settings) {
    fs_surface* out = nullptr;
    throw_on_error(fs_surface_create(&settings, &out));
    return Surface(out);
  }
  static Surface create_texture(const fs_surface_settings& settings, const double* heights, size_t count) {
    fs_surface* out = nullptr;
    throw_on_error(fs_surface_create_texture(&settings, heights, count, &out));
    return Surface(out);
  }
  static Surface create_expression(const fs_surface_settings& settings, const std::string& text) {
    fs_surface* out = nullptr;
    throw_on_error(fs_surface_create_expression(&settings, c_string(text, "text"), &out));
    return Surface(out);
  }
  fs_surface_settings get_settings() const {
    fs_surface_settings out = fs_surface_settings_init();
    throw_on_error(fs_surface_get_settings(get(), &out));
    return out;
  }
  Surface retain() const { return Surface(fs_surface_retain(get())); }  // one more of the same
};

// What touches a scene in an application's own loop, with its memory of contacts.
class Tool : public std::unique_ptr<fs_tool, GiveBack<fs_tool_destroy>> {
 public:
  using unique_ptr::unique_ptr;
  static Tool create(const Scene& scene, const fs_vec3* points, size_t count) {
    fs_tool* out = nullptr;
    throw_on_error(fs_tool_create(scene.get(), points, count, &out));
    return Tool(out);
  }
  fs_response evaluate(const fs_state& state) const {
    fs_response out{};
    throw_on_error(fs_evaluate(get(), &state, &out));
    return out;
  }
  void tool_reset() const { throw_on_error(fs_tool_reset(get())); }
};

// A haptic device or the simulator.
class Device : public std::unique_ptr<fs_device, GiveBack<fs_device_close>> {
 public:
  using unique_ptr::unique_ptr;
  static Device open(const std::string& uri) {
    fs_device* out = nullptr;
    throw_on_error(fs_device_open(c_string(uri, "uri"), &out));
    return Device(out);
  }
  fs_device_info get_info() const {
    fs_device_info out = fs_device_info_init();
    throw_on_error(fs_device_get_info(get(), &out));
    return out;
  }
  fs_state read() const {
    fs_state out{};
    throw_on_error(fs_device_read(get(), &out));
    return out;
  }
  void write(const fs_wrench& wrench) const { throw_on_error(fs_device_write(get(), &wrench)); }
  fs_answer control(const std::string& request) const {
    fs_answer out{};
    throw_on_error(fs_device_control(get(), c_string(request, "request"), &out));
    return out;
  }
};

// The loop between a scene and a device.
class Servo : public std::unique_ptr<fs_servo, GiveBack<fs_servo_stop>> {
 public:
  using unique_ptr::unique_ptr;
  static Servo start(const Scene& scene, const Device& device, const fs_servo_options* options = nullptr) {
    fs_servo* out = nullptr;
    throw_on_error(fs_servo_start(scene.get(), device.get(), options, &out));
    return Servo(out);
  }
  void step(uint64_t ticks) const { throw_on_error(fs_servo_step(get(), ticks)); }
  void set_enabled(bool enabled) const { throw_on_error(fs_servo_set_enabled(get(), enabled)); }
  std::vector<fs_tick> get_record() const {
    return list_of<fs_tick>([&](fs_tick* out, std::size_t capacity, std::size_t* count) {
      return fs_servo_get_record(get(), out, capacity, count);
    });
  }
};

// Lets other processes connect to a servo.
class Server : public std::unique_ptr<fs_server, GiveBack<fs_server_stop>> {
 public:
  using unique_ptr::unique_ptr;
  static Server start(const Servo& servo, const std::string& endpoint, const fs_server_options* options = nullptr) {
    fs_server* out = nullptr;
    throw_on_error(fs_server_start(servo.get(), c_string(endpoint, "endpoint"), options, &out));
    return Server(out);
  }
};

// A group of changes, open from here on: commit() makes all of them felt from one tick on, and where it is not called the
// destructor takes them back. A group belongs to its thread, and its scene must outlive it.
class Group {
 public:
  explicit Group(const Scene& scene) : scene_(scene.get()) { throw_on_error(fs_scene_begin(scene_)); }
  Group(const Group&) = delete;
  Group& operator=(const Group&) = delete;
  ~Group() {
    if (scene_) fs_scene_cancel(scene_);
  }
  void commit() {
    throw_on_error(fs_scene_commit(scene_));
    scene_ = nullptr;
  }

 private:
  fs_scene* scene_;
};

}  // namespace forceserver

#endif
