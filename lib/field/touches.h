// What a reader keeps of its touches from one tick to the next.
#pragma once

#include <array>

#include "field/proxy.h"

namespace fs {

class Touches {
 public:
  static constexpr uint32_t most = 2048;

  // What belongs to a view: where the points of its tool are, and its touches, in the order of rows and points.
  struct View {
    uint64_t what = 0;            // see Memory::look; 0: nothing is known
    uint32_t begin = 0, end = 0;  // of its touches
    double reach = 0;             // m, how far a proxy was from its point at most
    std::array<Vec3, FS_TOOL_POINTS_MAX> hand;  // m, the points
  };

  // [rt] Begins a tick: what is there becomes what was before.
  void begin() noexcept {
    current_ = 1 - current_;
    forget(ticks_[current_]);
  }
  // [rt] Forgets everything.
  void forget() noexcept {
    for (Tick& tick : ticks_) forget(tick);
  }

  // [rt] A view of this tick, to which touches are added from now on.
  View& begin_view(uint32_t view, uint64_t what) noexcept {
    View& out = ticks_[current_].views[view];
    out.what = what;
    out.begin = out.end = ticks_[current_].count;
    out.reach = 0;
    return out;
  }
  Touch* add(View& view) noexcept {  // null: there are too many
    Tick& tick = ticks_[current_];
    if (tick.count == most) return nullptr;
    view.end = tick.count + 1;
    return &tick.touches[tick.count++];
  }

  // [rt] The view at the last tick; null: it was another, or not there.
  const View* last(uint32_t view, uint64_t what) const noexcept {
    const View& out = ticks_[1 - current_].views[view];
    return out.what == what ? &out : nullptr;
  }
  // [rt] The touch of a point with a version of a solid at the last tick; null: there was none. solid: as it is now.
  const Touch* find(const View& last, const Solid& solid, uint64_t version, uint32_t point) noexcept {
    // They mostly come in the same order as last time.
    const uint32_t count = last.end - last.begin;
    for (uint32_t k = 0; k < count; ++k) {
      if (++cursor_ >= last.end || cursor_ < last.begin) cursor_ = last.begin;
      const Touch& touch = ticks_[1 - current_].touches[cursor_];
      const bool is_of_point = touch.version == version && touch.point == point;
      if (is_of_point && (touch.row == solid.row || version != solid.version)) return &touch;
    }
    return nullptr;
  }

 private:
  struct Tick {
    std::array<View, Views::size> views;
    std::array<Touch, most> touches;  // view by view
    uint32_t count = 0;
  };
  static void forget(Tick& tick) noexcept {
    tick.count = 0;
    for (View& view : tick.views) view.what = 0;
  }

  std::array<Tick, 2> ticks_;
  uint32_t current_ = 0;  // which of them is this one, the other is the last
  uint32_t cursor_ = 0;   // of find
};

}  // namespace fs
