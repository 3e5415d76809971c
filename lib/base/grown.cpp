#include "base/grown.h"

#include <algorithm>

#include "base/error.h"
#include "base/version.h"

namespace fs::grown {
namespace {

uint32_t size_of(const void* given, const StructSizes& sizes) {
  uint32_t size;
  std::memcpy(&size, given, sizeof size);
  check_size(size, sizes);
  return size;
}

}  // namespace

void check_size(uint32_t size, const StructSizes& sizes) {
  if (size > largest) {
    fail(FS_ERROR_VERSION, "struct_size of %s is %u, must be at most %u: this library (%s) knows %u", sizes.type, size, largest,
         library_version, sizes.known);
  }
  if (size < sizes.first || size % 8 != 0) {
    fail(FS_ERROR_INVALID, "struct_size of %s is %u, must be sizeof(%s): at least %u, and a multiple of 8", sizes.type, size,
         sizes.type, sizes.first);
  }
}

void read(const void* given, const StructSizes& sizes, void* out) {
  const uint32_t size = size_of(given, sizes), common = std::min(size, sizes.known);
  const auto* const bytes = static_cast<const unsigned char*>(given);
  const auto* const unknown = std::find_if(bytes + common, bytes + size, [](unsigned char byte) { return byte != 0; });
  if (unknown != bytes + size) {
    fail(FS_ERROR_VERSION,
         "%s has a field at byte %td that is not 0, and this library (%s) knows only its first %u bytes "
         "(struct_size is %u): it is older than its caller",
         sizes.type, (unknown - bytes) / 8 * 8, library_version, sizes.known, size);
  }
  std::memcpy(out, given, common);
  std::memcpy(out, &common, sizeof common);
}

void write(const void* ours, const StructSizes& sizes, void* out) {
  const uint32_t size = size_of(out, sizes), common = std::min(size, sizes.known);
  std::memcpy(out, ours, common);
  std::memcpy(out, &size, sizeof size);
  std::memset(static_cast<unsigned char*>(out) + common, 0, size - common);
}

void require_zeros(const double* reserved, size_t count, const char* owner) {
  for (size_t i = 0; i < count; ++i) {
    if (!(reserved[i] == 0)) fail(FS_ERROR_INVALID, "%s.reserved[%zu] is %.9g, must be 0", owner, i, reserved[i]);
  }
}

}  // namespace fs::grown
