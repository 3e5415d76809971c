#include "servo/loop_values.h"

#include <cmath>

#include "budget/loop.h"
#include "field/weight.h"

namespace fs {
namespace {

constexpr double assumed_mass = 0.05;  // kg, of a device that does not tell its own: as light as any

double link_period(const fs_device_info& device) { return device.link_rate > 0 ? 1 / device.link_rate : 0; }

// With max_stiffness as the loop can render it, whatever the options ask.
struct Rendered {
  LoopLimit limit;
  double model_stiffness;  // N/m; 0: the device renders no models
};

Rendered rendered(const LoopOptions& options, const fs_device_info& device) noexcept {
  const double mass = device.mass > 0 ? device.mass : assumed_mass;
  const double delay = options.delay > 0 ? options.delay : device.delay;
  const double period = std::fmax(1 / options.rate, link_period(device));
  const bool has_model = device.controller_rate > 0;  // then a controller at the device closes the loop and damps it
  if (!has_model) return {limit_of({mass, device.damping, period, delay}, options.damping), 0};
  Rendered out{limit_of({mass, device.damping, 1 / device.controller_rate, device.controller_delay}, device.controller_damping),
               0};
  out.model_stiffness = model_stiffness(delay, period, device.damping + out.limit.damping);
  out.limit.max_stiffness = std::fmin(out.limit.max_stiffness, out.model_stiffness);
  const LoopLimit link = limit_of({mass, device.damping, period, delay}, 0);  // objects' damping comes through it
  out.limit.object_damping = std::fmin(out.limit.object_damping, link.object_damping);
  return out;
}

}  // namespace

LoopValues LoopOptions::values(const fs_device_info& device) const noexcept {
  const Rendered all = rendered(*this, device);
  LoopValues out{};
  out.delay = delay > 0 ? delay : device.delay;
  out.damping = all.limit.damping;
  out.own_damping = device.controller_rate > 0 ? 0 : all.limit.damping;
  out.model_stiffness = all.model_stiffness;
  out.max_stiffness = is_bounded ? std::fmin(all.limit.max_stiffness, max_stiffness) : never;
  out.object_damping = is_bounded ? all.limit.object_damping : never;
  const double usual_slew = is_bounded ? slew_speed * all.limit.max_stiffness : never;
  out.slew = slew > 0 ? slew : usual_slew;
  if (is_bounded && slew > 0) out.max_stiffness = std::fmin(out.max_stiffness, slew / slew_speed);
  if (is_bounded) {
    const double period = std::fmax(1 / rate, link_period(device));
    const double slew_for_impacts = out.slew / 4;
    out.impact = {all.model_stiffness > 0 ? 0 : slew_for_impacts, device.mass > 0 ? device.mass : assumed_mass, 1 / (8 * period)};
  }
  out.pose_age = std::fmin(0.1, 0.02 + device.delay + link_period(device));
  return out;
}

}  // namespace fs
