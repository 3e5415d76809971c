#include "device/dhd/model.h"

#include <forceserver/evaluate.h>

#include "device/dhd/session.h"

namespace fs::dhd {

Limits limits_of(int type) {
  constexpr Limits delta{20, 0, 0.15}, omega{12, 0, 0.075}, sigma{12, 0.2, 0.075}, lambda{12, 0, 0.1125}, falcon{8, 0, 0.04};
  switch (type) {
    case 63: return delta;
    case 33:
    case 34:
    case 35:
    case 36:
    case 37: return omega;
    case 104:
    case 105:
    case 206: return sigma;
    case 108:
    case 109:
    case 131:
    case 132:
    case 203: return lambda;
    case falcon_type: return falcon;
    default: return {5, 0, 0.075};
  }
}

namespace {

Cause cause_of(const StatusArray& status) { return static_cast<Cause>(status[status_cause]); }

struct Reason {
  uint32_t flag;
  const char* words;
};

Reason find_reason(const StatusArray& status, bool is_initialized) {
  if (!status[status_connected]) return {FS_STATE_CONNECTING, "the device is not connected"};
  if (!status[status_power]) return {FS_STATE_STOPPED, "the device has no power: look at its power supply and its switch"};
  if (!is_initialized) {
    return {FS_STATE_NOT_HOMED, "the device is not homed: send it the request home; it then moves by itself, so keep hands away"};
  }
  if (status[status_reset]) return {FS_STATE_NOT_HOMED, "the device waits for a reset: its maker's manual tells how"};
  if (cause_of(status) == Cause::velocity && !status[status_force]) {
    return {FS_STATE_TOO_FAST, "the handle was too fast, and the device has braked: it gives force again after a second"};
  }
  if (status[status_force]) return {0, ""};
  switch (cause_of(status)) {
    case Cause::button: return {FS_STATE_STOPPED, "the force button of the device has switched its motors off: press it"};
    case Cause::watchdog: return {FS_STATE_STOPPED, "the device has heard nothing for 20 ms, and has ended its force"};
    case Cause::usb: return {FS_STATE_STOPPED, "the device had lost its USB connection, and has ended its force"};
    case Cause::software:
      return {FS_STATE_STOPPED, "the motors were switched off by a program: send the device the request home"};
    case Cause::dead_man: return {FS_STATE_STOPPED, "nobody holds the handle: the dead man's switch has ended the force"};
    default: return {FS_STATE_STOPPED, "the motors of the device are switched off: press its force button"};
  }
}

}  // namespace

uint32_t reason_of(const StatusArray& status, bool is_initialized) { return find_reason(status, is_initialized).flag; }

std::string words_of(const StatusArray& status, bool is_initialized) { return find_reason(status, is_initialized).words; }

}  // namespace fs::dhd
