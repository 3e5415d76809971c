// The weights by which nothing makes a step in force. Whatever comes and goes under a servo is a row of a snapshot: a
// version of an object, a view, a whole scene. The snapshot says what is wanted of the row (Want, data); the servo's
// memory has how far it has come (Weight, 0 to 1). Each tick moves each weight towards what is wanted by dt/fade at most,
// whatever was called in whatever order. That is all: no change can make a step.
//
// What cannot be adjusted (another primitive, shape or tool) is another version and so another row. The old row names the
// new one as its `next`: as soon as the old row is in full, or not felt at all, the tick lets the next begin, and from then
// on the old row is wanted out. So the two cross-fade, and a stream of versions that is faster than the fade is felt as a
// chain of full cross-fades.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <limits>

namespace fs {

inline constexpr double never = std::numeric_limits<double>::infinity();
inline constexpr uint32_t no_row = ~0u;

// What a snapshot wants of a row.
struct Want {
  uint64_t version = 0;   // of this use of the row; 0: the row is not in use
  uint64_t sequence = 0;  // of the snapshot that first wanted it so
  double expiry = never;  // s, scene time: from then on the row is wanted out
  uint32_t next = no_row; // the row that begins when this one is in full, or not felt
  bool is_in = false;

  // Tools have no weights: the newest version counts in full, older ones not at all.
  bool is_felt(double now) const noexcept { return is_in && next == no_row && now < expiry; }
};

// A row that is a version of something; `previous` is the version before, while it is there.
struct Version : Want {
  uint64_t created = 0;          // sequence of the first snapshot with this version
  uint32_t previous = no_row;
};

// How far a row has come. A row that follows another waits, at weight 0, until it has begun. The poster sets a weight up
// before the row is posted, and sets it up anew only when no tick can use the row any more.
class Weight {
 public:
  // The poster's.
  void set_up(uint64_t version, bool waits, double value) noexcept {
    value_.store(value, std::memory_order_relaxed);
    state_.store(2 * version + !waits, std::memory_order_release);
  }
  // The poster's: makes the row wait as another version. False: it has begun meanwhile, and goes on.
  bool replace_waiting(uint64_t version, uint64_t newer) noexcept {
    uint64_t expected = 2 * version;
    return state_.compare_exchange_strong(expected, 2 * newer, std::memory_order_acq_rel);
  }

  // [rt] The tick's: a waiting row begins. True also when it had begun before.
  bool begin(uint64_t version) noexcept {
    uint64_t expected = 2 * version;
    return state_.compare_exchange_strong(expected, 2 * version + 1, std::memory_order_acq_rel) ||
           expected == 2 * version + 1;
  }
  // [rt] The tick's.
  void set(double value) noexcept { value_.store(value, std::memory_order_release); }

  bool has_begun(uint64_t version) const noexcept {  // [rt]
    return state_.load(std::memory_order_acquire) == 2 * version + 1;
  }
  double value() const noexcept { return value_.load(std::memory_order_acquire); }  // [rt]

  // [rt] A weight after `by` of a fade.
  static double moved(double weight, bool in, double by) noexcept {
    return in ? std::min(1.0, weight + by) : std::max(0.0, weight - by);
  }
  // [rt] The part of a fade (s; 0: none) that `elapsed` seconds are.
  static double part_of_fade(double elapsed, double fade) noexcept { return fade > 0 ? elapsed / fade : never; }

 private:
  std::atomic<uint64_t> state_{0};  // 2 * version, + 1 when it has begun
  std::atomic<double> value_{0};
};

// [rt] Whether the weight of a row rises; the row has begun. One at 1 or at 0 starts its successor, and falls from then
// on. next, next_version: of the successor; null: there is none. began: set when it has just started.
inline bool goes_in(const Want& row, double value, double now, Weight* next, uint64_t next_version, bool is_at_once,
                    bool& began) noexcept {
  const bool in = row.is_in && now < row.expiry;
  if (!next) return in;
  if (next->has_begun(next_version)) return false;
  if (!is_at_once && value > 0 && value < 1) return in;
  if (!next->begin(next_version)) return in;  // it was replaced; another snapshot tells by what
  began = true;
  return false;
}

}  // namespace fs
