#include "field/layers.h"

#include <algorithm>
#include <limits>

#include "base/bits.h"

namespace fs {
namespace {

constexpr double least_length = 1e-12;  // weights that add up to 1 do so within rounding

bool is_covered(const Solid& solid, double level) noexcept { return solid.begin <= level && level < solid.begin + solid.weight; }

// The number of a version among the chosen ones of the last tick; most_chosen: it was not chosen.
uint32_t number_in(const Touches::View& last, uint64_t version) noexcept {
  for (uint32_t i = 0; i < last.chosen_count; ++i) {
    if (last.chosen[i] == version) return i;
  }
  return Touches::most_chosen;
}

}  // namespace

void Layers::choose(std::span<const Solid> solids, const Touches::View* last, const Touches& touches) noexcept {
  chosen_count_ = 0;
  is_crowded_ = false;
  const auto fades = [](const Solid& solid) { return solid.weight < 1; };
  if (std::none_of(solids.begin(), solids.end(), fades)) return;
  bool is_known[most_solids] = {}, was_felt[most_solids] = {};
  const auto find = [&](uint32_t row, uint64_t version) {  // they are in the order of their rows
    const auto at = std::lower_bound(solids.begin(), solids.end(), row, [](const Solid& s, uint32_t r) { return s.row < r; });
    return at != solids.end() && at->row == row && at->version == version ? at - solids.begin() : std::ptrdiff_t{-1};
  };
  for (uint32_t n = 0; last && n < last->layer_count; ++n) {
    for (const Touch& touch : touches.last_touches(last->layers[n])) {
      if (const std::ptrdiff_t i = find(touch.row, touch.version); i >= 0) is_known[i] = true;
    }
    for (const Pull& pull : touches.last_pulls(last->layers[n])) {
      if (const std::ptrdiff_t i = find(pull.row, pull.version); i >= 0) was_felt[i] = true;
    }
  }
  for (uint32_t i = 0; i < solids.size(); ++i) {
    if (!fades(solids[i])) continue;
    const bool was_chosen = last && number_in(*last, solids[i].version) < Touches::most_chosen;
    const bool is_different = was_chosen && !last->do_layers_agree;
    if ((is_known[i] || was_chosen) && !was_felt[i] && !is_different) continue;
    if (chosen_count_ == chosen_.size()) {
      is_crowded_ = true;
      return;
    }
    is_known_[chosen_count_] = is_known[i] || was_chosen;
    chosen_[chosen_count_++] = i;
  }
}

bool Layers::add(std::span<const Solid> solids, uint32_t solid) noexcept {
  if (!(solids[solid].weight < 1) || number(solid) < Touches::most_chosen) return false;
  if (chosen_count_ == chosen_.size()) {
    is_crowded_ = true;
    return false;
  }
  chosen_[chosen_count_] = solid;
  is_known_[chosen_count_++] = true;
  return true;
}

uint32_t Layers::number(uint32_t solid) const noexcept {
  for (uint32_t i = 0; i < chosen_count_; ++i) {
    if (chosen_[i] == solid) return i;
  }
  return Touches::most_chosen;
}

bool Layers::cut(std::span<const Solid> solids, uint32_t most) noexcept {
  cut_count_ = 0;
  cuts_[cut_count_++] = 0;
  cuts_[cut_count_++] = 1;
  for (const uint32_t i : chosen()) {
    for (const double level : {solids[i].begin, solids[i].begin + solids[i].weight}) {
      if (level > least_length && level < 1 - least_length) cuts_[cut_count_++] = level;
    }
  }
  std::sort(cuts_.begin(), cuts_.begin() + cut_count_);
  cut_count_ = static_cast<uint32_t>(std::unique(cuts_.begin(), cuts_.begin() + cut_count_) - cuts_.begin());
  const bool has_all = cut_count_ <= most + 1;
  while (cut_count_ > most + 1) {
    uint32_t shortest = 0;
    for (uint32_t i = 1; i + 1 < cut_count_; ++i) {
      if (cuts_[i + 1] - cuts_[i] < cuts_[shortest + 1] - cuts_[shortest]) shortest = i;
    }
    const auto gone = cuts_.begin() + std::max(1u, shortest);
    std::copy(gone + 1, cuts_.begin() + cut_count_, gone);
    --cut_count_;
  }
  return has_all;
}

uint64_t Layers::present(std::span<const Solid> solids, uint32_t layer) const noexcept {
  uint64_t out = ~uint64_t{0};
  const double middle = 0.5 * (cuts_[layer] + cuts_[layer + 1]);
  for (uint32_t i = 0; i < chosen_count_; ++i) {
    if (!is_covered(solids[chosen_[i]], middle)) out &= ~bit_of(i);
  }
  return out;
}

// A solid that is new is compared as the version from which it takes over, whose proxies it gets. One that was told apart in the
// last tick, and is not any more, is in all layers now: `compared` says which of the last tick's have been looked at already.
// Of layers that differ equally little, the one that overlaps most is taken.
const Layer& Layers::before(std::span<const Solid> solids, const Touches::View& last, const Layer& layer) const noexcept {
  const Layer* best = &last.layers[0];
  double best_overlap = 0;
  int least = std::numeric_limits<int>::max();
  for (uint32_t n = 0; n < last.layer_count; ++n) {
    const Layer& other = last.layers[n];
    int differences = 0;
    uint64_t compared = 0;
    for (uint32_t i = 0; i < chosen_count_; ++i) {
      const Solid& solid = solids[chosen_[i]];
      const uint64_t version = is_known_[i] ? solid.version : solid.takes_over;
      if (version == 0) continue;  // new in all layers
      const uint32_t number = number_in(last, version);
      if (number < Touches::most_chosen) compared |= bit_of(number);
      const bool was_there = number == Touches::most_chosen || (other.present & bit_of(number));
      differences += was_there != ((layer.present & bit_of(i)) != 0);
    }
    for (const Solid& solid : solids) {  // those that are told apart no more are in all layers
      if (last.chosen_count == 0) break;
      const uint32_t number = number_in(last, solid.version);
      if (number < Touches::most_chosen && !(compared & bit_of(number))) differences += !(other.present & bit_of(number));
    }
    const double overlap = std::min(layer.end, other.end) - std::max(layer.begin, other.begin);
    if (differences < least || (differences == least && overlap > best_overlap)) {
      least = differences;
      best_overlap = overlap;
      best = &other;
    }
  }
  return *best;
}

}  // namespace fs
