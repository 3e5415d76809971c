#include "ipc/region.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace fs {

const char* memory_file_hint(int error) noexcept {
  const bool is_refused = error == EPERM || error == EACCES || error == ENOSYS;
  return is_refused ? ": memfd_create is not allowed here, as by the seccomp filter of a container" : "";
}

Descriptor make_region(const char* label, size_t bytes) {
  Descriptor region(memfd_create(label, MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!region || ftruncate(region.get(), static_cast<off_t>(bytes)) != 0 ||
      fcntl(region.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW) != 0) {
    const int error = errno;
    fail(status_without_descriptor(error), "shared memory of %zu bytes could not be made: %s%s", bytes, std::strerror(error),
         memory_file_hint(error));
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
