// The weights by which nothing makes a step in force. Whatever comes and goes under a servo is a row of a snapshot: a
// version of an object, or a view (a whole scene fades by a weight of its channel). The snapshot says what is wanted of the row (Want, data); the servo's
// memory has how far it has come (Weight, 0 to 1). Each tick moves each weight towards what is wanted by dt/fade at most
// (in a take-over, see below, by dt/blend), whatever was called in whatever order. So no change can make a step.
//
// What cannot be adjusted (another primitive, shape or tool) is another version and so another row. The old row names the
// new one as its `next`: as soon as the old row is in full, or not felt at all, the tick lets the next begin, and from then
// on the old row is wanted out. So the two cross-fade, and a stream of versions that is faster than the fade is felt as a
// chain of full cross-fades.
//
// Another profile of the same shape *takes over*: within the much shorter time `blend` the new row gets just the weight that
// the old one has, however little that is, and goes on from it. So it need not wait for the old row to be in full, only
// until that one has itself taken over from the one before.
#pragma once

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cstdint>
#include <limits>

namespace fs {

inline constexpr double never = std::numeric_limits<double>::infinity();
inline constexpr uint32_t no_row = ~0u;

// How a servo spreads what changes. A tool does not: all 0.
struct Spread {
  double fade = 0;  // s, in which a weight goes from 0 to 1; 0: at once
  double blend = 0;  // s, for poses and profiles of what is felt; 0: at once
  double jump = never;  // m of the device: an object that is put farther away than this fades there
};

// What a snapshot wants of a row.
struct Want {
  uint64_t version = 0;  // of this use of the row; 0: the row is not in use
  uint64_t sequence = 0;  // of the snapshot that first wanted it so
  double expiry = never;  // s, scene time: from then on the row is wanted out
  uint32_t next = no_row;  // the row that begins when this one is in full, or not felt
  bool is_in = false;
  uint64_t takes_over = 0;  // version of the row from which it takes over the weight, and the proxies; 0: it fades in by itself

  // Tools have no weights: the newest version counts in full, older ones not at all.
  bool is_felt(double now) const noexcept { return is_in && next == no_row && now < expiry; }
};

// A row that is a version of something; `previous` is the version before, while it is there.
struct Version : Want {
  uint64_t created = 0;  // sequence of the first snapshot with this version
  uint32_t previous = no_row;
  uint32_t newer = no_row;  // the row whose `previous` it is
};

// How far a row has come. A row that follows another waits, at weight 0, until it has begun. The poster sets a weight up
// before the row is posted, and sets it up anew only when no tick can use the row any more.
class Weight {
 public:
  // The poster's.
  void set_up(uint64_t version, bool waits, double value) noexcept {
    value_.store(value, std::memory_order_relaxed);
    coming_.store(0, std::memory_order_relaxed);
    passing_.store(0, std::memory_order_relaxed);
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
    return state_.compare_exchange_strong(expected, 2 * version + 1, std::memory_order_acq_rel) || expected == 2 * version + 1;
  }
  // [rt] The tick's.
  void set(double value) noexcept { value_.store(value, std::memory_order_release); }
  void set_coming(double value) noexcept { coming_.store(value, std::memory_order_release); }
  // [rt] The tick's: within a blend the row gives all of its weight to its successor.
  void hand_over(Weight& next) noexcept {
    const double all = value();
    passing_.store(all, std::memory_order_release);
    next.passing_.store(all, std::memory_order_release);
    next.set_coming(all);
  }

  bool has_begun(uint64_t version) const noexcept {  // [rt]
    return state_.load(std::memory_order_acquire) == 2 * version + 1;
  }
  double value() const noexcept { return value_.load(std::memory_order_acquire); }  // [rt]
  // [rt] What the row has still to take over.
  double coming() const noexcept { return coming_.load(std::memory_order_acquire); }
  // [rt] What it has given or taken over in the last blend, in all.
  double passing() const noexcept { return passing_.load(std::memory_order_acquire); }

  // [rt] The weight when the fraction `by` of a whole fade has passed.
  static double moved(double weight, bool in, double by) noexcept {
    return in ? std::min(1.0, weight + by) : std::max(0.0, weight - by);
  }
  // [rt] The fraction of a fade (s) that passes in `elapsed` seconds; infinite where nothing fades (0).
  static double part_of_fade(double elapsed, double fade) noexcept { return fade > 0 ? elapsed / fade : never; }

 private:
  std::atomic<uint64_t> state_{0};  // 2 * version, + 1 when it has begun
  std::atomic<double> value_{0}, coming_{0}, passing_{0};
};

// Where a weight goes.
struct Course {
  bool in;  // it rises
  bool hands_over;  // to its successor, within a blend
  double passing;  // see Weight

  // [rt] The value after `elapsed` seconds. coming: what the row has still to take over; it fades meanwhile.
  double after(double elapsed, double value, double& coming, const Spread& spread) const noexcept {
    assert(!(coming > 0) || passing > 0);  // what is taken over was handed over
    if (hands_over) return Weight::moved(value, false, passing * Weight::part_of_fade(elapsed, spread.blend));
    const double taken = coming > 0 ? std::min(coming, passing * Weight::part_of_fade(elapsed, spread.blend)) : 0;
    coming -= taken;
    // Both rows together weigh 1 at most.
    return std::min(1 - coming, Weight::moved(value + taken, in, Weight::part_of_fade(elapsed, spread.fade)));
  }
  // [rt] Seconds until the row has taken over, or else until the weight is where it goes; 0: it is there.
  double rest(double value, double coming, const Spread& spread) const noexcept {
    if (coming > 0) return coming / passing * spread.blend;
    const double way = in ? 1 - value : value;
    assert(way >= 0 && way <= 1);
    return hands_over && way > 0 ? way / passing * spread.blend : way * spread.fade;
  }
};

// [rt] Where the weight of a row goes; the row has begun. next, its: the weight of its successor, and what is wanted of that;
// null: there is none. is_at_once: nothing fades (a fade of 0). began: set when the successor has begun in this call.
//
//     the row      the successor                the successor begins
//     any          takes over, is wanted in     at once, or when the row itself has taken over all from the one before it
//     in           fades in by itself           when the row's weight is 1
//     out          fades in by itself           when the row's weight is 0 (or 1, if it came that far before it was wanted out)
//     any          takes over, is wanted out    when the row's weight is 0: wanted in again, it takes over what is left
inline Course course_of(const Want& row, Weight& weight, double now, Weight* next, const Want* its, bool is_at_once,
                        bool& began) noexcept {
  const bool in = row.is_in && now < row.expiry;
  const double value = weight.value();
  const double passing = weight.passing();
  if (!next) return {in, false, passing};
  if (next->has_begun(its->version)) return {false, next->coming() > 0, passing};
  const bool can_take_over = its->takes_over == row.version;
  const bool takes_over = can_take_over && its->is_in && now < its->expiry;
  const bool is_full = !(value < 1) && (in || !can_take_over), has_faded = is_at_once || is_full || !(value > 0);
  const bool has_taken_over = !(weight.coming() > 0);
  if (!has_taken_over || !(takes_over || has_faded)) return {in, false, passing};
  if (!next->begin(its->version)) return {in, false, passing};  // it was replaced; another snapshot tells by what
  if (takes_over) weight.hand_over(*next);
  began = true;
  return {false, takes_over, weight.passing()};
}

}  // namespace fs
