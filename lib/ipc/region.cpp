#include "ipc/region.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace fs {

Descriptor make_region(const char* label, size_t bytes) {
  Descriptor region(memfd_create(label, MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!region || ftruncate(region.get(), static_cast<off_t>(bytes)) != 0 ||
      fcntl(region.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW) != 0) {
    fail(status_without_descriptor(errno), "shared memory of %zu bytes could not be made: %s", bytes, std::strerror(errno));
  }
  return region;
}

void seal_region(const Descriptor& region, bool against_writing) {
  if (fcntl(region.get(), F_ADD_SEALS, (against_writing ? F_SEAL_FUTURE_WRITE : 0) | F_SEAL_SEAL) != 0) {
    fail(FS_ERROR_IO, "shared memory could not be sealed: %s", std::strerror(errno));
  }
}

std::shared_ptr<void> map_region(const Descriptor& region, size_t bytes, bool may_write) {
  struct stat info{};
  if (fstat(region.get(), &info) != 0 || info.st_size != static_cast<off_t>(bytes)) {
    fail(FS_ERROR_INVALID, "shared memory has %lld bytes, must be %zu", static_cast<long long>(info.st_size), bytes);
  }
  const int seals = fcntl(region.get(), F_GET_SEALS);
  if (seals < 0 || !(seals & F_SEAL_SHRINK)) fail(FS_ERROR_INVALID, "shared memory could be made shorter");
  void* memory = mmap(nullptr, bytes, PROT_READ | (may_write ? PROT_WRITE : 0), MAP_SHARED, region.get(), 0);
  if (memory == MAP_FAILED) fail(FS_ERROR_IO, "shared memory could not be mapped: %s", std::strerror(errno));
  return {memory, [bytes](void* m) { munmap(m, bytes); }};
}

}  // namespace fs
