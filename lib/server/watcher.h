// Waits for events of many descriptors (epoll). Each descriptor has a number, its source.
#pragma once

#include <sys/epoll.h>

#include <cstdint>
#include <span>

#include "base/descriptor.h"

namespace fs {

class Watcher {
 public:
  Watcher();  // FULL, IO

  void add(const Descriptor& descriptor, uint64_t source);  // tells when it can be read. IO
  // False: from now on it only tells that the other side is gone.
  void set_reading(const Descriptor& descriptor, uint64_t source, bool is_reading) noexcept;
  void remove(const Descriptor& descriptor) noexcept;  // which may be none
  // The events that are there; waits for the first. timeout: ms; -1: without end.
  std::span<const epoll_event> wait(std::span<epoll_event> buffer, int timeout) const noexcept;

 private:
  Descriptor epoll_;
};

}  // namespace fs
