// How solids fade without a step. What one solid holds depends on which others are there, so it is not enough to weigh each
// force by itself. Instead each solid takes a part of the unit interval that is as long as its weight: the versions of one
// name lie one after the other, all others begin at 0. The ends of these parts cut the interval into *layers*. In a layer
// each solid is there in full or not at all, and the layer has proxies of its own. What is felt is the mean of the forces of
// all layers, weighted by their lengths. A new layer begins with length 0, and ends with it, so neither makes a step.
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
