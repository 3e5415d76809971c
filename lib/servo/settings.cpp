#include "servo/settings.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/enum.h"
#include "base/error.h"
#include "base/realtime.h"
#include "field/weight.h"

namespace fs {
namespace {

double parse_limit(double given, double device, const char* field) {
  if (!(given >= 0 && given <= device)) {
    fail(FS_ERROR_INVALID, "%s is %.9g, must be within 0..%.9g, the device's limit", field, given, device);
  }
  return given > 0 ? given : device;
}

// The value of an option that can be switched off. 0 means the default; a negative number switches it off, which sets
// `bit` in `off`.
double parse_switch(double given, double standard, double none, double high, uint32_t bit, uint32_t& off, const char* field) {
  if (!(given <= high) || !std::isfinite(given)) {
    fail(FS_ERROR_INVALID, "%s is %.9g, must be finite and at most %.9g", field, given, high);
  }
  if (given < 0) off |= bit;
  return given < 0 ? none : given == 0 ? standard : given;
}

// What the options ask of the loop. INVALID where it would shake.
LoopOptions parse_loop(const fs_servo_options& options, const fs_device_info& device, double rate, LoopValues& values,
                       uint32_t& off) {
  LoopOptions out;
  out.rate = rate;
  if (!(options.delay >= 0 && options.delay <= 10)) {
    fail(FS_ERROR_INVALID, "delay is %.9g, must be within 0..10 s", options.delay);
  }
  out.delay = options.delay;
  out.damping = parse_switch(options.damping, 5, 0, 1e9, FS_OFF_DAMPING, off, "damping");
  out.max_stiffness = parse_switch(options.max_stiffness, never, never, 1e12, FS_OFF_STIFFNESS, off, "max_stiffness");
  out.is_bounded = !(off & FS_OFF_STIFFNESS);
  values = out.values(device);
  if (out.is_bounded && !(values.max_stiffness > 0)) {
    fail(FS_ERROR_INVALID,
         "damping is %g (none), and the device has no damping of its own: no stiffness can be "
         "rendered; damping must be 0 or more, or max_stiffness negative (none)",
         options.damping);
  }
  const double least = slew_speed * values.max_stiffness;
  out.slew = parse_switch(options.slew_limit, 0, never, 1e12, FS_OFF_SLEW, off, "slew_limit");
  if (!out.is_bounded && out.slew == 0) off |= FS_OFF_SLEW;
  if (out.is_bounded && out.slew > 0 && out.slew < least) {
    const double enough = 1e-3 * std::ceil(1e3 * least);  // with few digits, so that it can be typed
    fail(FS_ERROR_INVALID,
         "slew_limit is %.9g, must be at least %.12g N/s, which is 3 m/s times the max_stiffness of %g "
         "N/m: a lower limit shakes the hand",
         out.slew, enough, values.max_stiffness);
  }
  if (out.slew > 0) values.slew = out.slew;
  return out;
}

}  // namespace

ServoSettings parse_options(const fs_servo_options& options, const fs_device_info& device) {
  ServoSettings out{};
  const int32_t mode = raw_value(options.mode);
  if (mode < FS_SERVO_THREAD || mode > FS_SERVO_VIRTUAL) {
    fail(FS_ERROR_INVALID, "mode is %d, must be an fs_servo_mode (0..2)", mode);
  }
  out.mode = options.mode;
  if (options.rate != 0 && !(options.rate >= 100 && options.rate <= 20000)) {
    fail(FS_ERROR_INVALID, "rate is %.9g, must be within 100..20000 Hz, or 0 for the device's", options.rate);
  }
  out.rate = options.rate != 0 ? options.rate : device.rate;
  out.limits.period = 1 / out.rate;
  out.limits.resolution = device.resolution;
  out.limits.force_axes = device.force_axes;
  out.limits.torque_axes = device.torque_axes;
  out.limits.force = parse_limit(options.force_limit, device.force_max, "force_limit");
  out.limits.torque = parse_limit(options.torque_limit, device.torque_max, "torque_limit");
  uint32_t& off = out.protections_off;
  constexpr double standard_speed_limit = 2;  // m/s
  out.limits.speed = parse_switch(options.speed_limit, standard_speed_limit, never, 1e6, FS_OFF_SPEED, off, "speed_limit");
  out.limits.ramp = parse_switch(options.ramp, 0.5, 0, 1e6, FS_OFF_RAMP, off, "ramp");
  out.spread.fade = parse_switch(options.fade, 1, 0, 1e6, FS_OFF_FADE, off, "fade");
  out.spread.blend = parse_switch(options.blend, 0.02, 0, 1e6, FS_OFF_BLEND, off, "blend");
  const double speed = out.limits.speed < never ? out.limits.speed : standard_speed_limit;
  out.spread.jump = out.spread.blend > 0 ? out.spread.blend * speed : never;
  out.loop = parse_loop(options, device, out.rate, out.first, off);
  out.limits.blend = out.spread.blend;
  if (options.priority > 99) fail(FS_ERROR_INVALID, "priority is %d, must be at most 99", options.priority);
  out.priority = options.priority == 0 ? 80 : options.priority;
  const long processors = sysconf(_SC_NPROCESSORS_CONF);
  if (options.cpu < 0 || options.cpu > processors) {
    fail(FS_ERROR_INVALID, "cpu is %d, must be within 0..%ld", options.cpu, processors);
  }
  out.cpu = options.cpu - 1;
  if (out.cpu >= 0 && !may_use_processor(out.cpu)) {
    fail(FS_ERROR_INVALID, "cpu is %d, but the calling thread may not run on processor %d", options.cpu, out.cpu);
  }
  return out;
}

}  // namespace fs
