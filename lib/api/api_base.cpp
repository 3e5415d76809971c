#include <forceserver/base.h>

#include "api/guarded.h"
#include "base/version.h"
#include "field/object.h"

using namespace fs;

const char* fs_version(void) { return library_version; }

const char* fs_status_name(fs_status status) {
  switch (status) {
    case FS_OK: return "FS_OK";
    case FS_ERROR_INVALID: return "FS_ERROR_INVALID";
    case FS_ERROR_NOT_FOUND: return "FS_ERROR_NOT_FOUND";
    case FS_ERROR_EXISTS: return "FS_ERROR_EXISTS";
    case FS_ERROR_STATE: return "FS_ERROR_STATE";
    case FS_ERROR_VERSION: return "FS_ERROR_VERSION";
    case FS_ERROR_UNSUPPORTED: return "FS_ERROR_UNSUPPORTED";
    case FS_ERROR_MEMORY: return "FS_ERROR_MEMORY";
    case FS_ERROR_IO: return "FS_ERROR_IO";
    case FS_ERROR_PARSE: return "FS_ERROR_PARSE";
    case FS_ERROR_TIMEOUT: return "FS_ERROR_TIMEOUT";
    case FS_ERROR_DISCONNECTED: return "FS_ERROR_DISCONNECTED";
    case FS_ERROR_DENIED: return "FS_ERROR_DENIED";
    case FS_ERROR_FULL: return "FS_ERROR_FULL";
    case FS_ERROR_INTERNAL: return "FS_ERROR_INTERNAL";
    case FS_STATUS_FORCE_32: break;
  }
  return "an unknown fs_status";
}

const char* fs_last_error(void) { return last_error(); }

fs_status fs_pose_from_z(fs_vec3 position, fs_vec3 direction, fs_pose* out) {
  return guarded([&] {
    require_pointer(out, "out");
    parse_position(position, "position");
    if (!is_finite(direction) || direction == Vec3{}) {
      fail(FS_ERROR_INVALID, "direction is (%g, %g, %g), must be finite and longer than 0", direction.x, direction.y,
           direction.z);
    }
    // The shortest rotation from z to the direction; for straight down, half a turn about x.
    const Vec3 z = normalized(direction);
    const double sideways = std::hypot(z.x, z.y), half = std::atan2(sideways, z.z) / 2;
    const Vec3 axis = sideways > 0 ? normalized(Vec3{-z.y, z.x, 0}) : Vec3{1, 0, 0};
    *out = {position, {std::cos(half), std::sin(half) * axis.x, std::sin(half) * axis.y, 0}};
  });
}
