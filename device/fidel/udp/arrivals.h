// Numbered datagrams as they come: each counted once, whatever is lost, repeated or out of order.
#pragma once

#include <cstdint>

namespace fs::udp {

class Arrivals {
 public:
  enum Kind { newest, late, again };

  // late: a newer one has come before. A number that is more than 64 behind counts as one that has come before.
  Kind note(uint32_t number) noexcept {
    const int32_t ahead = static_cast<int32_t>(number - newest_);  // the numbers go round
    if (count_ == 0 || ahead > 0) {
      seen_ = count_ == 0 || ahead >= 64 ? 0 : seen_ << ahead;
      seen_ |= 1;
      newest_ = number;
      ++count_;
      return newest;
    }
    if (ahead <= -64 || seen_ >> -ahead & 1) return again;
    seen_ |= uint64_t{1} << -ahead;
    ++count_;
    return late;
  }
  uint32_t newest_number() const noexcept { return newest_; }
  uint32_t count() const noexcept { return count_; }  // of the different ones

 private:
  uint64_t seen_ = 0;  // bit i: the newest less i has come
  uint32_t newest_ = 0, count_ = 0;
};

}  // namespace fs::udp
