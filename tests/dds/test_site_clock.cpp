// How far two clocks are apart (site_clock.h), from samples that come late and some not at all: a hundred a second, and the pings.
#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
#include <vector>

#include "api/world.h"
#include "scenes/random.h"
#include "site_clock.h"

namespace {

using bridge::SiteClock;
using scenes::add_case;
using scenes::run_suite;

struct Link {
  double delay, jitter;  // s, each way; evenly distributed
};
constexpr Link links[]{{0.005, 0.002}, {0.020, 0.005}, {0.050, 0.010}};
constexpr double loss = 0.02;

// The clocks of two sites, both from 0, and what one hears of the other.
class Pair {
 public:
  Pair(const Link& link, uint64_t seed, double drift = 0) : link_(link), drift_(drift), random_(seed) {}

  double ours() const { return time_ + our_jump_; }
  double theirs() const { return 1000 + (1 + drift_) * time_ + their_jump_; }
  void jump_ours(double by) { our_jump_ += by; }
  void jump_theirs(double by) { their_jump_ += by; }
  double error() const { return clock.offset() - (ours() - theirs()); }
  double error_of_arrivals() const { return error() + clock.delay(); }  // as if the way took no time

  // Until then, s. looks: called 100 times a second.
  void run(double end, bool has_pings = true, const std::function<void()>& looks = nullptr) {
    for (; time_ < end; time_ = 0.01 * ++tick_) {
      while (!on_their_way_.empty() && on_their_way_.top().time <= time_) {
        const Event next = on_their_way_.top();
        on_their_way_.pop();
        const double now = time_;
        time_ = next.time;
        next.arrives();
        time_ = now;
      }
      const double hand = theirs();
      send([this, hand] { clock.note_arrival(hand, ours()); });
      const bool is_ping_due = tick_ % (time_ < 2 ? 10 : 100) == 0;
      if (has_pings && is_ping_due) ping();
      if (looks) looks();
    }
  }

  SiteClock clock;

 private:
  struct Event {
    double time;
    std::function<void()> arrives;
    bool operator<(const Event& other) const { return time > other.time; }
  };
  void send(std::function<void()> arrives) {
    const double late = link_.delay + link_.jitter * random_.unit_interval();
    if (!random_.coin(loss)) on_their_way_.push({time_ + late, std::move(arrives)});
  }
  // Each tells the newest number of the other with how long it has had it, as Bridge::write_ping and take_pings.
  void ping() {
    const double sent = ours();
    send([this, sent] {
      pinged_ = sent;
      pinged_arrived_ = theirs();
    });
    const double their_sent = theirs(), number = pinged_, held = theirs() - pinged_arrived_;
    send([=, this] {
      clock.note_arrival(their_sent, ours());
      const double took = ours() - number;
      if (number >= 0 && held >= 0 && took >= held) clock.note_round_trip(took - held, ours());
    });
  }

  const Link link_;
  const double drift_;
  scenes::Random random_;
  std::priority_queue<Event> on_their_way_;
  double time_ = 0, our_jump_ = 0, their_jump_ = 0, pinged_ = -1, pinged_arrived_ = 0;
  int tick_ = 0;
};

// The best of ten round trips has a quarter of the jitter of both ways or so, half of which counts; now and then more.
double most(const Link& link) { return 0.0005 + 0.45 * link.jitter; }

struct Worst {
  double error = 0, least_of_arrivals = 1e9;
};
Worst worst_until(Pair& pair, double end) {
  Worst out;
  pair.run(end, true, [&] {
    out.error = std::max(out.error, std::fabs(pair.error()));
    out.least_of_arrivals = std::min(out.least_of_arrivals, pair.error_of_arrivals());
  });
  return out;
}

}  // namespace

START_TEST(half_a_round_trip_is_taken_off) {
  for (const Link& link : links) {
    for (uint64_t seed = 1; seed <= 10; ++seed) {
      Pair pair(link, seed);
      pair.run(3);
      const Worst worst = worst_until(pair, 60);
      ck_assert_double_le(worst.error, most(link));
      ck_assert_double_ge(worst.least_of_arrivals, 0.99 * link.delay);
      ck_assert_double_lt(worst.error, worst.least_of_arrivals / 3);
    }
  }
}
END_TEST

START_TEST(before_a_round_trip_is_known) {
  for (const Link& link : links) {
    Pair pair(link, 1);
    ck_assert(!pair.clock.is_known());
    ck_assert(pair.clock.offset() == 0);
    pair.run(5, false);
    ck_assert(!pair.clock.is_known());
    ck_assert(pair.clock.delay() == 0);
    ck_assert_double_ge(pair.error(), link.delay - 1e-9);
    ck_assert_double_le(pair.error(), link.delay + link.jitter / 10);
    // The first second with pings: known when the first has come back.
    Pair other(link, 2);
    other.run(1);
    ck_assert(other.clock.is_known());
    ck_assert_double_le(std::fabs(other.error()), link.jitter + 0.0005);
  }
}
END_TEST

// Either clock, there or back: right again within 3 s.
START_TEST(a_jump_is_followed) {
  for (const Link& link : links) {
    for (const double by : {10.0, -10.0, 0.5, -0.5, 5.0, -5.0, 3600.0, -3600.0}) {
      for (const bool is_ours : {true, false}) {
        Pair pair(link, 3);
        pair.run(20.5);
        if (is_ours) {
          pair.jump_ours(by);
        } else {
          pair.jump_theirs(by);
        }
        pair.run(23.5);
        double error = worst_until(pair, 40).error;
        // And what comes after it is followed as well.
        pair.jump_theirs(-20);
        pair.run(43);
        error = std::max(error, worst_until(pair, 50).error);
        ck_assert_msg(error <= most(link), "%g s by %s clock, %g + %g: %g s", by, is_ours ? "our" : "their", link.delay, link.jitter,
                      error);
      }
    }
  }
}
END_TEST

// The smallest of ten seconds is up to 10 s old.
START_TEST(drift_of_100_ppm) {
  for (const Link& link : links) {
    for (const double drift : {1e-4, -1e-4}) {
      Pair pair(link, 4, drift);
      pair.run(3);
      ck_assert_double_le(worst_until(pair, 120).error, most(link) + 11 * 1e-4);
    }
  }
}
END_TEST

// The hand stands still for some seconds, and what was on its way comes late and at once: that is no jump.
START_TEST(a_pause_is_no_jump) {
  SiteClock clock;
  const auto run = [&](double begin, double end, double late) {
    for (double t = begin; t < end; t += 0.01) clock.note_arrival(t + 1000, std::max(t + 0.02, late));
  };
  run(0, 20, 0);
  clock.note_round_trip(0.04, 20);
  run(20, 25, 25);
  ck_assert_double_eq_tol(clock.offset(), -1000, 1e-6);
  run(25, 27, 0);
  ck_assert_double_eq_tol(clock.offset(), -1000, 1e-6);
}
END_TEST

int main() {
  Suite* const suite = suite_create("site clock");
  add_case(suite, "clock", {half_a_round_trip_is_taken_off, before_a_round_trip_is_known, a_jump_is_followed, drift_of_100_ppm,
                            a_pause_is_no_jump});
  return run_suite(suite);
}
