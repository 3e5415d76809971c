#include "ipc/blob.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/error.h"
#include "ipc/region.h"

namespace fs {
namespace {
constexpr int seals = F_SEAL_SEAL | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE;
constexpr size_t most_at_once = 1 << 30;
}  // namespace

BlobWriter::BlobWriter() : blob_(memfd_create("forceserver-data", MFD_CLOEXEC | MFD_ALLOW_SEALING)) {
  if (blob_) return;
  const int error = errno;
  fail(status_without_descriptor(error), "shared memory could not be made: %s%s", std::strerror(error), memory_file_hint(error));
}

void BlobWriter::write(std::span<const std::byte> part) {
  while (!part.empty()) {
    const ssize_t written = ::write(blob_.get(), part.data(), std::min(part.size(), most_at_once));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) fail(FS_ERROR_IO, "shared memory could not be written: %s", std::strerror(errno));
    part = part.subspan(static_cast<size_t>(written));
  }
}

Descriptor BlobWriter::seal() {
  if (fcntl(blob_.get(), F_ADD_SEALS, seals) != 0) {
    fail(FS_ERROR_IO, "shared memory could not be sealed: %s", std::strerror(errno));
  }
  return std::move(blob_);
}

Descriptor make_blob(std::initializer_list<std::span<const std::byte>> parts) {
  BlobWriter blob;
  for (const std::span<const std::byte> part : parts) blob.write(part);
  return blob.seal();
}

void check_blob(const Descriptor& blob, uint64_t bytes) {
  if (!blob)
    fail(FS_ERROR_INVALID, "the data did not come with the message: there was no descriptor, or this process has none left");
  const int found = fcntl(blob.get(), F_GET_SEALS);
  if (found < 0 || (found & seals) != seals) {
    fail(FS_ERROR_INVALID, "the data are not in a memory file with the seals SEAL, SHRINK, GROW and WRITE");
  }
  struct stat info{};
  if (fstat(blob.get(), &info) != 0 || info.st_size < 0 || static_cast<uint64_t>(info.st_size) != bytes) {
    fail(FS_ERROR_INVALID, "the data are %lld bytes, must be %llu", static_cast<long long>(info.st_size),
         static_cast<unsigned long long>(bytes));
  }
}

void read_blob(const Descriptor& blob, uint64_t offset, std::span<std::byte> out) {
  while (!out.empty()) {
    const ssize_t got = pread(blob.get(), out.data(), std::min(out.size(), most_at_once), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) fail(FS_ERROR_IO, "shared memory could not be read: %s", got < 0 ? std::strerror(errno) : "too short");
    offset += static_cast<uint64_t>(got);
    out = out.subspan(static_cast<size_t>(got));
  }
}

std::shared_ptr<const void> map_blob(const Descriptor& blob, uint64_t bytes) {
  check_blob(blob, bytes);
  void* const memory = mmap(nullptr, bytes, PROT_READ, MAP_SHARED, blob.get(), 0);
  if (memory == MAP_FAILED) fail(FS_ERROR_IO, "the data could not be mapped: %s", std::strerror(errno));
  return {memory, [bytes](const void* m) { munmap(const_cast<void*>(m), bytes); }};
}

}  // namespace fs
