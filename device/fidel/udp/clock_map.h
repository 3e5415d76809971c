// The controller's clock on the host's: the time of a state as the host would have read it.
//
// A datagram that came at `came` on the host's clock and was sent at `sent` on the controller's was under way for a time between
// 0 and the round trip. So the difference between the clocks is at most came - sent, and at least that less the round trip. Of the
// last two seconds the narrowest bounds count, and their middle is the difference: the smallest offset less half the round trip.
// Bounds that exclude one another tell that a clock has jumped: then the newest alone count.
#pragma once

#include <array>
#include <cstdint>

namespace fs::udp {

class ClockMap {
 public:
  // Times of the host in s, of the controller in ns, each on its own clock.
  void note(uint64_t sent, double came) noexcept;
  // The same for a state that is the first to answer a command or a HELLO: round_trip in s, without the time that the controller
  // kept it. One below 0 or above 2 s is none: a clock has jumped meanwhile.
  void note(uint64_t sent, double came, double round_trip) noexcept;

  // The time on the host's clock, not after `came`.
  double to_host(uint64_t time, double came) noexcept;

  double round_trip() const noexcept { return round_trip_; }  // s, the smallest of the last two seconds; 0: not known
  double offset() const noexcept {
    return offset_ - 1e-9 * static_cast<double>(base_);
  }  // s, of the host's clock less the controller's
  uint32_t jumps() const noexcept { return jumps_; }  // since the start

 private:
  static constexpr double bucket_length = 0.25;  // s
  struct Bucket {
    int64_t number = -1;  // of its time, in bucket lengths
    double high, low, round_trip;  // s
  };
  struct Bounds {
    double high, low, round_trip;
  };

  double offset_of(uint64_t sent, double came) const noexcept;
  Bucket& bucket_at(double came) noexcept;
  Bounds bounds(double came) const noexcept;
  void begin_anew(double high, double came) noexcept;
  void follow(double came) noexcept;

  std::array<Bucket, 9> buckets_;
  bool has_base_ = false;
  uint64_t base_ = 0;  // ns, the first time of the controller
  double offset_ = 0, followed_at_ = 0, round_trip_ = 0;  // s
  uint32_t jumps_ = 0;
};

}  // namespace fs::udp
