// How solids fade without a step: a fading solid must not take or release in one tick what the others hold; and what it holds
// depends on what the others hold. So each solid is there for a part of the unit interval, as long as its weight: the
// versions of one name one after the other, all others from 0 on. Where one of these parts ends the interval is cut into
// *layers*. In a layer solids are there in full or not at all, and have proxies of their own; what is felt is the mean over
// the layers, by their lengths. A layer begins and ends with length 0, so whatever happens in it then is not felt.
//
// Only solids that are felt need to be told apart: they are *chosen*. All others are in every layer.
#pragma once

#include "field/touches.h"

namespace fs {

class Layers {
 public:
  // [rt] Chooses the solids that fade and were felt in the last tick, or are new. last: null: none is known.
  void choose(std::span<const Solid> solids, const Touches::View* last, const Touches& touches) noexcept;
  // [rt] Chooses one more, which is felt now. False: it is chosen, or does not fade, or there are too many.
  bool add(std::span<const Solid> solids, uint32_t solid) noexcept;
  // [rt] Cuts the interval: at most `most` layers. False: there would be more, so the shortest have gone to their neighbours.
  bool cut(std::span<const Solid> solids, uint32_t most) noexcept;

  uint32_t count() const noexcept { return cut_count_ - 1; }
  double begin(uint32_t layer) const noexcept { return cuts_[layer]; }
  double end(uint32_t layer) const noexcept { return cuts_[layer + 1]; }
  uint64_t present(std::span<const Solid> solids, uint32_t layer) const noexcept;
  // Number of the chosen solid; most_chosen: it is not chosen.
  uint32_t number(uint32_t solid) const noexcept;
  std::span<const uint32_t> chosen() const noexcept { return {chosen_.data(), chosen_count_}; }

  // [rt] The layer of the last tick that differs least in what is there. last has one at least.
  const Layer& before(std::span<const Solid> solids, const Touches::View& last, const Layer& layer) const noexcept;
  // Whether there were more to choose than there is room for.
  bool is_crowded() const noexcept { return is_crowded_; }

 private:
  std::array<uint32_t, Touches::most_chosen> chosen_;    // numbers of solids
  std::array<bool, Touches::most_chosen> is_known_;      // from the last tick
  uint32_t chosen_count_ = 0;
  bool is_crowded_ = false;
  std::array<double, 2 * Touches::most_chosen + 2> cuts_;
  uint32_t cut_count_ = 0;
};

}  // namespace fs
