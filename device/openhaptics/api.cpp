#include "device/openhaptics/api.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>

#include "device/openhaptics/quiet.h"
#include "device/support/maker_library.h"
#include "device/support/refusal.h"

namespace fs::openhaptics {
namespace {

#define FIND(name) library.find(api->name, #name)

std::unique_ptr<Api> find_all(const MakerLibrary& library) {
  auto api = std::make_unique<Api>();
  api->path = library.path();
  FIND(hdGetError);
  FIND(hdInitDevice);
  FIND(hdDisableDevice);
  FIND(hdMakeCurrentDevice);
  FIND(hdBeginFrame);
  FIND(hdEndFrame);
  FIND(hdEnable);
  FIND(hdGetDoublev);
  FIND(hdGetIntegerv);
  FIND(hdGetBooleanv);
  FIND(hdGetString);
  FIND(hdSetDoublev);
  FIND(hdCheckCalibration);
  FIND(hdUpdateCalibration);
  FIND(hdScheduleAsynchronous);
  FIND(hdUnschedule);
  FIND(hdStartScheduler);
  FIND(hdStopScheduler);
  return api;
}

MakerLibrary load(const std::optional<std::string>& library) {
  constexpr const char* name = "OpenHaptics (libHD.so.3.4; device/openhaptics/README.md in the source tells how to install it)";
  const Quiet quiet;
  return library ? MakerLibrary(name, {*library}) : MakerLibrary(name, {"libHD.so.3.4", "libHD.so.3.5", "libHD.so"});
}

// What helps where the loader misses a library that OpenHaptics itself needs.
std::string cure_of(const std::string& words) {
  const auto misses = [&](const char* name) { return words.find(name) != std::string::npos; };
  if (misses("libncurses.so.5") || misses("libtinfo.so.5")) {
    return "; install the package libncurses5, or on a system that no longer has it, make links with these names to its .so.6 files";
  }
  if (misses("libPhantomIOLib42")) return "; install the maker's device driver (Touch Device Driver), which brings that library";
  return "";
}

bool is_same_file(const std::string& a, const std::string& b) {
  std::error_code none;
  return std::filesystem::equivalent(a, b, none);
}

}  // namespace

std::string words_of(const ErrorInfo& error) {
  constexpr struct {
    unsigned code;
    const char* name;
  } names[] = {{warm_motors, "HD_WARM_MOTORS"},
               {exceeded_max_force, "HD_EXCEEDED_MAX_FORCE"},
               {force_impulse, "HD_EXCEEDED_MAX_FORCE_IMPULSE"},
               {max_velocity, "HD_EXCEEDED_MAX_VELOCITY"},
               {force_error, "HD_FORCE_ERROR"},
               {device_fault, "HD_DEVICE_FAULT"},
               {already_initiated, "HD_DEVICE_ALREADY_INITIATED"},
               {comm_error, "HD_COMM_ERROR"},
               {comm_config_error, "HD_COMM_CONFIG_ERROR"},
               {timer_error, "HD_TIMER_ERROR"}};
  const char* found = "an error of OpenHaptics";
  for (const auto& each : names) {
    if (each.code == error.code) found = each.name;
  }
  char text[128];
  std::snprintf(text, sizeof text, "%s (%#x, internal %d)", found, error.code, error.internal_code);
  return text;
}

unsigned Api::take_errors(ErrorInfo& telling) const noexcept {
  constexpr unsigned most = 64;
  unsigned count = 0;
  for (ErrorInfo error = hdGetError(); error.code != 0 && count < most; error = hdGetError()) {
    const auto weight = [](unsigned code) { return is_unreachable(code) ? 2 : ends_force(code) ? 1 : 0; };
    if (count++ == 0 || weight(error.code) > weight(telling.code)) telling = error;
  }
  return count;
}

const Api& load_api(const std::optional<std::string>& library) {
  static std::mutex mutex;
  static const Api* loaded = nullptr;  // for good: the library has a thread of its own
  static std::string asked_for;
  const std::lock_guard lock(mutex);
  if (loaded) {
    if (library && *library != asked_for && !is_same_file(*library, loaded->path)) {
      refuse(FS_ERROR_INVALID, "library is '%s', but this process already uses %s", library->c_str(), loaded->path.c_str());
    }
    return *loaded;
  }
  try {
    loaded = find_all(load(library)).release();
    asked_for = library.value_or("");
  } catch (Refusal& refusal) {
    refusal.text += cure_of(refusal.text);
    throw;
  }
  return *loaded;
}

}  // namespace fs::openhaptics
