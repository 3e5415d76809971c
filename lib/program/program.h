// What the commands of the program share: handles that release themselves, and errors as exceptions.
#pragma once

#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <forceserver/driver.h>
#include <forceserver/forceserver.h>

// Exit codes: all is well; the scene or the run has something odd; it could not be done.
enum { exit_fine = 0, exit_odd = 1, exit_failed = 2 };

template <auto release>
struct Release {
  void operator()(auto* handle) const { release(handle); }
};
using Scene = std::unique_ptr<fs_scene, Release<fs_scene_destroy>>;
using Shape = std::unique_ptr<fs_shape, Release<fs_shape_destroy>>;
using Device = std::unique_ptr<fs_device, Release<fs_device_close>>;
using Servo = std::unique_ptr<fs_servo, Release<fs_servo_stop>>;
using Server = std::unique_ptr<fs_server, Release<fs_server_stop>>;

struct Failure : std::runtime_error {
  explicit Failure(fs_status why) : std::runtime_error(fs_last_error()), status(why) {}
  fs_status status;
};
inline void require(fs_status status) {
  if (status < 0) throw Failure(status);
}

// open<Device>(fs_device_open, "sim:") calls the function, which returns the handle through its last parameter.
template <class Handle, class... Parameters, class... Arguments>
Handle open(fs_status (*function)(Parameters...), Arguments... arguments) {
  typename Handle::pointer handle = nullptr;
  require(function(arguments..., &handle));
  return Handle(handle);
}

// get_list(fs_scene_get_reports, scene) returns a whole list, also when the list grows meanwhile.
template <class Entry>
std::vector<Entry> get_list(fs_status (*function)(fs_scene*, Entry*, std::size_t, std::size_t*), fs_scene* scene) {
  std::vector<Entry> list(64);
  for (std::size_t count = 0;; list.resize(count + 64)) {
    require(function(scene, list.data(), list.size(), &count));
    if (count > list.size()) continue;
    list.resize(count);
    return list;
  }
}

inline double length(const fs_vec3& v) { return std::hypot(v.x, v.y, v.z); }
inline fs_vec3 minus(const fs_vec3& a, const fs_vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline fs_vec3 rotate(const fs_quat& q, const fs_vec3& v) {
  const fs_vec3 t = {2 * (q.y * v.z - q.z * v.y), 2 * (q.z * v.x - q.x * v.z), 2 * (q.x * v.y - q.y * v.x)};
  return {v.x + q.w * t.x + q.y * t.z - q.z * t.y, v.y + q.w * t.y + q.z * t.x - q.x * t.z,
          v.z + q.w * t.z + q.x * t.y - q.y * t.x};
}

// file: the library of a device driver of one's own; empty: none.
inline void load_driver(const std::string& file) {
  if (!file.empty()) require(fs_driver_load(file.c_str()));
}

struct RunOptions {
  std::string scene, device = "sim:", driver, record, listen;
  double duration = 0, rate = 0, force_limit = 0;  // s, Hz, N; 0: without end, the device's rate, the device's limit
  double client_force = 0;                         // N; 0: the servo's limit
  bool locked = false, all_users = false, no_stop = false;
};
int run(const RunOptions& options);

struct DevicesOptions {
  std::string driver;
  bool json = false;
};
int devices(const DevicesOptions& options);

struct CheckOptions {
  std::string file, device = "sim:", driver;
  double scale = 1;  // m per unit of a mesh file
};
int check(const CheckOptions& options);

struct EvaluateOptions {
  std::string scene, input = "-", object;
  double time = 0;  // s since the scene was loaded
};
int evaluate(const EvaluateOptions& options);

// server: NAME, or an endpoint in full.
struct ClientsOptions {
  std::string server;
  bool json = false;
};
int clients(const ClientsOptions& options);

struct WatchOptions {
  std::string server;
  double interval = 0.5;  // s
  unsigned count = 0;     // looks; 0: without end
  bool json = false;
};
int watch(const WatchOptions& options);

int resume(const std::string& server);
int stop(const std::string& server);
