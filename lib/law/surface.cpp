#include "law/surface.h"

#include "base/error.h"

namespace fs {
namespace {

void check_range(double value, double low, double high, const char* field) {
  if (!(value >= low && value <= high)) {
    fail(FS_ERROR_INVALID, "%s is %.9g, must be within %.9g..%.9g", field, value, low, high);
  }
}

}  // namespace

Ref<const Surface> make_surface(const fs_surface_settings& settings) {
  if (settings.reserved) fail(FS_ERROR_INVALID, "reserved is %u, must be 0", settings.reserved);
  check_range(settings.static_friction, 0, 2, "static_friction");
  check_range(settings.dynamic_friction, settings.static_friction / 10, settings.static_friction, "dynamic_friction");
  check_range(settings.slip_distance, 0, 1e9, "slip_distance");
  fs_surface_settings known = settings;
  known.struct_size = sizeof known;
  return make_ref<Surface>(known);
}

}  // namespace fs
