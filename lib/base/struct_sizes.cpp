// Written by make_struct_sizes.py from the description of the public headers.
#include <forceserver/driver.h>
#include <forceserver/server.h>

#include "base/grown.h"

namespace fs {

#define SIZES(type, first, known, size)                                                   \
  static_assert((first) <= (known) && (known) <= (size) && (size) == sizeof(type), #type); \
  template <>                                                                             \
  const StructSizes& sizes_of<type>() noexcept {                                          \
    static constexpr StructSizes sizes{#type, first, known};                              \
    return sizes;                                                                         \
  }

SIZES(fs_object, 576, 584, 584)
SIZES(fs_shape_info, 88, 104, 104)
SIZES(fs_surface_settings, 32, 104, 104)
SIZES(fs_device_info, 256, 264, 264)
SIZES(fs_servo_options, 104, 104, 104)
SIZES(fs_servo_stats, 184, 184, 184)
SIZES(fs_server_options, 40, 40, 40)
SIZES(fs_link, 40, 40, 40)
SIZES(fs_model, 280, 280, 280)
SIZES(fs_driver, 88, 120, 120)

}  // namespace fs
