// The proxies of a reader, one tick after the other, and the forces of solid objects: each draws the hand to its proxy
// (proxy.h, point_proxies.h).
//
// No step: while solids fade, the force is a mean over layers (layers.h), whose lengths change by no more than the weights
// do. What changes in a layer by more than the ways of hand and objects explain, such as when a proxy falls over the edge
// of a shelf, is a jump: the difference goes on as a force of these solids, and falls to 0 within 20 ms.
#pragma once

#include <array>

#include "base/seqlock.h"
#include "field/layers.h"
#include "field/point_proxies.h"

namespace fs {

// What solids gave at a tick, for whoever asks.
struct FeltSolids {
  static constexpr uint32_t size = 64;  // most
  struct Felt {
    uint64_t version = 0;  // of the row
    Wrench wrench;         // N, N m, in full
    Vec3 point;            // m, scene frame: the proxy that is nearest to its point
    double distance;       // m, between the two
  };
  uint64_t what = 0;       // the view
  uint64_t count = 0;
  std::array<Felt, size> felt;

  size_t bytes() const noexcept { return sizeof *this - (size - count) * sizeof(Felt); }  // that have something
  const Felt* find(uint64_t version) const noexcept {
    for (uint64_t i = 0; i < count; ++i) {
      if (felt[i].version == version) return &felt[i];
    }
    return nullptr;
  }
};

class Proxies {
 public:
  // [rt] Begins a tick: what was kept in the last one is what was before. views: how many are felt in it at most.
  void begin(double now, uint32_t views) noexcept;
  // [rt] Forgets everything.
  void forget() noexcept { touches_.forget(); }

  // [rt] Collects the solids of a view, in the order of their rows. Of too many, those are felt that hold the hand already.
  // view, what: as Memory::look has them.
  void collect(uint32_t view, uint64_t what, const Solid& solid) noexcept {
    if (solid_count_ < most_solids) solids_[solid_count_++] = solid;
    else replace_one(view, what, solid);
  }
  // [rt] Adds what the collected solids give to the tool: contacts, and their profiles at the proxies. Another `what`,
  // and all touches of the view begin anew. effort: of the profiles; null: without end.
  void feel(uint32_t view, uint64_t what, const ToolState& tool, Effort* effort, fs_response& out) noexcept;

  // Of the newest view. False: nothing has been felt yet. Any thread.
  bool read(FeltSolids& out) const noexcept { return newest_.read(out); }

  // m: how far a proxy was from its point at most in the last tick of the view.
  double reach(uint32_t view, uint64_t what) const noexcept {
    const Touches::View* const last = touches_.last(view, what);
    return last ? last->reach : 0;
  }

 private:
  // What the layers of a tick give besides what they add to the solids.
  struct Sum {
    Mat3 stiffness{};  // N/m
    double error = 0;  // N
    double spring_change = 0, profile_change = 0;  // see PointProxies::Gain
    std::array<Vec3, FS_TOOL_POINTS_MAX> pull{};        // of the points, see PointProxies::Gain
    std::array<double, FS_TOOL_POINTS_MAX> pulled_by{};
  };

  std::span<Solid> solids() noexcept { return {solids_.data(), solid_count_}; }
  void replace_one(uint32_t view, uint64_t what, const Solid& solid) noexcept;
  void feel_layers(Touches::View& here, const Touches::View* last, const ToolState& tool, Effort* effort, Sum& out) noexcept;
  void begin_layer(const Layer& layer) noexcept;
  void end_layer(Touches::View& here, Layer& layer, const ToolState& tool, Sum& out) noexcept;
  void spread_jump(Wrench Pull::* part, std::span<const Layer> then, std::span<const Layer> now, double length, double explained,
                   Rests& out) noexcept;
  bool is_same(const Layer& before) const noexcept;
  static bool tells_apart(const Touches::View& last, const Touches::View& here) noexcept;
  bool choose_felt() noexcept;
  bool do_layers_agree(const Touches::View& view) const noexcept;
  bool was_free(const Touches::View* last, const Impacts::Source& source, uint32_t point) const noexcept;
  void add_rests(Rests& rests, fs_response& out) noexcept;
  void feel_impacts(Touches::View& here, const Touches::View* last, const ToolState& tool, fs_response& out) noexcept;
  void tell(const Touches::View& here, uint64_t what, const ToolState& tool, const Sum& sum, fs_response& out) noexcept;

  double now_ = 0, step_ = 0;  // s
  uint32_t views_left_ = 0;    // that are still to be felt in this tick
  std::array<Solid, most_solids> solids_;
  uint32_t solid_count_ = 0;
  Layers layers_;
  Touches touches_;
  PointProxies points_;
  FeltSolids felt_;       // that is put together
  Latest<FeltSolids> newest_;
};

}  // namespace fs
