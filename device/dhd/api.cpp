#include "device/dhd/api.h"

#include <filesystem>
#include <memory>
#include <mutex>

#include "device/support/maker_library.h"
#include "device/support/refusal.h"

namespace fs::dhd {
namespace {

constexpr int version_needed[2] = {3, 16};

#define FIND(name) library.find(api->name, #name)
#define FIND_OPTIONAL(name) library.find_optional(api->name, #name)

std::unique_ptr<Api> find_all(const MakerLibrary& library) {
  auto api = std::make_unique<Api>();
  api->path = library.path();
  FIND(dhdGetSDKVersion);
  int major = 0, minor = 0, release = 0, revision = 0;
  api->dhdGetSDKVersion(&major, &minor, &release, &revision);
  api->version = std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(release);
  if (major != version_needed[0] || minor < version_needed[1]) {
    refuse(FS_ERROR_VERSION, "%s is the Force Dimension SDK %s, must be %d.%d or a later %d", api->path.c_str(),
           api->version.c_str(), version_needed[0], version_needed[1], version_needed[0]);
  }
  FIND(dhdErrorGetLast);
  FIND(dhdErrorGetLastStr);
  FIND(dhdGetDeviceCount);
  FIND(drdOpenID);
  FIND(drdClose);
  FIND(dhdGetSerialNumber);
  FIND(dhdGetSystemType);
  FIND(dhdGetSystemName);
  FIND(dhdHasWrist);
  FIND(dhdHasActiveWrist);
  FIND(dhdHasGripper);
  FIND(dhdGetStatus);
  FIND(dhdGetPositionAndOrientationFrame);
  FIND(dhdGetGripperAngleRad);
  FIND(dhdGetButtonMask);
  FIND(dhdSetForceAndTorqueAndGripperForce);
  FIND(dhdEnableForce);
  FIND(dhdSetBrakes);
  FIND(dhdStop);
  FIND(dhdSetGravityCompensation);
  FIND(drdIsSupported);
  FIND(drdIsInitialized);
  FIND(drdAutoInit);
  FIND(drdStop);
  FIND(dhdEnableExpertMode);
  FIND(dhdDisableExpertMode);
  FIND(dhdSetWatchdog);
  FIND_OPTIONAL(dhdGetMaxForce);
  FIND_OPTIONAL(dhdEmulateButton);
  FIND_OPTIONAL(dhdDeltaPositionToEncoder);
  FIND_OPTIONAL(dhdDeltaEncoderToPosition);
  FIND_OPTIONAL(dhdDeltaEncodersToJointAngles);
  FIND_OPTIONAL(dhdJointAnglesToInertiaMatrix);
  return api;
}

bool is_same_file(const std::string& a, const std::string& b) {
  std::error_code none;
  return std::filesystem::equivalent(a, b, none);
}

}  // namespace

std::string Api::last_error() const {
  const char* const words = dhdErrorGetLastStr();
  return words && *words ? words : "the SDK does not say why";
}

const Api& load_api(const std::optional<std::string>& library) {
  constexpr const char* name =
      "the Force Dimension SDK (libdrd.so.3; device/dhd/README.md in the source tells how to install it)";
  static std::mutex mutex;
  static const Api* loaded = nullptr;  // for good: the SDK has threads of its own
  static std::string asked_for;
  const std::lock_guard lock(mutex);
  if (!loaded) {
    loaded = (library ? find_all(MakerLibrary(name, {*library})) : find_all(MakerLibrary(name, {"libdrd.so.3", "libdrd.so"})))
                 .release();
    asked_for = library.value_or("");
  } else if (library && *library != asked_for && !is_same_file(*library, loaded->path)) {
    refuse(FS_ERROR_INVALID, "library is '%s', but this process already uses %s", library->c_str(), loaded->path.c_str());
  }
  return *loaded;
}

}  // namespace fs::dhd
