#include "device/fidel/usb/requests.h"

#include <libusb.h>

#include <algorithm>

#include "device/support/clock.h"
#include "device/support/refusal.h"

namespace fs::fidel_usb {
namespace {

constexpr unsigned answer_within = 1000;  // ms
constexpr int waits = 1200;               // of 1 ms: somewhat longer

}  // namespace

struct UsbRequests::Asked {
  libusb_transfer* transfer = nullptr;
  std::vector<uint8_t> buffer;
  std::atomic<bool> is_done{false};

  ~Asked() { libusb_free_transfer(transfer); }
};

void UsbRequests::done(libusb_transfer* transfer) {
  static_cast<Asked*>(transfer->user_data)->is_done.store(true, std::memory_order_release);
}

UsbRequests::UsbRequests(UsbDevice& device) noexcept : device_(device) {}

UsbRequests::~UsbRequests() {
  for (const auto& asked : asked_) {
    if (!asked->is_done) libusb_cancel_transfer(asked->transfer);
  }
  const auto are_done = [this] {
    return std::all_of(asked_.begin(), asked_.end(), [](const auto& asked) { return asked->is_done.load(); });
  };
  for (int i = 0; i < waits && !are_done(); ++i) {
    timeval time{0, 1000};
    libusb_handle_events_timeout_completed(device_.context(), &time, nullptr);
  }
  if (are_done()) return;
  device_.abandon();
  for (auto& asked : asked_) static_cast<void>(asked.release());  // libusb may still write to it
}

std::vector<uint8_t> UsbRequests::ask(uint8_t type, uint8_t request, uint16_t size) {
  const std::lock_guard lock(mutex_);
  std::erase_if(asked_, [](const auto& asked) { return asked->is_done.load(std::memory_order_acquire); });
  auto owned = std::make_unique<Asked>();
  Asked& asked = *owned;
  asked.buffer.resize(LIBUSB_CONTROL_SETUP_SIZE + size);
  asked.transfer = libusb_alloc_transfer(0);
  if (!asked.transfer) throw std::bad_alloc();
  libusb_fill_control_setup(asked.buffer.data(), type, request, 0, 0, size);
  libusb_fill_control_transfer(asked.transfer, device_.handle(), asked.buffer.data(), done, &asked, answer_within);
  asked_.push_back(std::move(owned));
  const int error = libusb_submit_transfer(asked.transfer);
  if (error != LIBUSB_SUCCESS) {
    asked.is_done = true;
    if (error == LIBUSB_ERROR_NO_DEVICE) refuse(FS_ERROR_DISCONNECTED, "the device was unplugged");
    refuse(FS_ERROR_IO, "the request cannot be sent: %s", libusb_error_name(error));
  }
  for (int i = 0; i < waits && !asked.is_done.load(std::memory_order_acquire); ++i) pause(1e-3);
  if (!asked.is_done) refuse(FS_ERROR_TIMEOUT, "the device does not answer the request within %u ms", answer_within);
  switch (asked.transfer->status) {
    case LIBUSB_TRANSFER_COMPLETED: break;
    case LIBUSB_TRANSFER_STALL: refuse(FS_ERROR_STATE, "the device refuses the request at present");
    case LIBUSB_TRANSFER_NO_DEVICE: refuse(FS_ERROR_DISCONNECTED, "the device was unplugged");
    case LIBUSB_TRANSFER_TIMED_OUT:
      refuse(FS_ERROR_TIMEOUT, "the device does not answer the request within %u ms", answer_within);
    default: refuse(FS_ERROR_IO, "the request has failed on the bus");
  }
  const uint8_t* const data = libusb_control_transfer_get_data(asked.transfer);
  return {data, data + asked.transfer->actual_length};
}

}  // namespace fs::fidel_usb
