// Control transfers of a device whose stream another thread runs: that thread also completes them, so that no callback of the
// stream ever runs in the thread that asks.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "device/support/usb.h"

struct libusb_transfer;

namespace fs::fidel_usb {

class UsbRequests {
 public:
  explicit UsbRequests(UsbDevice& device) noexcept;
  // Nobody may run the events of the device meanwhile. Cancels what is still under way.
  ~UsbRequests();
  UsbRequests(const UsbRequests&) = delete;
  UsbRequests& operator=(const UsbRequests&) = delete;

  // A request without data, or one that is answered with at most `size` bytes. Any thread, as long as another one runs the
  // events. Throws a Refusal: STATE (the device refuses it: stall), TIMEOUT after a second, DISCONNECTED, IO.
  std::vector<uint8_t> ask(uint8_t type, uint8_t request, uint16_t size);

 private:
  struct Asked;
  static void done(libusb_transfer* transfer);

  UsbDevice& device_;
  std::mutex mutex_;  // of asked_, and one request at a time
  std::vector<std::unique_ptr<Asked>> asked_;
};

}  // namespace fs::fidel_usb
