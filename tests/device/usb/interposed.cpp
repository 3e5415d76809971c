// The functions that stand before those of the C library (and of umockdev): only files of the emulated bus are different.
#include <dlfcn.h>
#include <fcntl.h>

#include <cerrno>
#include <cstdarg>

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

}
