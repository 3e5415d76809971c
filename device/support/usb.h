// Devices on the USB, by libusb: found, opened, claimed, configured. What streams afterwards is in usb_pipes.h.
//
// Each open device has a context of libusb of its own, never the default one, which a maker's library in the same process may
// use. libusb runs one thread for the process, which hears of devices that come and go; there is no other.
//
// What is wrong is thrown as a Refusal: NOT_FOUND, DENIED (the node may not be opened), IO (in use, or an error on the bus),
// DISCONNECTED (it was unplugged), TIMEOUT.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <forceserver/device.h>

struct libusb_context;
struct libusb_device_handle;

namespace fs {

// A kind of device.
struct UsbKind {
  const char* name;     // for people: "Novint Falcon"
  uint16_t vendor, product;
  const char* product_text;  // the product string must be this one; null: any
};

// A device that is on the bus, of any kind.
struct UsbFound {
  uint16_t vendor, product;
  std::string place;         // bus and ports, "1-4.2": the same as long as it stays in this socket
  std::string node;          // "/dev/bus/usb/001/004"
  std::string serial, text;  // its strings for serial number and product; empty: it has none
};

// Those of a kind, in the order of their places; a null pointer: all. Needs no permission. Without any USB: none.
std::vector<UsbFound> usb_devices(const UsbKind* kind);

// The same as fs_driver.list gives them, with URIs of this scheme ("falcon:") and their serial numbers.
void usb_entries(const UsbKind& kind, const char* scheme, fs_device_entry* out, size_t capacity, size_t* count);

// The one of `found` that is meant by "0", "1", .. (the order of the list) or by a serial number; a serial number comes first.
const UsbFound& usb_choice(const UsbKind& kind, const std::vector<UsbFound>& found, const std::string& which);

// The programs that have a file open, "NAME (pid 1234), ..", as far as this user may see; "": none that can be seen. Of this
// program `own` descriptors do not count.
std::string programs_that_use(const std::string& file, int own = 0);

class UsbDevice {
 public:
  // Opens the device of the kind that `which` names, see usb_choice, and claims the interface. A driver of the kernel that has it
  // is detached, and gets it back when the device is closed.
  UsbDevice(const UsbKind& kind, const std::string& which, int interface);
  ~UsbDevice();
  UsbDevice(const UsbDevice&) = delete;
  UsbDevice& operator=(const UsbDevice&) = delete;

  const UsbFound& found() const noexcept { return found_; }

  // A control transfer to the device, without data, or from it; then the answer, of at most `size` bytes. Each waits 1 s at most.
  void control(uint8_t type, uint8_t request, uint16_t value, uint16_t index);
  std::vector<uint8_t> control_answer(uint8_t type, uint8_t request, uint16_t value, uint16_t index, size_t size);

  // A bulk transfer that is waited for, for what precedes a stream. write sends all. read gives what one transfer brought, which
  // is nothing when nothing came within the time (s).
  void write(uint8_t endpoint, std::span<const uint8_t> data, double within = 1);
  std::vector<uint8_t> read(uint8_t endpoint, size_t size, double within);

  // For usb_pipes.
  libusb_context* context() const noexcept { return context_; }
  libusb_device_handle* handle() const noexcept { return handle_; }
  void abandon() noexcept { is_abandoned_ = true; }  // a transfer did not come back: nothing is freed, and nothing more is asked
  bool is_abandoned() const noexcept { return is_abandoned_; }

 private:
  void open();
  void claim();
  void release() noexcept;
  [[noreturn]] void fail(int error, const char* what) const;

  const UsbKind kind_;
  const int interface_;
  UsbFound found_;
  libusb_context* context_ = nullptr;
  libusb_device_handle* handle_ = nullptr;
  bool is_claimed_ = false, is_abandoned_ = false;
};

}  // namespace fs
