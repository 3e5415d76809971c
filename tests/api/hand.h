// A hand that meets solid objects, for the tests of contact.
#pragma once

#include <cmath>
#include <numbers>

#include "api/support.h"

namespace scenes {

inline constexpr double dt = 0.001;  // s

inline fs_contact solid(fs_keep keep, double stiffness = 1000, double limit = 1000) {
  fs_contact contact{};
  contact.keep = keep;
  contact.stiffness = stiffness;
  contact.limit = limit;
  return contact;
}

// A tool of one point that moves in a scene at 1 kHz.
struct Hand {
  Scene scene = make_scene();
  std::vector<Shape> shapes;
  Tool tool;
  double time = 1;
  fs_response felt{};
  fs_vec3 x{};
  bool is_placed = false;

  fs_object& put(fs_object& object, fs_contact contact) {
    object.contact = contact;
    OK(fs_object_set(scene.get(), &object));
    return object;
  }
  fs_object plane(const char* name, fs_vec3 point, fs_vec3 normal, fs_contact contact) {
    fs_object o = fs_object_init(name, FS_PRIMITIVE_PLANE);
    OK(fs_pose_from_z(point, normal, &o.pose));
    return put(o, contact);
  }
  fs_object mesh(const char* name, const MeshData& data, fs_contact contact, fs_vec3 position = {}) {
    shapes.push_back(make_mesh(data));
    fs_object o = fs_object_init(name, FS_PRIMITIVE_MESH);
    o.pose = at(position);
    o.shape = shapes.back().get();
    return put(o, contact);
  }
  // One tick.
  fs_vec3 go(fs_vec3 to) {
    if (!tool) tool = make_tool(scene.get());
    time += dt;
    fs_state state = hand_at(to, time);
    if (is_placed) state.twist.linear = (1 / dt) * (to - x);
    x = to;
    is_placed = true;
    felt = evaluate(tool.get(), state);
    return felt.wrench.force;
  }
  // In a straight line, at most 0.5 mm a tick.
  fs_vec3 slide(fs_vec3 to, double step = 0.0005) {
    const fs_vec3 from = is_placed ? x : to;
    const int count = std::max(1, static_cast<int>(std::ceil(norm(to - from) / step)));
    for (int i = 1; i <= count; ++i) go(from + (static_cast<double>(i) / count) * (to - from));
    return felt.wrench.force;
  }
  fs_vec3 proxy() const { return felt.proxy.position; }
  bool touches() const { return felt.flags & FS_RESPONSE_CONTACT; }
};

// How often the triangles of a closed mesh go round x: 1 inside, 0 outside (Van Oosterom & Strackee 1983).
inline double winding(const MeshData& m, fs_vec3 x) {
  double angle = 0;
  for (size_t t = 0; t < m.triangles.size(); t += 3) {
    const fs_vec3 a = m.points[m.triangles[t]] - x, b = m.points[m.triangles[t + 1]] - x, c = m.points[m.triangles[t + 2]] - x;
    const double la = norm(a), lb = norm(b), lc = norm(c);
    angle += 2 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
  }
  return angle / (4 * std::numbers::pi);
}

inline MeshData wedge(double degrees) {  // a roof along y with its edge at the origin
  const double a = 0.05 * std::tan(0.5 * degrees * std::numbers::pi / 180);
  MeshData m;
  m.points = {{-a, -0.05, -0.05}, {a, -0.05, -0.05}, {0, -0.05, 0}, {-a, 0.05, -0.05}, {a, 0.05, -0.05}, {0, 0.05, 0}};
  m.triangles = {0, 1, 2, 3, 5, 4, 0, 3, 4, 0, 4, 1, 1, 4, 5, 1, 5, 2, 2, 5, 3, 2, 3, 0};
  return m;
}

}  // namespace scenes
