// The proxies of a reader: where the points of a tool would be if no solid object let them through (the god-object of
// Zilles & Salisbury, "A constraint-based god-object method for haptic display", IROS 1995). A solid object draws the hand
// to its proxy.
//
// For each tool point and each solid object near it a *touch* is kept, with the proxy in the object's frame. There the
// proxy goes straight ways only, from exactly where the last one ended, and each way is tested against the surface
// (crossing.h). So it never gets through, however the object and the hand move; there is no tolerance in metres.
//
// Objects of the same stiffness share a proxy, which none of them lets through: where several meet, the spring to it acts
// once. Objects of another stiffness have another proxy. Each spring is the gradient of its own energy then, so that it
// makes none, whatever the stiffnesses.
#pragma once

#include <array>
#include <memory>

#include "base/seqlock.h"
#include "field/evaluate.h"
#include "force/crossing.h"

namespace fs {

// A row that is solid and near the tool.
struct Solid {
  uint32_t row = 0;
  uint64_t version = 0;         // of the row
  const Object* object = nullptr;
  const Motion* motion = nullptr;
  double weight = 1;
  const Law::Parsers* parsers = nullptr;
  double start = 0;             // s, of the profiles
  // Worked out by feel().
  Pose pose{};                  // now
  Wrench wrench{}, felt{};      // N, N m: of the contact and of the profiles, in full
  Mat3 stiffness{};
  bool is_touched = false;
  Vec3 proxy{};                 // m, of the nearest point,
  double distance = never;      // and how far that is
};

// What solids gave at a tick, for whoever asks.
struct FeltSolids {
  static constexpr uint32_t size = 24;  // most
  struct Felt {
    uint64_t version = 0;  // of the row
    Wrench wrench;         // N, N m, in full
    Vec3 point;            // m, scene frame: the proxy that is nearest to its point
    double distance;       // m, between the two
  };
  uint64_t what = 0;       // the view
  uint64_t count = 0;
  std::array<Felt, size> felt;

  const Felt* find(uint64_t version) const noexcept {
    for (uint64_t i = 0; i < count; ++i) {
      if (felt[i].version == version) return &felt[i];
    }
    return nullptr;
  }
};

class Proxies {
 public:
  static constexpr uint32_t most_solids = 256, most_touches = 2048;

  // [rt] Begins a tick: what was kept in the last one is what was before.
  void begin(double now) noexcept;
  // [rt] Forgets everything.
  void forget() noexcept;

  // [rt] Collects the solids of a view, in the order of their rows. What is too much is not felt.
  void collect(const Solid& solid) noexcept {
    if (solid_count_ < most_solids) solids_[solid_count_++] = solid;
  }
  // [rt] Adds what the collected solids give to the tool: contacts, and their profiles at the proxies. view, what: as
  // Memory::look has them; another `what`, and all touches of the view begin anew.
  void feel(uint32_t view, uint64_t what, const ToolState& tool, fs_response& out) noexcept;

  // Of the newest view. False: nothing has been felt yet. Any thread.
  bool read(FeltSolids& out) const noexcept { return newest_.read(out); }

  // m: how far a proxy was from its point at most in the last tick of the view.
  double reach(uint32_t view, uint64_t what) const noexcept {
    const ViewTouches& last = ticks_[1 - current_].views[view];
    return last.what == what ? last.reach : 0;
  }

 private:
  // What is kept of a tool point and a solid.
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
  struct ViewTouches {
    uint64_t what = 0;
    uint32_t begin = 0, end = 0;      // of its touches
    double reach = 0;
    bool has_hand = false;
    std::array<Vec3, FS_TOOL_POINTS_MAX> hand;  // m, the points at the last tick
  };
  // A solid that shares the proxy of a point.
  struct Member {
    Solid* solid;
    Touch* touch;
    const Touch* before;  // null: there was none
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
  };
  // Solids of the same stiffness that a point feels, and where their proxy has got to.
  struct Group : Planes {
    std::array<Member, most_solids> members;
    uint32_t count = 0;
    Vec3 proxy{};
    Vec3 held{};                   // m, how far friction holds it back
    bool is_stuck = false;         // by friction
  };

  void feel_group(const ViewTouches* last, Group& group, uint32_t point, const ToolState& tool) noexcept;
  const Touch* find_before(const ViewTouches& last, const Solid& solid, uint32_t point) noexcept;
  void begin_touch(const ViewTouches* last, Group& group, Member& member) noexcept;
  void carry(Group& group) noexcept;
  void slide(Group& group, Vec3 hand, bool was_touching) noexcept;
  static bool hold(Planes& group, Vec3 hand, Vec3& goal) noexcept;
  bool find_plane(const Member& member, Vec3 to, Plane& out, Vec3& at, double& part) const noexcept;
  void fade(Group& group, Vec3 hand, double k) noexcept;
  bool find_hit(const Group& group, Vec3 to, Plane& out, Vec3& at) const noexcept;
  void go(Group& group, Vec3 to) const noexcept;
  void push(const ViewTouches* last, Group& group, uint32_t point, const ToolState& tool) noexcept;
  void add_profiles(const Group& group, uint32_t point, const ToolState& tool) noexcept;

  double now_ = 0, step_ = 0;  // s
  std::array<Solid, most_solids> solids_;
  uint32_t solid_count_ = 0;
  struct Tick {
    std::array<ViewTouches, Views::size> views;
    std::array<Touch, most_touches> touches;  // view by view, in the order of rows and points
    uint32_t count = 0;
  };
  std::array<Tick, 2> ticks_;
  Group group_;           // the one that is worked on
  std::array<Vec3, most_solids> damping_;  // N, of its members
  std::array<Plane, most_solids> own_;     // planes of its members, of each alone
  std::array<double, 2 * most_solids> levels_;
  uint32_t cursor_ = 0;   // of find_before
  FeltSolids felt_;       // that is put together
  Latest<FeltSolids> newest_;
  uint32_t current_ = 0;  // which of them is this one, the other is the last
};

}  // namespace fs
