// What the tests of the devices share.
#pragma once

#include <check.h>
#undef fail  // an old name of check.h; it is a function of ours

#include <cmath>
#include <complex>
#include <cstring>
#include <string>

#include "base/error.h"
#include "device/sim/plant.h"
#include "driver/device.h"

constexpr double tick = 1e-3;  // s, of a virtual servo

// Runs what must throw an Error of this status whose sentence has this part; gives the sentence.
template <class Call>
std::string expect_error(fs_status status, const char* part, Call call) {
  try {
    call();
  } catch (const fs::Error& error) {
    ck_assert_msg(error.status == status, "status %d instead of %d: %s", error.status, status, error.text.c_str());
    ck_assert_msg(error.text.find(part) != std::string::npos, "'%s' is not in: %s", part, error.text.c_str());
    return error.text;
  }
  ck_abort_msg("nothing was thrown, '%s' was expected", part);
  return {};
}

inline fs::Ref<fs::Device> open_device(const std::string& uri) { return fs::make_ref<fs::Device>(uri.c_str()); }

inline fs_state read_at(fs::Device& device, double time) {
  fs_state state;
  ck_assert_int_eq(device.read(time, state), FS_OK);
  return state;
}

struct Constants {
  double m, b, k;  // SI
};

// The closed form of m x'' + b x' + k x = f from rest at 0, by the two roots of the characteristic polynomial.
inline fs::AxisState step_response(Constants c, double f, double t) {
  using Complex = std::complex<double>;
  if (c.k == 0) {
    const double a = c.b / c.m;
    return {f / c.b * (t + std::expm1(-a * t) / a), -f / c.b * std::expm1(-a * t)};
  }
  const Complex root = std::sqrt(Complex(c.b * c.b - 4 * c.m * c.k, 0));
  const Complex p = (-c.b + root) / (2 * c.m), q = (-c.b - root) / (2 * c.m);
  const Complex ep = std::exp(p * t), eq = std::exp(q * t);
  return {(f / c.k * (1.0 + (q * ep - p * eq) / (p - q))).real(), (f / c.k * p * q * (ep - eq) / (p - q)).real()};
}

inline bool same_bits(const fs_state& a, const fs_state& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

inline int run_suite(Suite* suite) {
  SRunner* runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  const int failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed != 0;
}
