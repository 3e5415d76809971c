// A USB device as its host meets it, without a host: descriptors and endpoints. What stands between a model and the driver is
// another matter: an imitation of usbfs in this process (emulated_bus.h), or the kernel's own USB stack (tests/device/kernel).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace scenes {

// The 8 bytes that open a control transfer (USB 2.0, 9.3).
struct UsbSetup {
  uint8_t request_type, request;
  uint16_t value, index, length;
};

class UsbModel {
 public:
  using Bytes = std::span<const uint8_t>;
  virtual ~UsbModel() = default;

  // As the bus carries them (USB 2.0, 9.6): 18 bytes; the configuration with its interfaces and endpoints.
  virtual std::vector<uint8_t> device_descriptor() const = 0;
  virtual std::vector<uint8_t> configuration_descriptor() const = 0;
  // The strings that the device descriptor names by their index; empty: there is none.
  virtual std::string string(uint8_t index) const = 0;

  // Each returns a negative error number of the kernel (-EPIPE: stall), or how many bytes were carried. One thread at a
  // time calls them. time: s, of any clock that goes on evenly.
  //
  // A control transfer of class or vendor; the standard requests are answered without the model. data: what the host sends,
  // empty when it reads; then the answer goes to `answer`, of at most setup.length bytes.
  virtual int control(const UsbSetup& setup, Bytes data, std::vector<uint8_t>& answer, double time) = 0;
  // What the host sends to a bulk or interrupt endpoint (0x01, 0x02, ..).
  virtual int out(uint8_t endpoint, Bytes data, double time) = 0;
  // What the device has for the host at an endpoint (0x81, ..): at most `capacity` bytes into `data`. -EAGAIN: nothing yet.
  virtual int in(uint8_t endpoint, size_t capacity, std::vector<uint8_t>& data, double time) = 0;
};

}  // namespace scenes
