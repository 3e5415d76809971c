#include "server/watcher.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace fs {

Watcher::Watcher() : epoll_(epoll_create1(EPOLL_CLOEXEC)) {
  if (epoll_) return;
  fail(status_without_descriptor(errno), "the server could not be made: %s", std::strerror(errno));
}

void Watcher::add(const Descriptor& descriptor, uint64_t source) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = source;
  if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, descriptor.get(), &event) != 0) {
    fail(FS_ERROR_IO, "the server cannot watch a descriptor: %s", std::strerror(errno));
  }
}

void Watcher::set_reading(const Descriptor& descriptor, uint64_t source, bool is_reading) noexcept {
  epoll_event event{};
  event.events = is_reading ? static_cast<uint32_t>(EPOLLIN) : 0;
  event.data.u64 = source;
  epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, descriptor.get(), &event);
}

void Watcher::remove(const Descriptor& descriptor) noexcept {
  if (descriptor) epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, descriptor.get(), nullptr);
}

std::span<const epoll_event> Watcher::wait(std::span<epoll_event> buffer, int timeout) const noexcept {
  const int count = epoll_wait(epoll_.get(), buffer.data(), static_cast<int>(buffer.size()), timeout);
  return buffer.first(static_cast<size_t>(std::max(count, 0)));
}

}  // namespace fs
