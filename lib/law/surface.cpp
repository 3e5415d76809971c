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

void check_zero(double value, const char* field, const char* without) {
  if (!(value == 0)) fail(FS_ERROR_INVALID, "%s is %.9g, must be 0 without %s", field, value, without);
}

}  // namespace

Impact impact_preset(fs_impact kind) noexcept {
  switch (kind) {
    case FS_IMPACT_SOFT: return {4, 30, 60};
    case FS_IMPACT_MEDIUM: return {8, 100, 80};
    case FS_IMPACT_HARD: return {10, 250, 60};
    default: return {};
  }
}

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
    check_zero(raw_value(settings.axis), "axis", "a texture");
    check_zero(settings.repeats, "repeats", "a texture");
    check_zero(settings.column_width, "column_width", "a texture");
    check_zero(settings.row_width, "row_width", "a texture");
    check_zero(settings.first_column, "first_column", "a texture");
    check_zero(settings.first_row, "first_row", "a texture");
  }
  check_range(settings.impact_gain, 0, 1e6, "impact_gain");
  if (settings.impact_gain > 0) {
    check_range(settings.impact_frequency, 1, 1e5, "impact_frequency");
    check_range(settings.impact_decay, 1, 1e6, "impact_decay");
  } else {
    check_zero(settings.impact_frequency, "impact_frequency", "an impact_gain");
    check_zero(settings.impact_decay, "impact_decay", "an impact_gain");
  }
  fs_surface_settings known = settings;
  known.struct_size = sizeof known;
  return make_ref<Surface>(known, has_texture ? std::optional<Texture>(std::in_place, settings, heights) : std::nullopt);
}

}  // namespace fs
