// The proxies of a reader, one tick after the other, and the forces of solid objects: each draws the hand to its proxy.
//
// Objects of the same stiffness share a proxy, which none of them lets through: where several meet, the spring to it acts
// once. (If one comes to have the stiffness of another by a change, they share it from where both let the hand go.) Objects of another stiffness have another proxy. Each spring is the gradient of its own energy then, so that it
// makes none, whatever the stiffnesses.
#pragma once

#include <array>
#include <memory>

#include "base/seqlock.h"
#include "field/touches.h"

namespace fs {

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
  // [rt] Begins a tick: what was kept in the last one is what was before.
  void begin(double now) noexcept;
  // [rt] Forgets everything.
  void forget() noexcept { touches_.forget(); }

  // [rt] Collects the solids of a view, in the order of their rows. What is too much is not felt.
  void collect(const Solid& solid) noexcept {
    if (solid_count_ < most_solids) solids_[solid_count_++] = solid;
  }
  // [rt] Adds what the collected solids give to the tool: contacts, and their profiles at the proxies. view, what: as
  // Memory::look has them; another `what`, and all touches of the view begin anew. effort: of the profiles; null: without end.
  void feel(uint32_t view, uint64_t what, const ToolState& tool, Effort* effort, fs_response& out) noexcept;

  // Of the newest view. False: nothing has been felt yet. Any thread.
  bool read(FeltSolids& out) const noexcept { return newest_.read(out); }

  // m: how far a proxy was from its point at most in the last tick of the view.
  double reach(uint32_t view, uint64_t what) const noexcept {
    const Touches::View* const last = touches_.last(view, what);
    return last ? last->reach : 0;
  }

 private:
  void feel_proxy(const Touches::View* last, uint32_t point, const ToolState& tool) noexcept;
  bool replaces_touched(const Solid& solid) const noexcept;
  void begin_touch(const Touches::View* last, Member& member) noexcept;
  void stack_versions() noexcept;
  void fade(Vec3 hand, double k) noexcept;
  void push(const Touches::View* last, uint32_t point, const ToolState& tool) noexcept;
  void add_profiles(uint32_t point, const ToolState& tool, Effort* effort, double& error) noexcept;

  double now_ = 0, step_ = 0, blend_ = 0;  // s
  std::array<Solid, most_solids> solids_;
  uint32_t solid_count_ = 0;
  Touches touches_;
  struct Before {
    const Touch* touch;  // of the last tick; null: there was none
    bool is_of_older;    // of the version whose weight this one takes over
  };
  std::array<Before, most_solids> before_;  // of the solids, for the point that is worked on
  Proxy proxy_;           // the one that is worked on
  std::array<Vec3, most_solids> damping_;  // N, of its members
  std::array<Plane, most_solids> own_;     // planes of its members, of each alone
  std::array<double, 2 * most_solids> levels_;
  FeltSolids felt_;       // that is put together
  Latest<FeltSolids> newest_;
};

}  // namespace fs
