// What the subcommands of the program share: handles that let go by themselves, and errors as exceptions.
#pragma once

#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

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

inline void require(fs_status status) {
  if (status < 0) throw std::runtime_error(fs_last_error());
}

// open<Device>(fs_device_open, "sim:"): calls the library's function with a place for the handle as its last argument.
template <class Handle, class... Parameters, class... Arguments>
Handle open(fs_status (*function)(Parameters...), Arguments... arguments) {
  typename Handle::pointer handle = nullptr;
  require(function(arguments..., &handle));
  return Handle(handle);
}

inline double length(const fs_vec3& v) { return std::hypot(v.x, v.y, v.z); }

struct RunOptions {
  std::string scene, device = "sim:", record, listen;
  double duration = 0, rate = 0, force_limit = 0;  // s, Hz, N; 0: without end, the device's
};
int run(const RunOptions& options);

struct CheckOptions {
  std::string file, device = "sim:";
  double scale = 1;  // m per unit of a mesh file
};
int check(const CheckOptions& options);

struct EvaluateOptions {
  std::string scene, input = "-", object;
  double time = 0;  // s since the scene was loaded
};
int evaluate(const EvaluateOptions& options);
