// The text of an expression: of a profile, and of the heights of a texture.
#include <vector>

#include <forceserver/object.h>

#include "fuzz/fuzz.h"

using fuzz::require;

static void require_reason(fs_status status) {
  const bool is_expected = status == FS_ERROR_PARSE || status == FS_ERROR_INVALID;
  require(is_expected && *fs_last_error(), "a refusal:", fs_last_error());
}

static void evaluate(fs_curve* curve) {
  const double distances[] = {0, 1e-7, 1e-6, 1e-3, 0.01, 0.5, 1, 1e3, 1e9};
  constexpr size_t count = std::size(distances);
  fs_profile profile = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 5);
  profile.reach = 2;
  profile.curve = curve;
  for (const double most : {0.0, 100.0}) {
    for (const double time : {0.0, 1.5}) {
      double forces[count];
      require(fs_profile_evaluate(&profile, most, time, distances, count, forces) == FS_OK, "evaluated:", fs_last_error());
      for (const double force : forces) require(force >= 0 && force <= 5, "a force beyond its limit");
      if (most == 0) continue;
      // Nowhere steeper than it may be, but for rounding, and between samples of an expression.
      for (size_t i = 0; i < count; ++i) require(forces[i] <= most * distances[i] * (1 + 1e-9) + 1e-9, "a force above its cap");
    }
  }
  fs_object wall = fs_object_init("wall", FS_PRIMITIVE_PLANE);
  wall.front = wall.back = profile;
  wall.back.sense = FS_SENSE_REPULSIVE;
  double forces[count];
  require(fs_object_evaluate_law(&wall, 500, 0.25, distances, count, forces) == FS_OK, "law:", fs_last_error());
  for (const double force : forces) require(std::fabs(force) <= 5, "a force of a law beyond its limit");
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  fs_curve* curve = nullptr;
  const fs_status status = fs_curve_create_expression(text.c_str(), &curve);
  if (status == FS_OK) {
    require(text.c_str() == std::string_view(fs_curve_get_expression(curve)), "another text");
    evaluate(curve);
    fs_curve_destroy(curve);
  } else {
    require_reason(status);
  }

  fs_surface_settings settings = fs_surface_settings_init();
  settings.columns = settings.rows = 4;
  settings.column_width = settings.row_width = 0.01;
  fs_surface* surface = nullptr;
  const fs_status made = fs_surface_create_expression(&settings, text.c_str(), &surface);
  if (made == FS_OK) {
    size_t count = 0;
    const double* const heights = fs_surface_get_heights(surface, &count);
    require(count == 16, "heights are missing");
    for (size_t i = 0; i < count; ++i) require(heights[i] <= 0 && heights[i] >= -1, "a height out of its range");
    fs_surface_destroy(surface);
  } else {
    require_reason(made);
  }
  return 0;
}
