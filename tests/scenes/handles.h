// Handles of the C functions that release themselves.
#pragma once

#include <memory>

#include <forceserver/forceserver.h>

namespace scenes {

struct Release {
  void operator()(fs_scene* p) const { fs_scene_destroy(p); }
  void operator()(fs_shape* p) const { fs_shape_destroy(p); }
  void operator()(fs_curve* p) const { fs_curve_destroy(p); }
  void operator()(fs_tool* p) const { fs_tool_destroy(p); }
  void operator()(fs_device* p) const { fs_device_close(p); }
  void operator()(fs_servo* p) const { fs_servo_stop(p); }
  void operator()(fs_server* p) const { fs_server_stop(p); }
};
using Scene = std::unique_ptr<fs_scene, Release>;
using Shape = std::unique_ptr<fs_shape, Release>;
using Curve = std::unique_ptr<fs_curve, Release>;
using Tool = std::unique_ptr<fs_tool, Release>;
using Device = std::unique_ptr<fs_device, Release>;
using Servo = std::unique_ptr<fs_servo, Release>;
using Server = std::unique_ptr<fs_server, Release>;

// These functions prepare a test. When the library refuses, they end the program with its error sentence.
[[noreturn]] void stop_with_last_error(const char* what);
inline void require(fs_status status, const char* what) {
  if (status != FS_OK) stop_with_last_error(what);
}
Scene make_scene();
Tool make_tool(fs_scene* scene);  // of one point
Device open_device(const char* uri);
Servo start_servo(fs_scene* scene, fs_device* device, const fs_servo_options& options);
Shape make_polyline(const fs_vec3* points, size_t count, bool closed);
Curve make_table(const double* forces, size_t count, double step);
Curve make_expression(const char* text);

}  // namespace scenes
