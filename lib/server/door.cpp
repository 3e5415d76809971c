#include "server/door.h"

#include <sys/eventfd.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace fs {
namespace {

constexpr int most_accepted = 16;

Descriptor open_file() { return Descriptor(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)); }

}  // namespace

Door::Door(const std::string& name, bool is_for_all_users)
    : own_(Listener::for_this_user(name)), shared_(is_for_all_users ? Listener::for_all_users(name) : Listener()),
      spare_(open_file()) {
  if (!spare_) {
    fail(status_without_descriptor(errno), "the server could not be made: %s", std::strerror(errno));
  }
}

bool Door::accept(const Descriptor& listener, const std::function<void(Descriptor&&)>& let_in) {
  for (;;) {
    if (accepted_ == most_accepted) return false;
    Descriptor socket(accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    const int error = socket ? 0 : errno;
    if (error == EAGAIN || error == EWOULDBLOCK) return true;
    ++accepted_;
    if (error == EINTR || error == ECONNABORTED) continue;
    if ((error == EMFILE || error == ENFILE) && spare_) {
      spare_.reset();
      socket = Descriptor(accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
      socket.reset();
      spare_ = open_file();
      if (spare_) continue;
    }
    if (error) return false;  // nothing helps but to try again a little later
    let_in(std::move(socket));
  }
}

void Door::reopen() noexcept {
  accepted_ = 0;
  if (!spare_) spare_ = open_file();
}

void Door::close() noexcept {
  own_.reset();
  shared_.reset();
}

}  // namespace fs
