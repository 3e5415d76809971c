#include "law/surface.h"

#include "base/enum.h"
#include "base/error.h"

namespace fs {
namespace {

void check_range(double value, double low, double high, const char* field) {
  if (!(value >= low && value <= high)) {
    fail(FS_ERROR_INVALID, "%s is %.9g, must be within %.9g..%.9g", field, value, low, high);
  }
}

void check_zero(double value, const char* field) {
  if (!(value == 0)) fail(FS_ERROR_INVALID, "%s is %.9g, must be 0 without a texture", field, value);
}

}  // namespace

Ref<const Surface> make_surface(const fs_surface_settings& settings, std::span<const double> heights) {
  if (settings.reserved) fail(FS_ERROR_INVALID, "reserved is %u, must be 0", settings.reserved);
  check_range(settings.static_friction, 0, 2, "static_friction");
  check_range(settings.dynamic_friction, settings.static_friction / 10, settings.static_friction, "dynamic_friction");
  check_range(settings.slip_distance, 0, 1e9, "slip_distance");
  for (const uint8_t byte : settings.reserved_8) {
    if (byte) fail(FS_ERROR_INVALID, "reserved_8 is %u, must be 0", byte);
  }
  const bool has_texture = settings.columns || settings.rows || !heights.empty();
  if (!has_texture) {
    check_zero(raw_value(settings.axis), "axis");
    check_zero(settings.repeats, "repeats");
    check_zero(settings.column_width, "column_width");
    check_zero(settings.row_width, "row_width");
    check_zero(settings.first_column, "first_column");
    check_zero(settings.first_row, "first_row");
  }
  fs_surface_settings known = settings;
  known.struct_size = sizeof known;
  return make_ref<Surface>(known, has_texture ? std::optional<Texture>(std::in_place, settings, heights) : std::nullopt);
}

}  // namespace fs
