#include "device/makers/drd_stand_in.h"

#include <chrono>
#include <cmath>
#include <map>
#include <thread>
#include <utility>

#include "scenes/vector.h"

#define DRD extern "C" __attribute__((visibility("default")))

namespace makers {

using scenes::norm;
using scenes::rotate;

namespace {

constexpr int error_of_communication = 2, error_in_use = 5, error_no_device = 7, error_refused = 3;
// Of static storage: the leak sanitizer fails where a thread with storage of a loaded library ends while it looks.
[[gnu::tls_model("initial-exec")]] thread_local int last_error = 0;

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }
void sleep_s(double time) { std::this_thread::sleep_for(std::chrono::duration<double>(time)); }

DrdStandIn& it() {
  static auto* const instance = new DrdStandIn;  // never destroyed, as threads of drivers may still call
  return *instance;
}

// Which device has which ID. The SDK gives its order at the moment of opening.
std::map<int, std::shared_ptr<DrdDevice>>& open_devices() {
  static auto* const ids = new std::map<int, std::shared_ptr<DrdDevice>>;
  return *ids;
}

int fail(int error) {
  last_error = error;
  return -1;
}

// The open device of an ID that is still plugged in, or null with the error. The stand-in's mutex is held.
std::shared_ptr<DrdDevice> find(int id) {
  const auto found = open_devices().find(id);
  if (found == open_devices().end()) {
    last_error = error_no_device;
    return nullptr;
  }
  for (const auto& device : it().devices) {
    if (device == found->second) return device;
  }
  last_error = error_of_communication;
  return nullptr;
}

void end_force(DrdDevice& device, int cause) {
  device.has_force = false;
  device.cause = cause;
  device.handle.rest();
}

// What the device does by itself meanwhile.
void pass(DrdDevice& device) {
  const double now = now_s();
  if (device.watchdog > 0 && device.has_force && now - device.asked_at > device.watchdog * 125e-6) end_force(device, 3);
  double speed = 0;
  device.handle.with_plant([&](stability::Plant& plant) { speed = norm(plant.velocity()); });
  if (device.fastest > 0 && speed > device.fastest && device.has_force) {
    end_force(device, 2);
    device.has_brakes = true;
  }
}

// A call that goes to the device: half of its time before what it does, half after.
template <class Act>
int call(int id, Act act) {
  ++it().calls;
  double block = 0, stuck = 0;
  std::shared_ptr<DrdDevice> device;
  {
    const std::lock_guard lock(it().mutex);
    device = find(id);
    if (!device) return -1;
    device->handle.note_caller();
    block = it().block;
    stuck = std::exchange(device->stuck_for, 0);
  }
  sleep_s(0.5 * block + stuck);
  int answer;
  {
    const std::lock_guard lock(it().mutex);
    if (!find(id)) return -1;
    pass(*device);
    answer = act(*device);
  }
  sleep_s(0.5 * block);
  return answer;
}

// A call that the SDK answers by itself.
template <class Act>
auto ask(int id, Act act, decltype(act(std::declval<DrdDevice&>())) otherwise) {
  ++it().calls;
  const std::lock_guard lock(it().mutex);
  const auto device = find(id);
  if (!device) return otherwise;
  device->handle.note_caller();
  return act(*device);
}

// From the SDK's frame to the device frame and back: x of the SDK points to the user, y to his right.
fs_vec3 to_device(double x, double y, double z) { return {y, -x, z}; }
fs_vec3 to_sdk(fs_vec3 v) { return {-v.y, v.x, v.z}; }

}  // namespace

DrdStandIn::DrdStandIn() { devices.push_back(std::make_shared<DrdDevice>(4711)); }

}  // namespace makers

using namespace makers;
using scenes::operator+, scenes::operator*;

DRD DrdStandIn* drd_stand_in_here() { return &it(); }

DRD void dhdGetSDKVersion(int* major, int* minor, int* release, int* revision) {
  const auto version = it().change([](DrdStandIn& all) { return all.version; });
  *major = version[0], *minor = version[1], *release = version[2], *revision = version[3];
}
DRD int dhdErrorGetLast() { return last_error; }
DRD const char* dhdErrorGetLastStr() {
  switch (last_error) {
    case 0: return "no error";
    case error_of_communication: return "communication error";
    case error_in_use: return "device already in use";
    case error_refused: return "command refused";
    default: return "no device";
  }
}
DRD int dhdGetDeviceCount() {
  return it().change([](DrdStandIn& all) { return static_cast<int>(all.devices.size()); });
}
DRD int dhdGetAvailableCount() {
  return it().change([](DrdStandIn& all) {
    int count = 0;
    for (const auto& device : all.devices) count += !device->is_taken;
    return count;
  });
}
DRD int drdOpenID(char index) {
  return it().change([&](DrdStandIn& all) {
    if (index < 0 || index >= static_cast<int>(all.devices.size())) return fail(error_no_device);
    const auto device = all.devices[static_cast<size_t>(index)];
    if (device->is_taken) return fail(error_in_use);
    for (const auto& [id, open] : open_devices()) {
      if (open == device) return id;
    }
    int id = 0;
    while (open_devices().count(id)) ++id;
    device->is_open = true;
    device->asked_at = now_s();
    open_devices()[id] = device;
    return id;
  });
}
DRD int drdClose(char id) {
  return it().change([&](DrdStandIn&) {
    const auto found = open_devices().find(id);
    if (found == open_devices().end()) return fail(error_no_device);
    end_force(*found->second, 4);
    found->second->is_open = false;
    open_devices().erase(found);
    return 0;
  });
}

DRD int dhdGetSerialNumber(unsigned short* serial, char id) {
  return ask(id, [&](DrdDevice& device) { return *serial = device.serial, 0; }, -1);
}
DRD int dhdGetSystemType(char id) { return ask(id, [](DrdDevice& device) { return device.type; }, -1); }
DRD const char* dhdGetSystemName(char id) { return ask(id, [](DrdDevice& device) { return device.name; }, nullptr); }
DRD bool dhdHasWrist(char id) { return ask(id, [](DrdDevice& device) { return device.has_wrist; }, false); }
DRD bool dhdHasActiveWrist(char id) { return ask(id, [](DrdDevice& device) { return device.has_active_wrist; }, false); }
DRD bool dhdHasGripper(char id) { return ask(id, [](DrdDevice& device) { return device.has_gripper; }, false); }
DRD int dhdGetStatus(int* status, char id) {
  return ask(
      id,
      [&](DrdDevice& device) {
        if (!device.has_status) return fail(error_refused);
        pass(device);
        const int now[17] = {device.has_power, 1, 1, 0, !device.has_force, device.has_force && device.has_power, device.has_brakes, 0,
                             device.has_wrist, 0, device.is_carried, 0, 1, 0, device.cause, 0, 1};
        std::copy(now, now + 17, status);
        return 0;
      },
      -1);
}

DRD int dhdGetPositionAndOrientationFrame(double* x, double* y, double* z, double matrix[3][3], char id) {
  const auto give = [&](DrdDevice& device) {
    const fs_vec3 p = to_sdk(device.fetched.position);
    *x = p.x, *y = p.y, *z = p.z;
    const fs_vec3 turned = device.fetched.rotation;
    const fs_quat q = norm(turned) > 0 ? scenes::turn(turned, norm(turned)) * device.orientation : device.orientation;
    for (int i = 0; i < 3; ++i) {  // column i: where the handle's axis i of the SDK's frame points
      const fs_vec3 axis = to_sdk(rotate(q, to_device(i == 0, i == 1, i == 2)));
      matrix[0][i] = axis.x, matrix[1][i] = axis.y, matrix[2][i] = axis.z;
    }
  };
  const int known = ask(
      id,
      [&](DrdDevice& device) {
        if (device.odd_answer || now_s() - device.fetched_at > it().time_guard) return 0;
        give(device);
        return 1;
      },
      -1);
  if (known != 0) return known;
  return call(id, [&](DrdDevice& device) {
    const int odd = std::exchange(device.odd_answer, 0);
    if (odd < 0) return fail(error_refused);
    device.fetched = device.handle.measure();
    if (odd == 7) device.fetched.position.x = std::nan("");
    device.fetched_at = now_s();
    give(device);
    return 0;
  });
}
DRD int dhdGetGripperAngleRad(double* angle, char id) {
  return ask(id, [&](DrdDevice& device) { return *angle = device.grip, 0; }, -1);
}
DRD unsigned dhdGetButtonMask(char id) { return ask(id, [](DrdDevice& device) { return device.buttons; }, 0u); }
DRD int dhdEmulateButton(unsigned char on, char id) {
  return ask(id, [&](DrdDevice& device) { return device.buttons_emulated = on, 0; }, -1);
}
DRD double dhdGetMaxForce(char id) { return ask(id, [](DrdDevice& device) { return device.limit; }, -1.0); }

DRD int dhdSetForceAndTorqueAndGripperForce(double fx, double fy, double fz, double tx, double ty, double tz, double, char id) {
  return call(id, [&](DrdDevice& device) {
    const fs_vec3 force = to_device(fx, fy, fz);
    const double now = now_s();
    device.asked = force;
    device.asked_torque = to_device(tx, ty, tz);
    device.asked_at = now;
    if (norm(force) > 0) device.last_force_asked = now;
    const fs_vec3 carrying{0, 0, device.is_carried ? device.weight : 0};
    const bool gives = device.has_force && device.has_power && device.is_initialized && !device.is_homing;
    device.handle.command(gives ? force + carrying : fs_vec3{}, gives ? device.asked_torque : fs_vec3{});
    device.handle.with_plant([&](stability::Plant& plant) { plant.push = {0, 0, -device.weight}; });
    return norm(force) > 12 ? 2 : 0;
  });
}
DRD int dhdEnableForce(unsigned char on, char id) {
  return call(id, [&](DrdDevice& device) {
    ++device.times_enabled;
    if (on) device.asked_when_enabled = std::fmax(device.asked_when_enabled, norm(device.asked));
    device.asked_at = now_s();
    if (device.cause == 1 && on) return 0;  // its button is for people
    device.has_force = on;
    device.cause = on ? 0 : 4;
    return 0;
  });
}
DRD int dhdSetBrakes(int on, char id) { return call(id, [&](DrdDevice& device) { return device.has_brakes = on, 0; }); }
DRD int dhdStop(char id) {
  return call(id, [](DrdDevice& device) {
    end_force(device, 4);
    device.has_brakes = true;
    return 0;
  });
}
DRD int dhdSetGravityCompensation(int on, char id) {
  return ask(id, [&](DrdDevice& device) { return device.is_carried = on, 0; }, -1);
}

DRD bool drdIsSupported(char id) { return ask(id, [](DrdDevice& device) { return device.can_home; }, false); }
DRD bool drdIsInitialized(char id) { return ask(id, [](DrdDevice& device) { return device.is_initialized; }, false); }
DRD int drdAutoInit(char id) {
  if (call(id, [](DrdDevice& device) { return device.asked_when_homing = device.asked, device.is_homing = true, 0; }) < 0) return -1;
  for (int i = 0; i < 30; ++i) {
    if (call(id, [](DrdDevice&) { return 0; }) < 0) return -1;
    sleep_s(0.01);
  }
  return call(id, [](DrdDevice& device) {
    device.is_homing = false;
    device.is_initialized = true;
    ++device.times_homed;
    return 0;
  });
}
DRD int drdStop(bool, char id) { return call(id, [](DrdDevice&) { return 0; }); }

namespace {
std::atomic<bool> is_expert{false};
}
DRD int dhdEnableExpertMode() { return is_expert = true, 0; }
DRD int dhdDisableExpertMode() { return is_expert = false, 0; }
DRD int dhdSetWatchdog(unsigned char time, char id) {
  return call(id, [&](DrdDevice& device) {
    if (!is_expert || !device.has_watchdog) return fail(error_refused);
    device.watchdog = time;
    device.handle.set_watchdog(time * 125e-6);
    return 0;
  });
}

// Encoders that count 10 um each along the axes; joint angles that are the counts; the mass of the model, and no other.
DRD int dhdDeltaPositionToEncoder(double x, double y, double z, int* e0, int* e1, int* e2, char) {
  *e0 = static_cast<int>(std::lround(x / 10e-6)), *e1 = static_cast<int>(std::lround(y / 10e-6)), *e2 = static_cast<int>(std::lround(z / 10e-6));
  return 0;
}
DRD int dhdDeltaEncoderToPosition(int e0, int e1, int e2, double* x, double* y, double* z, char) {
  *x = 10e-6 * e0, *y = 10e-6 * e1, *z = 10e-6 * e2;
  return 0;
}
DRD int dhdDeltaEncodersToJointAngles(int e0, int e1, int e2, double* j0, double* j1, double* j2, char) {
  *j0 = e0, *j1 = e1, *j2 = e2;
  return 0;
}
DRD int dhdJointAnglesToInertiaMatrix(double[8], double matrix[6][6], char id) {
  if (!is_expert) return fail(error_refused);
  return ask(
      id,
      [&](DrdDevice& device) {
        double mass = 0;
        device.handle.with_plant([&](stability::Plant& plant) { mass = plant.device().mass; });
        for (int i = 0; i < 6; ++i) {
          for (int k = 0; k < 6; ++k) matrix[i][k] = i == k ? mass * (1 + 0.1 * i) : 0;
        }
        return 0;
      },
      -1);
}
