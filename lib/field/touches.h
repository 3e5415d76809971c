// What a reader keeps of its touches from one tick to the next: for each view its layers (layers.h), for each layer the
// touches and the pulls of its solids.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <span>
#include <tuple>

#include "field/impacts.h"
#include "field/proxy.h"

namespace fs {

// The solids of a view while some of them fade: see layers.h.
struct Layer {
  double begin = 0, end = 1;                 // the part of the unit interval
  uint64_t present = ~uint64_t{0};           // bit i: the chosen solid i of the view is there
  uint32_t first_touch = 0, end_touch = 0;   // in the order of points and proxies
  uint32_t point_count = 0;                  // of the tool, and where the touches of each begin
  std::array<uint16_t, FS_TOOL_POINTS_MAX> first_of_point;
  uint32_t first_pull = 0, end_pull = 0;
  double length() const noexcept { return end - begin; }
};

// What a solid gave in a layer.
struct Pull {
  uint32_t row;
  uint64_t version;
  Wrench spring;   // N, N m: of the contact, within its limit
  Wrench profile;  // N, N m
};

// What remains of jumps of the force, and is still taken away.
struct Rests {
  struct Rest {
    uint64_t version;  // of the solid that jumped; 0: of none that is still there, or of several
    Wrench wrench;     // N, N m
  };
  double time = 0;     // s, for which it is left
  uint32_t count = 0;
  static constexpr uint32_t most = 16;
  std::array<Rest, most> rests;

  std::span<const Rest> all() const noexcept { return {rests.data(), count}; }
  // [rt] As it is `step` seconds after another tick; null: nothing is left.
  void begin(const Rests* last, double step) noexcept {
    count = 0;
    time = last ? std::max(0.0, last->time - step) : 0;
    if (!(time > 0)) return;
    for (const Rest& rest : last->all()) add(rest.version, (time / last->time) * rest.wrench);
  }
  void add(uint64_t version, const Wrench& wrench) noexcept {  // [rt]
    uint32_t i = 0;
    while (i < count && rests[i].version != version) ++i;
    if (i == rests.size()) rests[--i].version = 0;  // full: it is added to the last, so that the sum stays right
    if (i == count) rests[count++] = {version, {}};
    rests[i].wrench = rests[i].wrench + wrench;
  }
};

class Touches {
 public:
  static constexpr uint32_t most = 4096, most_layers = 8, most_chosen = 64;
  static constexpr uint32_t most_pulls = most_layers * most_solids;

  struct View {
    uint64_t what = 0;  // see Memory::look; 0: nothing is known
    double reach = 0;   // m, how far a proxy was from its point at most
    std::array<Vec3, FS_TOOL_POINTS_MAX> hand, velocity;  // m, m/s: the points
    bool do_layers_agree = true;   // the pulls are the same in all layers
    bool has_all_layers = true;    // there were not too many
    bool has_all_pulls = true;     // there were not too many
    uint32_t layer_count = 0, chosen_count = 0;
    std::array<Layer, most_layers> layers;
    std::array<uint64_t, most_chosen> chosen;  // versions of the solids that layers tell apart
    Rests rests;
    Impacts impacts;
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

  // [rt] A view of this tick, to which layers are added, and to these touches and pulls.
  View& begin_view(uint32_t view, uint64_t what) noexcept {
    Tick& tick = ticks_[current_];
    View& out = tick.views[view];
    out.what = what;
    tick.begun = {tick.touch_count, tick.pull_count};
    restart(out);
    return out;
  }
  // How many touches are left for the view that was begun last and those after it.
  uint32_t room() const noexcept { return most - ticks_[current_].begun.first; }
  // [rt] Takes back all layers of the view that was begun last.
  void restart(View& view) noexcept {
    Tick& tick = ticks_[current_];
    std::tie(tick.touch_count, tick.pull_count) = tick.begun;
    view.reach = 0;
    view.layer_count = view.chosen_count = 0;
    view.do_layers_agree = view.has_all_layers = view.has_all_pulls = true;
  }
  Layer& add_layer(View& view, double begin, double end, uint64_t present) noexcept {
    assert(view.layer_count < most_layers && begin < end);
    const Tick& tick = ticks_[current_];
    Layer& out = view.layers[view.layer_count++];
    out.begin = begin;
    out.end = end;
    out.present = present;
    out.first_touch = out.end_touch = tick.touch_count;
    out.first_pull = out.end_pull = tick.pull_count;
    out.point_count = 0;
    return out;
  }
  // [rt] From now on touches of the next point are added to the layer.
  void begin_point(Layer& layer) noexcept {
    layer.first_of_point[layer.point_count++] = static_cast<uint16_t>(ticks_[current_].touch_count);
  }
  Touch* add_touch(Layer& layer) noexcept {  // null: there are too many
    Tick& tick = ticks_[current_];
    if (tick.touch_count == most) return nullptr;
    layer.end_touch = tick.touch_count + 1;
    return &tick.touches[tick.touch_count++];
  }
  void add_pull(View& view, Layer& layer, const Pull& pull) noexcept {
    Tick& tick = ticks_[current_];
    view.has_all_pulls &= tick.pull_count < most_pulls;
    if (!view.has_all_pulls) return;
    tick.pulls[tick.pull_count++] = pull;
    layer.end_pull = tick.pull_count;
  }

  // [rt] Touches and pulls of this tick and of the last one.
  std::span<const Touch> touches(const Layer& layer) const noexcept { return touches_of(ticks_[current_], layer); }
  std::span<const Touch> last_touches(const Layer& layer) const noexcept { return touches_of(ticks_[1 - current_], layer); }
  std::span<const Pull> pulls(const Layer& layer) const noexcept { return pulls_of(ticks_[current_], layer); }
  std::span<const Pull> last_pulls(const Layer& layer) const noexcept { return pulls_of(ticks_[1 - current_], layer); }

  // [rt] The view at the last tick; null: it was another, or not there.
  const View* last(uint32_t view, uint64_t what) const noexcept {
    const View& out = ticks_[1 - current_].views[view];
    return out.what == what ? &out : nullptr;
  }
  // [rt] The touch of a point with a version of a solid in a layer of the last tick; null: there was none.
  const Touch* find(const Layer& layer, uint64_t version, uint32_t point) noexcept {
    if (point >= layer.point_count) return nullptr;
    const uint32_t first = layer.first_of_point[point];
    const uint32_t end = point + 1 < layer.point_count ? layer.first_of_point[point + 1] : layer.end_touch;
    for (uint32_t k = first; k < end; ++k) {  // they mostly come in the same order as last time
      if (++cursor_ >= end || cursor_ < first) cursor_ = first;
      const Touch& touch = ticks_[1 - current_].touches[cursor_];
      if (touch.version == version) return &touch;
    }
    return nullptr;
  }

 private:
  struct Tick {
    std::array<View, Views::size> views;
    std::array<Touch, most> touches;  // view by view, layer by layer
    std::array<Pull, most_pulls> pulls;
    uint32_t touch_count = 0, pull_count = 0;
    std::pair<uint32_t, uint32_t> begun;  // the counts when the last view began
  };
  static void forget(Tick& tick) noexcept {
    tick.touch_count = tick.pull_count = 0;
    for (View& view : tick.views) view.what = 0;
  }
  static std::span<const Touch> touches_of(const Tick& tick, const Layer& layer) noexcept {
    return std::span(tick.touches).subspan(layer.first_touch, layer.end_touch - layer.first_touch);
  }
  static std::span<const Pull> pulls_of(const Tick& tick, const Layer& layer) noexcept {
    return std::span(tick.pulls).subspan(layer.first_pull, layer.end_pull - layer.first_pull);
  }

  std::array<Tick, 2> ticks_;
  uint32_t current_ = 0;  // which of them is this one, the other is the last
  uint32_t cursor_ = 0;   // of find
};

}  // namespace fs
