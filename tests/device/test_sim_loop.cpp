// The loop read, spring, write on the simulated FIDEL against theory: the stiffness at which it becomes unstable, and
// the swing that friction can still hold down. If these hold, plant, delay and friction are what they claim to be.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <vector>

#include "support.h"

using namespace fs;

namespace {

// x (m) at each tick of a virtual 1 kHz servo that draws the handle to `centre` with `stiffness` (N/m), along x.
std::vector<double> run_spring(const std::string& uri, double stiffness, double centre, double seconds) {
  const auto device = open_device(uri);
  std::vector<double> x;
  for (int k = 1; k <= static_cast<int>(seconds / tick); ++k) {
    fs_state state;
    ck_assert_int_eq(device->read(k * tick, state), FS_OK);
    x.push_back(state.pose.position.x);
    const fs_wrench force{{-stiffness * (state.pose.position.x - centre), 0, 0}, {}};
    ck_assert_int_eq(device->write(force), FS_OK);
  }
  return x;
}

double peak_to_peak(const std::vector<double>& x, double from, double to) {
  const auto [low, high] = std::minmax_element(x.begin() + static_cast<long>(from / tick),
                                               x.begin() + static_cast<long>(to / tick));
  return *high - *low;
}

// Without friction, and with forces far from the maximum, the loop is linear: it is unstable where its swing grows.
bool grows(const std::string& uri, double stiffness) {
  const std::vector<double> x = run_spring(uri, stiffness, 1e-5, 8);
  return peak_to_peak(x, 7, 8) > peak_to_peak(x, 3, 4);
}

// Exact eigenvalues of the held loop at 1 kHz, N/m; within 1 % and the rounding of the table.
START_TEST(critical_stiffness) {
  const struct { const char* hand; int delay_ms; double stiffness; } cases[] = {
      {"nominal", 0, 14922}, {"nominal", 2, 2992}, {"nominal", 5, 1366}, {"nominal", 10, 722}, {"nominal", 20, 378},
      {"nominal", 50, 167}, {"released", 0, 2001}, {"released", 2, 401}, {"released", 5, 182}, {"released", 10, 96},
      {"released", 20, 49}, {"released", 50, 20}};
  for (const auto& c : cases) {
    const std::string uri = std::string("sim:?encoder=ideal&friction=0&hand=") + c.hand + "&delay_ms=" +
                            std::to_string(c.delay_ms);
    const double below = 0.99 * c.stiffness - 0.5, above = 1.01 * c.stiffness + 0.5;
    ck_assert_msg(!grows(uri, below), "%s, %d ms: unstable at %g N/m", c.hand, c.delay_ms, below);
    ck_assert_msg(grows(uri, above), "%s, %d ms: stable at %g N/m", c.hand, c.delay_ms, above);
  }
}
END_TEST

// Largest |x - centre| of each half swing.
std::vector<double> swings(const std::vector<double>& x, double centre) {
  std::vector<double> peaks;
  double largest = 0;
  for (size_t i = 1; i < x.size(); ++i) {
    largest = std::max(largest, std::fabs(x[i] - centre));
    if ((x[i] - centre) * (x[i - 1] - centre) < 0) {
      peaks.push_back(largest);
      largest = 0;
    }
  }
  return peaks;
}

// Below a swing of A* = 4 f/(pi (K sin(w tau) - b w)) friction takes more than the delay gives, above it less. A force
// draws the handle aside, then the spring takes over; the force after which it swings on longest is found by halving.
START_TEST(friction_threshold) {
  const double m = 0.854, b = 7.45, k = 135, stiffness = 1000, delay = 0.010, tau = delay + tick / 2, f = 0.3;
  double low = 1, high = 100;  // rad/s: K cos(w tau) = m w^2 - k
  for (int i = 0; i < 60; ++i) {
    const double w = (low + high) / 2;
    (stiffness * std::cos(w * tau) > m * w * w - k ? low : high) = w;
  }
  const double threshold = 4 * f / (std::numbers::pi * (stiffness * std::sin(low * tau) - b * low));
  ck_assert_double_eq_tol(threshold, 3.8e-3, 0.1e-3);

  const auto run = [&](double aside) {  // N
    const auto device = open_device("sim:?encoder=ideal&delay_ms=10");
    std::vector<double> x;
    for (int n = 1; n <= 9000; ++n) {
      fs_state state;
      device->read(n * tick, state);
      const fs_wrench hold{{aside, 0, 0}, {}}, spring{{-stiffness * state.pose.position.x, 0, 0}, {}};
      const bool holding = n <= 3000;
      if (!holding) x.push_back(state.pose.position.x);
      device->write(holding ? hold : spring);
    }
    return swings(x, 0);
  };
  double decays = 0.1, grows = 2.7;
  std::vector<double> lingering;
  for (int i = 0; i < 14; ++i) {
    const double aside = (decays + grows) / 2;
    const std::vector<double> s = run(aside);
    const bool grew = s.size() > 10 && s.back() > 2 * threshold;
    (grew ? grows : decays) = aside;
    if (s.size() > 12) lingering = s;
  }
  ck_assert_uint_gt(lingering.size(), 12);
  ck_assert_double_eq_tol(lingering[8], threshold, 0.02 * threshold);
}
END_TEST

// With friction the nominal hand holds 1000 N/m up to about 10 ms, without it up to 6.9 ms.
START_TEST(critical_delay) {
  const auto critical = [](const char* options) {  // ms, by halving
    double stable = 4, unstable = 16;
    while (unstable - stable > 0.13) {
      const double delay = (stable + unstable) / 2;
      char uri[128];
      std::snprintf(uri, sizeof uri, "sim:?encoder=ideal&delay_ms=%.3f%s", delay, options);
      const std::vector<double> x = run_spring(uri, 1000, 5e-3, 8);
      const double early = peak_to_peak(x, 2.5, 3.5), late = peak_to_peak(x, 7, 8);
      (late > 0.1e-3 && late > 0.7 * early ? unstable : stable) = delay;
    }
    return stable;
  };
  const double without = critical("&friction=0"), with = critical("");
  ck_assert_double_eq_tol(without, 6.9, 0.3);
  ck_assert_double_eq_tol(with, 10, 1);
}
END_TEST

}  // namespace

int main() {
  Suite* suite = suite_create("sim_loop");
  TCase* all = tcase_create("sim_loop");
  tcase_set_timeout(all, 500);
  tcase_add_test(all, critical_stiffness);
  tcase_add_test(all, friction_threshold);
  tcase_add_test(all, critical_delay);
  suite_add_tcase(suite, all);
  return run_suite(suite);
}
