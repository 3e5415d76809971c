#include "scenes/reference.h"

#include <array>
#include <cmath>
#include <limits>
#include <tuple>

namespace scenes {
namespace {

using Real = long double;
constexpr Real infinite = std::numeric_limits<Real>::infinity();

struct Vec {
  Real x = 0, y = 0, z = 0;
  Vec() = default;
  Vec(Real x_, Real y_, Real z_) : x(x_), y(y_), z(z_) {}
  Vec(fs_vec3 v) : x(v.x), y(v.y), z(v.z) {}
};
Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec operator*(Real s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
Real dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
Real norm(Vec a) { return std::sqrt(dot(a, a)); }
fs_vec3 rounded(Vec a) { return {static_cast<double>(a.x), static_cast<double>(a.y), static_cast<double>(a.z)}; }

// A rotation as a matrix by its columns.
struct Turn {
  Vec x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  Vec operator*(Vec v) const { return v.x * x + v.y * y + v.z * z; }
  Vec back(Vec v) const { return {dot(x, v), dot(y, v), dot(z, v)}; }
};

Turn turn_of(fs_quat q) {
  const Real w = q.w, i = q.x, j = q.y, k = q.z, n = w * w + i * i + j * j + k * k;
  if (n == 0) return {};
  const Real s = 2 / n;
  return {{1 - s * (j * j + k * k), s * (i * j + w * k), s * (i * k - w * j)},
          {s * (i * j - w * k), 1 - s * (i * i + k * k), s * (j * k + w * i)},
          {s * (i * k + w * j), s * (j * k - w * i), 1 - s * (i * i + j * j)}};
}

// v turned by |r| about r (Rodrigues).
Vec turned(Vec r, Vec v) {
  const Real angle = norm(r);
  if (angle == 0) return v;
  const Vec a = (1 / angle) * r;
  return std::cos(angle) * v + std::sin(angle) * cross(a, v) + (1 - std::cos(angle)) * dot(a, v) * a;
}

// Where an object is at a time, and how it moves.
struct Placed {
  Vec origin, linear, angular;
  Turn turn;
};

Placed place(const fs_object& object, Real time) {
  const Real since = time - object.time, dt = std::fmin(std::fmax(since, 0), 0.1L);
  Placed placed;
  placed.origin = Vec(object.pose.position) + dt * Vec(object.twist.linear);
  const Turn turn = turn_of(object.pose.orientation);
  const Vec r = dt * Vec(object.twist.angular);
  placed.turn = {turned(r, turn.x), turned(r, turn.y), turned(r, turn.z)};
  if (since >= 0 && since < 0.1L) {  // after 0.1 s it stands still
    placed.linear = object.twist.linear;
    placed.angular = object.twist.angular;
  }
  return placed;
}

Vec closest_on_segment(Vec a, Vec b, Vec x) {
  const Vec e = b - a;
  const Real n = dot(e, e);
  return n == 0 ? a : a + std::fmin(std::fmax(dot(x - a, e) / n, 0), 1) * e;
}

}  // namespace

long double profile_force(const fs_profile& p, const Function* curve, long double d, long double t) {
  if (p.kind == FS_PROFILE_NONE || (p.reach > 0 && d > p.reach)) return 0;
  Real f = 0;
  if (p.gain == 0) return std::fmin(std::fmax(p.offset, 0), p.limit);  // also for d = 0 and an infinite d
  switch (p.kind) {
    case FS_PROFILE_CONSTANT: f = p.gain; break;
    case FS_PROFILE_LINEAR_INCREASING:
    case FS_PROFILE_LINEAR_DECREASING: f = p.gain * d + p.offset; break;
    case FS_PROFILE_GAUSSIAN: f = p.gain * std::exp(-(d / p.width) * (d / p.width) / 2); break;
    case FS_PROFILE_QUADRATIC: f = p.gain * d * d + p.offset; break;
    case FS_PROFILE_INVERSE: f = p.gain / d + p.offset; break;
    case FS_PROFILE_CUSTOM: {
      const Real value = (*curve)(d, t);
      f = p.gain * (value > 0 && value < infinite ? value : 0);
      break;
    }
    default: break;
  }
  return std::fmin(std::fmax(f, 0), static_cast<Real>(p.limit));
}

// A shape with the data that the search through all triangles needs.
struct Reference::Solid {
  struct Hit {
    Vec p;
    Vec normal;  // of a mesh: counter-clockwise, angle-weighted on an edge or vertex
  };
  std::vector<Vec> points;
  std::vector<std::array<uint32_t, 3>> triangles;
  bool is_closed = false;  // a polyline: as given; a mesh: its triangles use every edge once in each direction

  explicit Solid(const fs_shape* shape) {
    size_t count = 0;
    const fs_vec3* p = fs_shape_get_points(shape, &count);
    points.assign(p, p + count);
    const uint32_t* t = fs_shape_get_triangles(shape, &count);
    for (size_t i = 0; i < count; ++i) triangles.push_back({t[3 * i], t[3 * i + 1], t[3 * i + 2]});
    fs_shape_info info = fs_shape_info_init();
    require(fs_shape_get_info(shape, &info), "fs_shape_get_info");
    is_closed = triangles.empty() ? info.closed : has_no_border();
  }

  Hit closest_on_line(Vec x) const {
    Hit best{points[0], {}};
    for (size_t i = 0; i + 1 < points.size() + (is_closed ? 1 : 0); ++i) {
      const Vec p = closest_on_segment(points[i], points[(i + 1) % points.size()], x);
      if (norm(x - p) < norm(x - best.p)) best.p = p;
    }
    return best;
  }

  Hit closest_on_mesh(Vec x) const {
    Vec best;
    Real nearest = infinite;
    for (const auto& t : triangles) {
      const Vec p = closest_on_triangle(t, x);
      if (norm(x - p) < nearest) {
        nearest = norm(x - p);
        best = p;
      }
    }
    Vec normal;  // of all triangles that share p, weighted with the angle they fill there
    for (const auto& t : triangles) {
      const Vec n = normal_of(t);
      if (norm(n) > 0 && norm(closest_on_triangle(t, best) - best) <= 1e-15L * (1 + norm(best))) {
        normal = normal + angle_at(t, best) / norm(n) * n;
      }
    }
    return {best, normal};
  }

  // The winding number of a closed mesh: 1 inside, 0 outside (sum of solid angles; van Oosterom & Strackee 1983).
  Real winding_number(Vec x) const {
    Real sum = 0;
    for (const auto& t : triangles) {
      const Vec a = points[t[0]] - x, b = points[t[1]] - x, c = points[t[2]] - x;
      const Real la = norm(a), lb = norm(b), lc = norm(c);
      sum += std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
    }
    return sum / (2 * std::acos(-1.0L));
  }

 private:
  Vec normal_of(const std::array<uint32_t, 3>& t) const {
    return cross(points[t[1]] - points[t[0]], points[t[2]] - points[t[0]]);
  }

  Vec closest_on_triangle(const std::array<uint32_t, 3>& t, Vec x) const {
    const Vec a = points[t[0]], b = points[t[1]], c = points[t[2]], n = normal_of(t);
    if (norm(n) > 0) {
      const Vec foot = x - dot(x - a, n) / dot(n, n) * n;
      if (dot(cross(b - a, foot - a), n) >= 0 && dot(cross(c - b, foot - b), n) >= 0 &&
          dot(cross(a - c, foot - c), n) >= 0) {
        return foot;
      }
    }
    Vec best = closest_on_segment(a, b, x);
    for (const Vec p : {closest_on_segment(b, c, x), closest_on_segment(c, a, x)}) {
      if (norm(x - p) < norm(x - best)) best = p;
    }
    return best;
  }

  // The angle that a triangle fills around a point p on it: the corner's angle, pi on an edge, 2 pi inside.
  Real angle_at(const std::array<uint32_t, 3>& t, Vec p) const {
    const Real pi = std::acos(-1.0L);
    for (int i = 0; i < 3; ++i) {
      const Vec a = points[t[i]], u = points[t[(i + 1) % 3]] - a, v = points[t[(i + 2) % 3]] - a;
      const Real tiny = 1e-12L * (norm(u) + norm(v));
      if (norm(p - a) < tiny) return std::atan2(norm(cross(u, v)), dot(u, v));
    }
    for (int i = 0; i < 3; ++i) {
      const Vec a = points[t[i]], b = points[t[(i + 1) % 3]];
      if (norm(p - closest_on_segment(a, b, p)) < 1e-12L * norm(b - a)) return pi;
    }
    return 2 * pi;
  }

  bool has_no_border() const {
    using Point = std::tuple<Real, Real, Real>;
    std::map<std::pair<Point, Point>, int> runs;
    auto key = [&](uint32_t i) { return Point(points[i].x, points[i].y, points[i].z); };
    for (const auto& t : triangles) {
      for (int i = 0; i < 3; ++i) ++runs[{key(t[i]), key(t[(i + 1) % 3])}];
    }
    for (const auto& [edge, count] : runs) {
      const auto other = runs.find({edge.second, edge.first});
      if (count != 1 || other == runs.end() || other->second != 1) return false;
    }
    return true;
  }
};

struct Reference::Part {
  fs_object object;
  const Function *front = nullptr, *back = nullptr;
  std::shared_ptr<const Solid> solid;

  // The force on a point of the tool that is at x and moves at v.
  Vec force(const Placed& placed, Vec x, Vec v, Real time, Real radius) const {
    const Vec local = placed.turn.back(x - placed.origin);
    Vec away, normal;  // from p to x; of a surface, at d = 0
    bool is_front = true, has_sides = false;
    switch (object.primitive) {
      case FS_PRIMITIVE_PLANE:
        away = {0, 0, local.z};
        normal = {0, 0, 1};
        is_front = local.z >= 0;
        has_sides = true;
        break;
      case FS_PRIMITIVE_POLYLINE: away = local - solid->closest_on_line(local).p; break;
      case FS_PRIMITIVE_MESH: {
        const Solid::Hit hit = solid->closest_on_mesh(local);
        away = local - hit.p;
        normal = 1 / norm(hit.normal) * hit.normal;
        is_front = solid->is_closed ? solid->winding_number(local) < 0.5L : dot(away, hit.normal) >= 0;
        has_sides = true;
        break;
      }
      default: away = local; break;
    }
    const Real d = norm(away);
    if (d == 0 && !has_sides) return {};
    const Vec outwards = placed.turn * (d == 0 ? normal : 1 / d * away);
    const fs_profile& profile = d == 0 || is_front ? object.front : object.back;
    const Real f = profile_force(profile, d == 0 || is_front ? front : back, std::fmax(0, d - radius), time - object.start);
    if (!(static_cast<double>(f) > 0)) return {};  // the tail of a gaussian ends where a double does
    const Vec object_velocity = placed.linear + cross(placed.angular, x - placed.origin);
    const Vec sum = (profile.sense == FS_SENSE_REPULSIVE ? f : -f) * outwards -
                    static_cast<Real>(object.damping) * (v - object_velocity);
    const Real size = norm(sum);
    return size > profile.limit ? profile.limit / size * sum : sum;
  }
};

Reference::Reference(const Content& content) {
  std::map<const fs_shape*, std::shared_ptr<const Solid>> solids;
  for (const fs_object& object : content.objects) {
    Part part{object, nullptr, nullptr, nullptr};
    if (object.front.curve) part.front = &content.functions.at(object.front.curve);
    if (object.back.curve) part.back = &content.functions.at(object.back.curve);
    if (object.shape) {
      auto& solid = solids[object.shape];
      if (!solid) solid = std::make_shared<const Solid>(object.shape);
      part.solid = solid;
    }
    parts_.push_back(part);
  }
}

Reference::~Reference() = default;

Felt Reference::evaluate(const fs_state& state, const std::vector<fs_vec3>& tool, bool with_stiffness,
                         double radius) const {
  const Vec origin = state.pose.position, linear = state.twist.linear, angular = state.twist.angular;
  const Turn turn = turn_of(state.pose.orientation);
  const Real h = 1e-7L;
  Vec force, torque, ahead[3], behind[3];
  Felt felt{};
  for (const Part& part : parts_) {
    const fs_object& object = part.object;
    if (!object.enabled || (object.lifetime > 0 && state.time > object.time + object.lifetime)) continue;
    const Placed placed = place(object, state.time);
    std::vector<Vec> feeling;  // arms from the tool's origin
    for (size_t i = 0; i < tool.size(); ++i) {
      if (object.tool_points == 0 || (object.tool_points >> i & 1)) feeling.push_back(turn * Vec(tool[i]));
    }
    Real largest = 0;
    for (const Vec arm : feeling) {
      const Vec x = origin + arm, v = linear + cross(angular, arm);
      const Real share = 1.0L / feeling.size();
      const Vec f = share * part.force(placed, x, v, state.time, radius);
      force = force + f;
      torque = torque + cross(arm, f);
      largest = std::fmax(largest, norm(f));
      if (!with_stiffness) continue;
      const Vec steps[3]{{h, 0, 0}, {0, h, 0}, {0, 0, h}};
      for (int k = 0; k < 3; ++k) {
        ahead[k] = ahead[k] + 1 / h * (share * part.force(placed, x + steps[k], v, state.time, radius) - f);
        behind[k] = behind[k] + 1 / h * (f - share * part.force(placed, x - steps[k], v, state.time, radius));
      }
    }
    felt.felt_count += largest >= 1e-30L;
    felt.faint_count += largest > 0 && largest < 1e-30L;
  }
  felt.wrench = {rounded(force), rounded(torque)};
  const fs_vec3 cx = rounded(0.5L * (ahead[0] + behind[0])), cy = rounded(0.5L * (ahead[1] + behind[1])),
                cz = rounded(0.5L * (ahead[2] + behind[2]));
  felt.stiffness = {cx.x, cy.x, cz.x, cx.y, cy.y, cz.y, cx.z, cy.z, cz.z};
  for (int k = 0; k < 3; ++k) {
    felt.roughness = std::fmax(felt.roughness, static_cast<double>(norm(ahead[k] - behind[k])));
  }
  return felt;
}

}  // namespace scenes
