// The impact of a surface: the response of one of its tones to a blow (object.h, Surfaces). It is a damped oscillator,
// whose state is the force, and what the force would be a quarter of a period later if nothing damped it.
#pragma once

#include <cmath>
#include <limits>
#include <numbers>

#include "math/vec3.h"

namespace fs {

// As the settings of a surface have it.
struct Impact {
  double gain = 0;       // N s/m
  double frequency = 0;  // Hz
  double decay = 0;      // 1/s

  double turn() const noexcept { return 2 * std::numbers::pi * frequency; }  // rad/s
  // s: how much momentum the first half wave has, for each newton of its amplitude.
  double impulse() const noexcept {
    const double w = turn();
    return w * (1 + std::exp(-std::numbers::pi * decay / w)) / (w * w + decay * decay);
  }
};

// What a servo's loop can render of impacts, at the device.
struct ImpactLimit {
  double slope = std::numeric_limits<double>::infinity();      // N/s, of all impacts together; 0: none is felt
  double mass = std::numeric_limits<double>::infinity();       // kg, of the handle
  double frequency = std::numeric_limits<double>::infinity();  // Hz
  bool operator==(const ImpactLimit&) const = default;

  // stiffness: of the contact, N/m. The frequency is raised to that of the handle on the contact's spring: then the first half
  // wave is over before the handle turns round, and only slows it.
  Impact bounded(const Impact& impact, double stiffness) const noexcept {
    const double own = std::sqrt(stiffness / mass) / (2 * std::numbers::pi);
    return {impact.gain, std::fmin(std::fmax(impact.frequency, own), frequency), impact.decay};
  }
  // N, the most amplitude of a bounded impact after an approach of `speed` (m/s) beside others, which change by `used` (N/s)
  // and have a momentum of `given` (N s).
  double most(const Impact& impact, double speed, double used, double given) const noexcept {
    const double by_slope = (slope - used) / impact.turn(), by_mass = (0.5 * mass * speed - given) / impact.impulse();
    return std::fmax(0, std::fmin(by_slope, by_mass));
  }
};

struct Oscillator {
  Vec3 force{}, quadrature{};  // N

  void strike(Vec3 amplitude) noexcept { quadrature += amplitude; }  // [rt]
  // [rt] Lets it go on for `time`, s.
  void go_on(const Impact& impact, double time) noexcept {
    const double left = std::exp(-impact.decay * time), angle = impact.turn() * time;
    const double c = left * std::cos(angle), s = left * std::sin(angle);
    const Vec3 before = force;
    force = c * force + s * quadrature;
    quadrature = c * quadrature - s * before;
  }
  // [rt] N/s, a bound of how fast its force F changes from now on. As F'' = -2 b F' - (w^2 + b^2) F, the sum
  // |F'|^2 + (w^2 + b^2) |F|^2 never grows; this is its root.
  double slope(const Impact& impact) const noexcept {
    const double w = impact.turn(), b = impact.decay;
    const Vec3 change = w * quadrature - b * force;
    return std::sqrt(dot(change, change) + (w * w + b * b) * dot(force, force));
  }
  bool is_over() const noexcept { return dot(force, force) + dot(quadrature, quadrature) < 1e-8; }  // below 0.1 mN
};

}  // namespace fs
