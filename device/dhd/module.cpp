// The driver "dhd": "dhd:0" or "dhd:SERIAL", for the omega, delta, sigma and lambda of Force Dimension.
#include "device/dhd/arm.h"
#include "device/support/driver_table.h"

namespace {

fs::dhd::Arm* open_at(const char* address) {
  return new fs::dhd::Arm(fs::Address(address, {"library", "home", "rate", "falcon"}));
}

}  // namespace

extern "C" FS_API const fs_driver* fs_driver_entry(void) {
  // Without FS_DRIVER_IN_SERVO, as a closed library does the work.
  static const fs_driver driver = fs::driver_table<fs::dhd::Arm, open_at, fs::dhd::list_arms>("dhd", 0);
  return &driver;
}
