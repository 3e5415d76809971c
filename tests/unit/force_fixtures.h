// What the tests of lib/law and lib/shape share: meshes made by code, the sentence of a refusal.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "math/pose.h"
#include "scenes/random.h"
#include "shape/shape.h"

#include <check.h>
#undef fail  // Check's, in the way of fs::fail

namespace fs::test {

using scenes::Random;
using scenes::sanitized_times;
using scenes::seeks_races;
using scenes::times;

struct Mesh {
  std::vector<Vec3> points;
  std::vector<uint32_t> triangles;

  void add(uint32_t a, uint32_t b, uint32_t c) { triangles.insert(triangles.end(), {a, b, c}); }
  size_t count() const { return triangles.size() / 3; }

  struct Corners {
    Vec3 a, b, c;
  };
  Corners corners(size_t triangle) const {
    const uint32_t* v = triangles.data() + 3 * triangle;
    return {points[v[0]], points[v[1]], points[v[2]]};
  }
  void repeat(size_t n) {  // the first n triangles again
    for (size_t i = 0; i < 3 * n; ++i) triangles.push_back(uint32_t{triangles[i]});
  }
  Ref<const Shape> shape(bool build = true) const {
    Ref<const Shape> made = make_mesh(points.data(), points.size(), triangles.data(), count());
    if (build) made->build();
    return made;
  }
};

inline Mesh moved(Mesh mesh, Vec3 by) {
  for (Vec3& p : mesh.points) p += by;
  return mesh;
}

inline Mesh turned(Mesh mesh, Quat by) {
  for (Vec3& p : mesh.points) p = rotate(by, p);
  return mesh;
}

// A mesh in which every triangle has its own three points, as in an STL file.
inline Mesh soup(const Mesh& mesh) {
  Mesh out;
  for (const uint32_t i : mesh.triangles) {
    out.triangles.push_back(static_cast<uint32_t>(out.points.size()));
    out.points.push_back(mesh.points[i]);
  }
  return out;
}

// An axis-aligned box about the origin, two triangles a face.
inline Mesh box(Vec3 half) {
  Mesh m;
  for (int i = 0; i < 8; ++i) {
    m.points.push_back({(i & 1) ? half.x : -half.x, (i & 2) ? half.y : -half.y, (i & 4) ? half.z : -half.z});
  }
  m.triangles = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
  return m;
}

// An octahedron refined `levels` times on the sphere: 8 * 4^levels triangles.
inline Mesh sphere(double radius, int levels) {
  Mesh m;
  m.points = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  m.triangles = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
    const auto middle = [&](uint32_t a, uint32_t b) {
      const auto [place, is_new] = middles.try_emplace(std::minmax(a, b), static_cast<uint32_t>(m.points.size()));
      if (is_new) m.points.push_back(normalized(m.points[a] + m.points[b]));
      return place->second;
    };
    Mesh finer;
    for (size_t i = 0; i < m.triangles.size(); i += 3) {
      const uint32_t a = m.triangles[i], b = m.triangles[i + 1], c = m.triangles[i + 2];
      const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.add(a, ab, ca);
      finer.add(ab, b, bc);
      finer.add(ca, bc, c);
      finer.add(ab, bc, ca);
    }
    m.triangles = finer.triangles;
  }
  for (Vec3& p : m.points) p = radius * p;
  return m;
}

// A torus about z.
inline Mesh torus(double radius, double tube, int around, int across) {
  Mesh m;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      const double u = 2 * std::numbers::pi * i / around, v = 2 * std::numbers::pi * j / across;
      const double r = radius + tube * std::cos(v);
      m.points.push_back({r * std::cos(u), r * std::sin(u), tube * std::sin(v)});
    }
  }
  const auto at = [&](int i, int j) { return static_cast<uint32_t>((i % around) * across + j % across); };
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      m.add(at(i, j), at(i + 1, j), at(i + 1, j + 1));
      m.add(at(i, j), at(i + 1, j + 1), at(i, j + 1));
    }
  }
  return m;
}

// A tetrahedron as sharp as `height` is small: edges of a few degrees.
inline Mesh blade(double height) {
  Mesh m;
  m.points = {{-1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0.4, height}};
  m.triangles = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
  return m;
}

// The error sentence of `action`; fails unless `action` is refused with this status.
template <class Action>
std::string refusal(fs_status status, Action&& action) {
  try {
    action();
  } catch (const Error& error) {
    ck_assert_msg(error.status == status, "status %d instead of %d: %s", error.status, status, error.text.c_str());
    return error.text;
  }
  ck_abort_msg("not refused");
  return {};
}

inline void ck_assert_says(const std::string& text, const std::string& part) {
  ck_assert_msg(text.find(part) != std::string::npos, "\"%s\" does not say \"%s\"", text.c_str(), part.c_str());
}

// A program's main: runs the tests, each with its name.
inline int run(const char* name, std::initializer_list<const TTest*> tests) {
  Suite* const suite = suite_create(name);
  TCase* const group = tcase_create(name);
  tcase_set_timeout(group, 500);
  for (const TTest* test : tests) tcase_add_test(group, test);
  suite_add_tcase(suite, group);
  SRunner* const runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed == 0 ? 0 : 1;
}

}  // namespace fs::test
