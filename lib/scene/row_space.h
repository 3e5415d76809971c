// Which rows are free, and which of them a new object gets: one among its neighbours, so that the rows of a chunk lie
// together in space and a chunk far from the hand sleeps long. Chunks are kept in Morton order (G. M. Morton, "A computer
// oriented geodetic data base", IBM 1966) of where they begin; a chunk that is full is followed by another.
#pragma once

#include <cassert>
#include <map>
#include <vector>

#include "field/snapshot.h"

namespace fs {

class RowSpace {
 public:
  static constexpr uint32_t chunk_count = 1u << 16;  // most

  // A free row for an object there, of this size (m, may be infinite). It stays free until it is taken; a call that throws
  // (FULL, no memory) changes nothing that matters. used: sequence of the newest snapshot that has been used.
  uint32_t find(Vec3 position, double size, uint64_t used);
  void take(uint32_t row) noexcept {
    assert(!(spaces_[row / chunk_size].leaving >> row % chunk_size & 1));
    spaces_[row / chunk_size].taken |= uint64_t{1} << row % chunk_size;
  }
  // The row is free again when the snapshot `sequence` has been used, the first without it.
  void release(uint32_t row, uint64_t sequence) noexcept;
  // Objects that are added in the order of this number lie together best.
  uint64_t place_of(Vec3 position, double size) noexcept;
  uint32_t chunks_end() const noexcept { return static_cast<uint32_t>(spaces_.size()); }  // all numbers are below it

 private:
  struct Space {
    uint64_t taken = 0;       // bit i: row i is in use, or not free yet
    uint64_t leaving = 0;     // bit i: row i has been released
    uint64_t leaves_at = 0;   // sequence of the last release
    std::multimap<uint64_t, uint32_t>::iterator place;  // in order_, while it has rows
  };
  void reclaim(uint64_t used) noexcept;  // frees what was released up to there
  uint64_t code_of(Vec3 position) const noexcept;
  uint32_t row_in(uint32_t chunk) const noexcept;

  double cell_ = 0;                      // m; 0: not known yet
  std::vector<Space> spaces_;            // by chunk
  std::multimap<uint64_t, uint32_t> order_;  // where a chunk begins: its number
  std::vector<uint32_t> leaving_;        // chunks with released rows
  std::vector<uint32_t> closed_;         // chunks without a row, a heap: the lowest comes first
};

}  // namespace fs
