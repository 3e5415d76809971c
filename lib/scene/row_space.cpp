#include "scene/row_space.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <functional>

#include "base/error.h"

namespace fs {
namespace {

constexpr double half_range = 1 << 20;  // cells

// The lower 21 bits, with two bits of room between each.
uint64_t spread(uint64_t v) noexcept {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffff;
  v = (v | v << 16) & 0x1f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  v = (v | v << 2) & 0x1249249249249249;
  return v;
}

}  // namespace

uint64_t RowSpace::code_of(Vec3 position) const noexcept {
  const auto cell = [this](double x) {
    return static_cast<uint64_t>(std::clamp(std::floor(x / cell_) + half_range, 0.0, 2 * half_range - 1));
  };
  return spread(cell(position.x)) | spread(cell(position.y)) << 1 | spread(cell(position.z)) << 2;
}

uint32_t RowSpace::row_in(uint32_t chunk) const noexcept {
  return chunk * chunk_size + static_cast<uint32_t>(std::countr_one(spaces_[chunk].taken));
}

uint64_t RowSpace::place_of(Vec3 position, double size) noexcept {
  // The smallest object so far tells how fine the cells must be. Finer cells move no row; only later rows are placed better.
  if (size > 1e-9 && size < 1e9 && (cell_ == 0 || size < 2 * cell_)) cell_ = size / 4;
  return cell_ > 0 ? code_of(position) : 0;
}

uint32_t RowSpace::find(Vec3 position, double size, uint64_t used) {
  reclaim(used);
  const uint64_t code = place_of(position, size);
  // The chunk where the place is, or one of its neighbours in this order.
  constexpr int neighbours = 3;
  auto before = order_.upper_bound(code), after = before;
  for (int k = 0; k < neighbours; ++k) {
    if (before != order_.begin() && ~spaces_[(--before)->second].taken != 0) return row_in(before->second);
    if (after == order_.end()) continue;
    if (~spaces_[after->second].taken != 0) return row_in(after->second);
    ++after;
  }
  // Another chunk, behind those that begin in the same place.
  const uint32_t chunk = closed_.empty() ? chunks_end() : closed_.front();
  if (chunk == chunk_count) {
    const auto open = std::find_if(spaces_.begin(), spaces_.end(), [](const Space& s) { return ~s.taken != 0; });
    if (open == spaces_.end())
      fail(FS_ERROR_FULL, "the scene holds %u versions of objects: its maximum", chunk_count * chunk_size);
    return row_in(static_cast<uint32_t>(open - spaces_.begin()));
  }
  const auto place = order_.emplace(code, chunk);
  try {
    if (chunk == spaces_.size()) spaces_.emplace_back();
    closed_.reserve(spaces_.capacity());  // so that rows can always be released
    leaving_.reserve(spaces_.capacity());
  } catch (...) {
    order_.erase(place);
    throw;
  }
  if (!closed_.empty() && closed_.front() == chunk) {
    std::pop_heap(closed_.begin(), closed_.end(), std::greater<>());
    closed_.pop_back();
  }
  spaces_[chunk] = {0, 0, 0, place};
  return row_in(chunk);
}

void RowSpace::release(uint32_t row, uint64_t sequence) noexcept {
  Space& space = spaces_[row / chunk_size];
  assert((space.taken & ~space.leaving) >> row % chunk_size & 1);
  if (space.leaving == 0) leaving_.push_back(row / chunk_size);
  space.leaving |= uint64_t{1} << row % chunk_size;
  space.leaves_at = sequence;
}

void RowSpace::reclaim(uint64_t used) noexcept {
  std::erase_if(leaving_, [&](uint32_t chunk) {
    Space& space = spaces_[chunk];
    if (space.leaves_at > used) return false;
    space.taken &= ~space.leaving;
    space.leaving = 0;
    if (space.taken != 0) return true;
    order_.erase(space.place);
    closed_.push_back(chunk);
    std::push_heap(closed_.begin(), closed_.end(), std::greater<>());
    return true;
  });
}

}  // namespace fs
