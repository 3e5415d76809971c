// How far the clock of another site is from ours. The smallest difference between arrival and sending of the last ten seconds is
// the offset of the clocks and the shortest way; half the shortest round trip is taken for that way.
#pragma once

#include <algorithm>
#include <deque>

namespace bridge {

class SiteClock {
 public:
  // A sample of that site, sent on its clock, arrived on ours; s.
  void note_arrival(double sent, double arrived) { note(arrivals_, arrived - sent, arrived); }
  // The way to that site and back took so long, s.
  void note_round_trip(double time, double now) { note(round_trips_, std::max(0.0, time), now); }

  bool is_known() const noexcept { return !arrivals_.empty() && !round_trips_.empty(); }
  // Our clock minus theirs, s. Before a round trip is known it is too large by the one-way delay.
  double offset() const noexcept { return least(arrivals_) - delay(); }
  double delay() const noexcept { return round_trips_.empty() ? 0 : least(round_trips_) / 2; }  // s, of the shortest way
  double to_ours(double time) const noexcept { return time + offset(); }
  double to_theirs(double time) const noexcept { return time - offset(); }

 private:
  struct Second {
    double begin, least;
  };
  using Seconds = std::deque<Second>;

  static double least(const Seconds& seconds) noexcept {
    double out = 1e300;
    for (const Second& second : seconds) out = std::min(out, second.least);
    return seconds.empty() ? 0 : out;
  }

  static void note(Seconds& seconds, double value, double now) {
    constexpr double kept = 10, jump = 0.25;  // s
    const bool goes_back = !seconds.empty() && now < seconds.back().begin;
    // Nothing of a whole second is near what was known: one of the clocks has jumped, as after a sleep.
    const bool has_jumped = seconds.size() > 1 && now - seconds.back().begin >= 1 && seconds.back().least > least(seconds) + jump;
    if (goes_back) seconds.clear();
    if (has_jumped) seconds.erase(seconds.begin(), seconds.end() - 1);
    if (seconds.empty() || now - seconds.back().begin >= 1) seconds.push_back({now, value});
    seconds.back().least = std::min(seconds.back().least, value);
    while (seconds.front().begin < now - kept && seconds.size() > 1) seconds.pop_front();
  }

  Seconds arrivals_, round_trips_;
};

}  // namespace bridge
