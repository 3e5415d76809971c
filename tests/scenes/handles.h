// How tests make what they use.
#pragma once

#include <vector>

#include <forceserver/forceserver.hpp>

namespace scenes {

using forceserver::Curve;
using forceserver::Device;
using forceserver::Scene;
using forceserver::Server;
using forceserver::Servo;
using forceserver::Shape;
using forceserver::Surface;
using forceserver::Tool;

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
fs_surface_settings sticky(double static_friction, double dynamic_friction, double slip_distance);
Surface make_surface(const fs_surface_settings& settings);
Surface make_texture(const fs_surface_settings& settings, const std::vector<double>& heights);

}  // namespace scenes
