// The functions of the Force Dimension SDK that the driver uses, by their own names. The SDK is not part of forceserver: these
// declarations were written from what open programs call (README.md names them), and the library is loaded when it is needed.
//
// All functions may be called by several threads at once. Unless something else is said, they return a negative number when they
// fail, and last_error tells why; positive numbers are successes, too. Units are m, N, N m, rad.
#pragma once

#include <optional>
#include <string>

namespace fs::dhd {

enum Answer : int {
  is_cached = 1,     // of a read: nothing new was fetched from the device
  is_saturated = 2,  // of a write: a motor could not give its part, and the force was lowered with its direction kept
};
constexpr int error_of_communication = 2;

// The places in what dhdGetStatus fills.
enum Status : int {
  status_power = 0,
  status_connected = 1,
  status_started = 2,
  status_reset = 3,
  status_idle = 4,
  status_force = 5,
  status_brake = 6,
  status_torque = 7,
  status_error = 9,
  status_gravity = 10,
  status_cause = 14,
  status_count = 64,  // 17 are known; a later SDK may give more
};
enum class Cause : int { none = 0, button = 1, velocity = 2, watchdog = 3, software = 4, usb = 5, dead_man = 6 };

constexpr int joints = 8;  // in each array of joint angles

struct Api {
  std::string path;     // of the library
  std::string version;  // of the SDK: "3.17.1"

  void (*dhdGetSDKVersion)(int* major, int* minor, int* release, int* revision);
  int (*dhdErrorGetLast)();  // of this thread
  const char* (*dhdErrorGetLastStr)();
  int (*dhdGetDeviceCount)();
  int (*drdOpenID)(char index);   // the ID of the open device, or -1
  int (*drdClose)(char id);

  int (*dhdGetSerialNumber)(unsigned short* serial, char id);
  int (*dhdGetSystemType)(char id);
  const char* (*dhdGetSystemName)(char id);
  bool (*dhdHasWrist)(char id);
  bool (*dhdHasActiveWrist)(char id);
  bool (*dhdHasGripper)(char id);
  int (*dhdGetStatus)(int* status, char id);

  int (*dhdGetPositionAndOrientationFrame)(double* x, double* y, double* z, double matrix[3][3], char id);
  int (*dhdGetGripperAngleRad)(double* angle, char id);
  unsigned (*dhdGetButtonMask)(char id);
  int (*dhdSetForceAndTorqueAndGripperForce)(double fx, double fy, double fz, double tx, double ty, double tz, double grip,
                                             char id);
  int (*dhdEnableForce)(unsigned char on, char id);
  int (*dhdSetBrakes)(int on, char id);
  int (*dhdStop)(char id);  // the force off, and the brakes on
  int (*dhdSetGravityCompensation)(int on, char id);

  bool (*drdIsSupported)(char id);
  bool (*drdIsInitialized)(char id);
  int (*drdAutoInit)(char id);  // moves the device, and takes seconds
  int (*drdStop)(bool leave_forces_on, char id);

  int (*dhdEnableExpertMode)();
  int (*dhdDisableExpertMode)();
  int (*dhdSetWatchdog)(unsigned char time, char id);  // in units of 125 us; 0: none

  // Null in a library that does not have them.
  double (*dhdGetMaxForce)(char id);                      // N, a limit that somebody has set; negative: none
  int (*dhdEmulateButton)(unsigned char on, char id);     // of a gripper: button 0 is down when it is closed
  int (*dhdDeltaPositionToEncoder)(double x, double y, double z, int* e0, int* e1, int* e2, char id);
  int (*dhdDeltaEncoderToPosition)(int e0, int e1, int e2, double* x, double* y, double* z, char id);
  int (*dhdDeltaEncodersToJointAngles)(int e0, int e1, int e2, double* j0, double* j1, double* j2, char id);
  int (*dhdJointAnglesToInertiaMatrix)(double angles[joints], double matrix[6][6], char id);

  std::string last_error() const;  // of this thread, in the SDK's words
};

// The SDK, which is loaded once for the process: from this file, or from where the system's loader finds libdrd.so.3. Throws a
// Refusal: NOT_FOUND, VERSION, INVALID (it was loaded from another file).
const Api& load_api(const std::optional<std::string>& library);

}  // namespace fs::dhd
