// A USB in this process, for the real libusb: sysfs and hot plug by umockdev, and the files of usbfs by functions that stand
// before those of the C library (open, close, ioctl). Models are met there at half a millisecond's pace, as at full speed.
//
// The bus has sockets "1-1", "1-2", .. A program has one bus at a time, made before anything of libusb is used. The mutex is held
// when a model is called.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "device/usb/usb_model.h"

struct libusb_context;

namespace scenes {

// How a kind of transfer goes wrong, as long as it is set.
enum class UsbFault {
  none,
  stall,     // -EPIPE, and the endpoint is halted until that is cleared
  silence,   // it does not end: nothing comes, or what is sent is not taken
  error,     // -EPROTO, as when a plug is loose
  shortened, // what comes is cut to its half
  overlong,  // more comes than there is room for: -EOVERFLOW
  garbage    // random bytes come, as many as there should be
};

enum class UsbMoment { open, claim, control, out, in };  // when an open, a claim or a transfer of this kind happens
enum class Unplug {
  in_flight,  // the transfers in flight end with "no device"
  between     // they have all just ended well; the next that is submitted is refused
};

struct UsbFaults {
  UsbFault control = UsbFault::none, out = UsbFault::none, in = UsbFault::none;
  bool is_denied = false;          // the node may not be opened
  bool is_in_use = false;          // another program has claimed it
  bool is_stuck = false;           // what is cancelled does not come back
  const char* kernel_driver = "";  // that has its interface until it is detached; "": none
};

struct UsbCounts {
  uint64_t opens = 0, claims = 0, controls = 0, outs = 0, ins = 0, clears = 0, detached = 0;
  uint64_t open_now = 0;           // descriptors
};

class EmulatedBus {
 public:
  EmulatedBus();
  ~EmulatedBus();
  EmulatedBus(const EmulatedBus&) = delete;
  EmulatedBus& operator=(const EmulatedBus&) = delete;

  void plug(int socket, std::shared_ptr<UsbModel> model);
  void unplug(int socket, Unplug how);
  // Unplugged by itself, when as many more of this kind have happened; the last of them does not happen any more.
  void unplug_at(int socket, UsbMoment moment, uint64_t count, Unplug how);
  bool is_plugged(int socket) const;

  void set(int socket, const UsbFaults& faults);  // of the socket; they stay when another device is plugged in
  UsbCounts counts(int socket) const;
  std::string node(int socket) const;             // "/dev/bus/usb/001/002", of what is plugged in
  void with_models(const std::function<void()>& look) const;  // holds the mutex

  class Usbfs;  // for the functions that stand before those of the C library

 private:
  std::unique_ptr<Usbfs> usbfs_;
  libusb_context* context_ = nullptr;  // so that libusb listens all the time: umockdev aborts when a listener ends while it tells
};

}  // namespace scenes
