// The functions that stand before those of the C library (and of umockdev): only files of the emulated bus are different.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cerrno>
#include <cstdarg>
#include <cstring>

#include "device/usb/usbfs.h"

namespace {

using scenes::EmulatedBus;

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

int open_of_bus(const char* path) {
  EmulatedBus::Usbfs* const bus = EmulatedBus::Usbfs::present();
  return bus && path[0] == '/' && path[1] == 'd' ? bus->open(path) : -2;
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  if (const int descriptor = open_of_bus(path); descriptor != -2) return descriptor;
  static const auto real = next<int (*)(const char*, int, ...)>("open");
  va_list arguments;
  va_start(arguments, flags);
  const int mode = flags & (O_CREAT | __O_TMPFILE) ? va_arg(arguments, int) : 0;
  va_end(arguments);
  return real(path, flags, mode);
}

int __open_2(const char* path, int flags) {
  if (const int descriptor = open_of_bus(path); descriptor != -2) return descriptor;
  static const auto real = next<int (*)(const char*, int)>("__open_2");
  return real(path, flags);
}

int close(int descriptor) {
  if (EmulatedBus::Usbfs* const bus = EmulatedBus::Usbfs::present(); bus && bus->has(descriptor)) bus->close(descriptor);
  static const auto real = next<int (*)(int)>("close");
  return real(descriptor);
}

int ioctl(int descriptor, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  if (EmulatedBus::Usbfs* const bus = EmulatedBus::Usbfs::present(); bus && bus->has(descriptor)) {
    if (const int status = bus->control(descriptor, request, argument); status != -2) return status;
  }
  static const auto real = next<int (*)(int, unsigned long, ...)>("ioctl");
  return real(descriptor, request, argument);
}

// umockdev ends the program when libusb stops to listen for devices just while umockdev tells it of one; nobody misses that.
int connect(int socket, const sockaddr* address, socklen_t size) {
  static const auto real = next<int (*)(int, const sockaddr*, socklen_t)>("connect");
  const int status = real(socket, address, size);
  const bool is_of_umockdev = address->sa_family == AF_UNIX && std::strstr(reinterpret_cast<const sockaddr_un*>(address)->sun_path, "umockdev.");
  return status != 0 && is_of_umockdev ? 0 : status;
}

ssize_t sendmsg(int socket, const msghdr* message, int flags) {
  static const auto real = next<ssize_t (*)(int, const msghdr*, int)>("sendmsg");
  const ssize_t count = real(socket, message, flags);
  if (count >= 0 || (errno != ECONNREFUSED && errno != ENOTCONN && errno != EDESTADDRREQ && errno != EPIPE)) return count;
  ssize_t all = 0;
  for (size_t i = 0; i < message->msg_iovlen; ++i) all += static_cast<ssize_t>(message->msg_iov[i].iov_len);
  return all;
}

}
