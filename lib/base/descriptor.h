// A file descriptor that closes itself.
#pragma once

#include <unistd.h>

#include <cerrno>
#include <utility>

#include <forceserver/base.h>

namespace fs {

class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) noexcept : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() { reset(); }

  void reset() noexcept {
    if (number_ >= 0) close();
  }
  // Returns 0, or -1 with errno: some file systems report a full disk only on close.
  int close() noexcept { return ::close(std::exchange(number_, -1)); }
  int get() const noexcept { return number_; }
  explicit operator bool() const noexcept { return number_ >= 0; }

 private:
  int number_ = -1;
};

// Why a descriptor could not be made: FULL, because the process or the machine has no other left; else IO.
inline fs_status status_without_descriptor(int error) noexcept {
  return error == EMFILE || error == ENFILE ? FS_ERROR_FULL : FS_ERROR_IO;
}

}  // namespace fs
