// Serves a device model to the kernel's own USB stack: the kernel's driver vhci_hcd has one end of a pair of sockets, and a thread
// here answers at the other end, as a USB/IP server does. Needs root and the module vhci_hcd.
#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "device/usb/usb_model.h"

namespace scenes {

class ServedDevice {
 public:
  enum Speed : int { full = 2, high = 3 };  // as the kernel numbers them

  explicit ServedDevice(UsbModel& model, Speed speed = full);  // plugs it in; throws std::runtime_error
  ~ServedDevice() { unplug(); }
  ServedDevice(const ServedDevice&) = delete;
  ServedDevice& operator=(const ServedDevice&) = delete;

  // Closes the socket, at whatever moment: to the host the device has been pulled out. A second call does nothing.
  void unplug();

  // Calls f while nothing else calls the model.
  template <class Function>
  auto with_model(Function f) {
    const std::lock_guard lock(mutex_);
    return f();
  }

 private:
  // A transfer that waits for the device.
  struct Transfer {
    uint32_t number, endpoint;  // number: the kernel's, of this transfer; endpoint: with 0x80 where the host reads
    bool may_be_short;
    UsbSetup setup;
    size_t capacity;            // bytes, of an answer
    std::vector<uint8_t> data;  // what the host sends
  };
  struct Answer {
    int status = 0;  // 0 or a negative error number of the kernel
    size_t carried = 0;
    std::vector<uint8_t> data;
  };

  void attach(int socket, Speed speed);
  void serve() noexcept;
  bool take_command();  // false: the socket was closed
  bool receive(void* data, size_t size) const;
  void send(const std::vector<uint8_t>& bytes) const;
  void try_transfers();
  int carry(const Transfer& transfer, Answer& answer);  // as the functions of UsbModel
  int control(const Transfer& transfer, Answer& answer);
  int describe(const UsbSetup& setup, Answer& answer) const;
  void complete(const Transfer& transfer, int result, Answer& answer) const;

  UsbModel& model_;
  std::mutex mutex_;
  int socket_ = -1;
  uint8_t configuration_ = 0;
  std::deque<Transfer> waiting_;
  std::thread thread_;
};

}  // namespace scenes
