// One proxy: where a point of a tool would be if no solid object let it through (the god-object of Zilles & Salisbury, "A
// constraint-based god-object method for haptic display", IROS 1995), and how it goes after the hand.
//
// For each solid object near the point there is a *touch*, with the proxy in the object's frame. There the proxy goes
// straight ways only, from exactly where the last one ended, and each way is tested against the surface (crossing.h). So it
// never gets through, however the object and the hand move; there is no tolerance in metres.
//
// The law of its motion, in each tick:
// 1. Objects that have moved take the proxy along: one that it touches with friction, or one that would pass over it.
// 2. Where that takes it into another object, it goes to the nearest place that all of them allow, but no farther than
//    twice as far as the objects have moved.
// 3. Otherwise the hand is crushed: each object that contradicts the others gets a proxy of its own and pushes as if alone.
// 4. Then the proxy goes as near to the hand as the objects allow.
// 5. An object that has a proxy of its own, but does not hold the hand any more, shares that of the others again as soon
//    as the way there is free. As it gives no force then, this changes none.
#pragma once

#include <array>

#include "field/object_force.h"
#include "shape/crossing.h"

namespace fs {

// A row that is solid and near the tool.
struct Solid {
  uint32_t row = 0;
  uint64_t version = 0;         // of the row
  uint64_t takes_over = 0;      // version of the row whose weight it takes over, and its touches; 0: of none
  const Object* object = nullptr;
  const Motion* motion = nullptr;
  double weight = 1, begin = 0;  // its part of the unit interval: see layers.h
  bool replaces = false;        // an older version of the same object fades out
  const Law::Parsers* parsers = nullptr;
  Hint* hints = nullptr;        // of each point; null: none
  double start = 0;             // s, of the profiles
  bool is_bounded = false;      // its slope is less than was asked for
  // Worked out by feel().
  Pose pose{};                  // now
  // In the layer that is worked on.
  bool is_present = true, is_touched = false;
  bool is_known = false;        // it was there in the last tick
  Wrench spring{}, damping{}, felt{};  // N, N m: of the contact's spring and damping, and of the profiles
  Mat3 stiffness{}, felt_stiffness{};  // N/m, of spring and profiles
  // The mean over the layers.
  Wrench sum{};                 // N, N m; then with what is left of jumps, and with impacts
  bool is_touched_at_all = false, is_felt_at_all = false;
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
  double slipped;       // the part of its surface's slip distance, 0 to 1, since it stuck
  Side side;            // that is kept
  bool is_touching;
  Vec3 normal;  // scene frame, where the surface pushes: it is touching, and is below the texture; else 0. A unit vector where
  // its surface has an impact
};
// A solid that shares a proxy.
struct Member {
  Solid* solid;
  Touch* touch;
  const Touch* before;  // of the last tick; null: there was none
};
struct Plane {
  Vec3 normal;
  double offset;  // normal * x >= offset
  double margin;  // m, by which it lies above the surface
  uint32_t member = 0;
};
// Planes that hold a point.
struct Planes {
  std::array<Plane, 3> planes;
  std::array<double, 3> pushes;  // how far each pushes it along its normal, m
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

// How the surface is pushed.
struct Press {
  Vec3 normal{};  // unit, of the surface without its texture; 0: nothing is pushed
  double depth = 0;  // m, of the hand below the texture, along the normal
  Vec3 slope{};  // m/m, of the texture's height along the surface,
  Mat3 curvature{};  // and its curvature, 1/m

  Vec3 turned() const noexcept { return normal - slope; }  // along the normal of the texture, but longer than 1
};

// The proxy of a point for solids of the same stiffness and limit that the point feels. One with a texture is alone.
struct Proxy : Planes {
  std::array<Member, most_solids> members;
  uint32_t count = 0;
  Vec3 at{};  // m, scene frame
  double point_radius = 0;  // m, of the ball about it that planes hold
  Vec3 held{};  // m, how far friction holds it back
  bool is_stuck = false;  // by friction
  uint32_t* visits = nullptr;  // that are left for tests of ways; null: without end

  // [rt] Points 1 to 3 of the law. Members that contradict the others are put behind the first `count` and no longer belong
  // to it; returns how many.
  uint32_t carry() noexcept;
  // [rt] Point 4 of the law.
  void slide(Vec3 hand, bool was_touching) noexcept;
  // [rt] Whether no member is in the way to a place. except: a member that is not asked; count: none.
  bool is_free_to(Vec3 place, uint32_t except) const noexcept;
  bool is_free_to(Vec3 place) const noexcept { return is_free_to(place, count); }
  // [rt] How deep the hand is below the texture when its proxy, held by the surface without friction, is at `place`.
  Press press_at(Vec3 hand, Vec3 place) const noexcept;

 private:
  bool find_hit(Vec3 to, Plane& out, Vec3& place, double& part) const noexcept;
  bool find_place(Vec3& out) const noexcept;
  uint32_t split() noexcept;
  void go(Vec3 to) noexcept;
  bool has_friction() const noexcept;
  // How far friction can hold the proxy back, m, if its planes hold it at `goal` against the hand, and it is `lag` behind
  // (m, along them): what is farther behind slips.
  double friction_reach(Vec3 hand, Vec3 goal, double lag) noexcept;
};

// [rt] A proxy lies above the surface by this much, m: more than rounding makes of coordinates as large as these of the
// object's frame.
double margin_at(const Pose& pose, Vec3 from, Vec3 to) noexcept;

}  // namespace fs
