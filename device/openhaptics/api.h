// The functions of the device interface of OpenHaptics (libHD) that the driver uses, by their own names. OpenHaptics is not part of
// forceserver: these declarations were written from what open programs call (README.md names them), and the library is loaded when
// it is needed.
//
// The interface has a current device for each thread. A function that fails adds to a list of errors, of which hdGetError takes the
// oldest. Units are mm, mm/s, N, mN m. x points to the right, y up, z to the user.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace fs::openhaptics {

using Handle = unsigned;  // of a device
constexpr Handle no_handle = 0xffffffff;

struct ErrorInfo {
  unsigned code;  // 0: none
  int internal_code;  // of the maker
  Handle handle;
};
static_assert(sizeof(ErrorInfo) == 12);

enum Parameter : unsigned {
  buttons = 0x2000,
  inkwell_switch = 0x2002,
  transform = 0x2052,
  model_type = 0x2501,
  serial_number = 0x2504,
  usable_workspace = 0x2551,
  output_axes = 0x2554,
  calibration_style = 0x2555,
  max_force = 0x2603,
  motor_temperature = 0x2605,
  current_force = 0x2700,
  current_torque = 0x2701,
  force_output = 0x4000,
  force_clamping = 0x4001,  // for hdEnable
};
enum Calibration : unsigned { calibrated = 0x5000, needs_update = 0x5001, needs_hand = 0x5002 };
enum Style : int { by_reset = 1, by_itself = 2, by_inkwell = 4 };  // bits
enum Error : unsigned {
  warm_motors = 0x200,
  exceeded_max_force = 0x201,
  force_impulse = 0x202,
  max_velocity = 0x203,
  force_error = 0x204,
  device_fault = 0x300,
  already_initiated = 0x301,
  comm_error = 0x302,
  comm_config_error = 0x303,
  timer_error = 0x304,
};
inline bool is_unreachable(unsigned error) { return error >= device_fault && error <= timer_error; }
inline bool ends_force(unsigned error) { return error >= warm_motors && error <= force_error; }
std::string words_of(const ErrorInfo& error);  // "HD_COMM_ERROR (0x302, internal -28)"; asks no library
constexpr unsigned again = 1;  // a callback returns it to be called in the next cycle, too

struct Api {
  std::string path;  // of the library

  ErrorInfo (*hdGetError)();
  Handle (*hdInitDevice)(const char* name);  // null: the default device
  void (*hdDisableDevice)(Handle handle);
  void (*hdMakeCurrentDevice)(Handle handle);
  void (*hdBeginFrame)(Handle handle);
  void (*hdEndFrame)(Handle handle);
  void (*hdEnable)(unsigned what);
  void (*hdGetDoublev)(unsigned what, double* out);
  void (*hdGetIntegerv)(unsigned what, int* out);
  void (*hdGetBooleanv)(unsigned what, unsigned char* out);
  const char* (*hdGetString)(unsigned what);
  void (*hdSetDoublev)(unsigned what, const double* in);
  unsigned (*hdCheckCalibration)();
  void (*hdUpdateCalibration)(unsigned style);
  unsigned long (*hdScheduleAsynchronous)(unsigned (*callback)(void*), void* data, unsigned short priority);
  void (*hdUnschedule)(unsigned long callback);
  void (*hdStartScheduler)();
  void (*hdStopScheduler)();

  // Empties the list of this thread; how many there were. telling: the one that matters most: that the device cannot be reached, then
  // what ends its force, then the oldest.
  unsigned take_errors(ErrorInfo& telling) const noexcept;
};

// The library, which is loaded once for the process: from this file, or from where the system's loader finds libHD. Throws a Refusal:
// NOT_FOUND with the loader's words and a cure, VERSION, INVALID (it was loaded from another file).
const Api& load_api(const std::optional<std::string>& library);

}  // namespace fs::openhaptics
