// One proxy: where a point of a tool would be if no solid object let it through (the god-object of Zilles & Salisbury, "A
// constraint-based god-object method for haptic display", IROS 1995), and how it goes after the hand.
//
// For each solid object near the point there is a *touch*, with the proxy in the object's frame. There the proxy goes
// straight ways only, from exactly where the last one ended, and each way is tested against the surface (crossing.h). So it
// never gets through, however the object and the hand move; there is no tolerance in metres.
#pragma once

#include <array>

#include "field/evaluate.h"
#include "force/crossing.h"

namespace fs {

// A row that is solid and near the tool.
struct Solid {
  uint32_t row = 0;
  uint64_t version = 0;         // of the row
  uint64_t takes_over = 0;      // version of the row whose weight it takes over, and its proxies; 0: of none
  const Object* object = nullptr;
  const Motion* motion = nullptr;
  double weight = 1;
  const Law::Parsers* parsers = nullptr;
  Hint* hints = nullptr;        // of each point; may be null
  double start = 0;             // s, of the profiles
  // Worked out by feel().
  Pose pose{};                  // now
  double begin = 0;             // 0..1, where its part of the unit interval begins: see Proxies::fade
  Wrench wrench{}, felt{};      // N, N m: of the contact and of the profiles, in full
  Mat3 stiffness{}, felt_stiffness{};  // N/m, of the same
  bool is_touched = false;
  Vec3 proxy{};                 // m, of the nearest point,
  double distance = never;      // and how far that is
};

// What is kept of a tool point and a solid from tick to tick.
struct Touch {
  uint32_t row, point;
  uint64_t version;
  Pose pose;            // of the object
  Vec3 at;              // m, object frame: the proxy, on the kept side
  Vec3 proxy;           // m, scene frame
  Vec3 spring;          // N, of the contact's spring
  Vec3 rest;            // N, what is left of a jump
  double fading;        // s, for which it is left
  Side side;            // that is kept
  bool is_touching, is_fading;
};
// A solid that shares a proxy.
struct Member {
  Solid* solid;
  Touch* touch;
  const Touch* before;  // null: there was none
  bool is_taken_over;   // before is that of another version
};
struct Plane {
  Vec3 normal;
  double offset;       // normal * x >= offset
  double margin;       // m, by which it lies above the surface
  uint32_t member;
};
// Planes that hold a point.
struct Planes {
  std::array<Plane, 3> planes;
  std::array<double, 3> shares;  // how far each pushes it along its normal, m
  uint32_t plane_count = 0;

  // [rt] The place nearest to `hand` that all of them allow. Planes that do not push are dropped. False: there is none.
  bool hold(Vec3 hand, Vec3& goal) noexcept;
  // [rt] Unit vectors that span the normals; returns how many.
  uint32_t span(Vec3 (&basis)[3]) const noexcept;
  // [rt] The part of a way that leads along all of the planes.
  Vec3 along(Vec3 way) const noexcept;
  // [rt] Whether a place lies on one of them, but for rounding, which grows with the way of the push, m.
  bool is_on_one(Vec3 place, double way) const noexcept;
};

inline constexpr uint32_t most_solids = 256;  // near a tool

// The proxy of a point for all solids of the same stiffness that the point feels.
struct Proxy : Planes {
  std::array<Member, most_solids> members;
  uint32_t count = 0;
  Vec3 at{};              // m, scene frame
  Vec3 held{};            // m, how far friction holds it back
  bool is_stuck = false;  // by friction

  // [rt] Objects that have moved take the proxy with them: one that touches it with friction always, any other when it would
  // pass over it.
  void carry() noexcept;
  // [rt] Moves it as near to the hand as it gets.
  void slide(Vec3 hand, bool was_touching) noexcept;
  // [rt] How far friction can hold the proxy back, m, if some planes hold it at `goal` against the hand.
  // of_all: where another version of an object is there too, the larger coefficient of the two counts.
  double friction_reach(const Planes& by, Vec3 hand, Vec3 goal, bool of_all) const noexcept;

 private:
  bool find_hit(Vec3 to, Plane& out, Vec3& place, double& part) const noexcept;
  bool is_free_to(Vec3 place) const noexcept;
  void go(Vec3 to) noexcept;
};

// [rt] The plane of one member that stops its proxy on the way to a place; place: where, scene frame; part: of the way.
bool find_plane(const Member& member, Vec3 to, Plane& out, Vec3& place, double& part) noexcept;

// [rt] A proxy lies above the surface by this much, m: more than rounding makes of coordinates as large as these of the
// object's frame.
double margin_at(const Pose& pose, Vec3 from, Vec3 to) noexcept;

}  // namespace fs
