// The driver "openhaptics": "openhaptics:" or "openhaptics:NAME", for the Touch, the Touch X and the Phantoms of 3D Systems.
#include "device/openhaptics/touch.h"
#include "device/support/driver_table.h"

namespace {

using fs::openhaptics::Touch;

Touch* open_at(const char* address) { return new Touch(fs::Address(address, {"library"})); }

void close_touch(void* self) {
  Touch* const touch = static_cast<Touch*>(self);
  if (touch->end()) delete touch;
}

}  // namespace

extern "C" FS_API const fs_driver* fs_driver_entry(void) {
  static const fs_driver driver = [] {
    fs_driver table = fs::driver_table<Touch, open_at, fs::openhaptics::list_touches>("openhaptics", FS_DRIVER_IN_SERVO);
    table.close = close_touch;
    return table;
  }();
  return &driver;
}
