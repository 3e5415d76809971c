#include "device/support/usb_pipes.h"

#include <libusb.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "device/support/clock.h"
#include "device/support/refusal.h"

namespace fs {
namespace {

constexpr unsigned command_life = 20;    // ms, until a command that was not taken is withdrawn
constexpr double end_within = 0.5;       // s
constexpr double mend_within = 0.02;     // s, to get transfers back from an endpoint that has stalled
constexpr double mend_after = 1e-3;  // s, between two tries after an error: when a device is being pulled out, each fails at once

}  // namespace

struct UsbPipes::Callbacks {
  static void LIBUSB_CALL in(libusb_transfer* transfer) {
    Slot& slot = *static_cast<Slot*>(transfer->user_data);
    slot.pipes->in_done(slot);
  }
  static void LIBUSB_CALL out(libusb_transfer* transfer) {
    Slot& slot = *static_cast<Slot*>(transfer->user_data);
    slot.pipes->out_done(slot);
  }
};

UsbPipes::UsbPipes(UsbDevice& device, const UsbEndpoints& endpoints, Taker taker, void* self)
    : device_(device), endpoints_(endpoints), taker_(taker), self_(self) {
  try {
    prepare(slots_[0], endpoints.in, endpoints.in_size, 0);
    prepare(slots_[1], endpoints.in, endpoints.in_size, 0);
    prepare(slots_[2], endpoints.out, endpoints.out_size, command_life);
  } catch (...) {
    for (Slot& slot : slots_) libusb_free_transfer(slot.transfer);
    throw;
  }
  submit(slots_[0]);
  submit(slots_[1]);
}

UsbPipes::~UsbPipes() {
  is_ending_ = true;
  cancel_all(steady_now() + end_within);
  if (is_any_in_flight()) device_.abandon();
  for (Slot& slot : slots_) {
    if (slot.is_in_flight) static_cast<void>(slot.buffer.release());  // libusb may still write to it
    else libusb_free_transfer(slot.transfer);
  }
}

void UsbPipes::prepare(Slot& slot, uint8_t endpoint, uint32_t size, unsigned timeout) {
  slot.pipes = this;
  slot.buffer = std::make_unique<uint8_t[]>(size);
  slot.transfer = libusb_alloc_transfer(0);
  if (!slot.transfer) throw std::bad_alloc();
  const auto fill = endpoints_.is_interrupt ? libusb_fill_interrupt_transfer : libusb_fill_bulk_transfer;
  fill(slot.transfer, device_.handle(), endpoint, slot.buffer.get(), static_cast<int>(size),
       timeout ? Callbacks::out : Callbacks::in, &slot, timeout);
}

bool UsbPipes::is_any_in_flight() const noexcept {
  return std::any_of(slots_.begin(), slots_.end(), [](const Slot& slot) { return slot.is_in_flight; });
}

void UsbPipes::submit(Slot& slot) noexcept {
  const int error = libusb_submit_transfer(slot.transfer);
  slot.is_in_flight = error == LIBUSB_SUCCESS;
  if (slot.is_in_flight) return;
  if (error == LIBUSB_ERROR_NO_DEVICE) is_gone_ = true;
  ++counts_.errors;
  if (&slot == &slots_[2]) {
    ++counts_.lost;
    has_lost_ = true;
  } else {
    ++faults_;
  }
}

void UsbPipes::in_done(Slot& slot) noexcept {
  slot.is_in_flight = false;
  events_ = 1;
  const libusb_transfer& transfer = *slot.transfer;
  switch (transfer.status) {
    case LIBUSB_TRANSFER_COMPLETED:
      ++counts_.reports;
      taker_(self_, slot.buffer.get(), static_cast<size_t>(transfer.actual_length));
      if (!is_ending_ && !is_in_stalled_ && !is_gone_) submit(slot);
      break;
    case LIBUSB_TRANSFER_NO_DEVICE: is_gone_ = true; break;
    case LIBUSB_TRANSFER_CANCELLED: break;  // by us; mend asks for it anew
    case LIBUSB_TRANSFER_STALL:
      if (!is_in_stalled_) ++counts_.stalls;
      is_in_stalled_ = true;
      ++faults_;
      break;
    case LIBUSB_TRANSFER_OVERFLOW:
      ++counts_.overlong;
      ++faults_;
      break;
    default: ++counts_.errors; ++faults_;
  }
}

void UsbPipes::out_done(Slot& slot) noexcept {
  slot.is_in_flight = false;
  events_ = 1;
  const libusb_transfer& transfer = *slot.transfer;
  if (transfer.status == LIBUSB_TRANSFER_COMPLETED && transfer.actual_length == transfer.length) return;
  if (transfer.status == LIBUSB_TRANSFER_NO_DEVICE) is_gone_ = true;
  if (transfer.status == LIBUSB_TRANSFER_STALL) {
    ++counts_.stalls;
    is_out_stalled_ = true;
  }
  ++counts_.lost;
  has_lost_ = true;
}

// Returns after the first event, or when the time has come.
void UsbPipes::run_events(double until) noexcept {
  const double rest = std::max(0.0, until - steady_now());
  timeval time{static_cast<time_t>(rest), static_cast<suseconds_t>(1e6 * (rest - std::floor(rest)))};
  events_ = 0;
  if (libusb_handle_events_timeout_completed(device_.context(), &time, &events_) == LIBUSB_ERROR_NO_DEVICE) is_gone_ = true;
}

void UsbPipes::cancel_all(double until) noexcept {
  for (Slot& slot : slots_) {
    if (slot.is_in_flight) libusb_cancel_transfer(slot.transfer);
  }
  while (is_any_in_flight() && steady_now() < until) run_events(until);
}

// Puts both IN transfers in flight again after an error, and clears what has stalled.
void UsbPipes::mend() noexcept {
  const double now = steady_now();
  if (is_gone_ || now < mended_ + mend_after) return;
  mended_ = now;
  if (is_in_stalled_) {
    for (Slot* slot : {&slots_[0], &slots_[1]}) {
      if (slot->is_in_flight) libusb_cancel_transfer(slot->transfer);
    }
    while ((slots_[0].is_in_flight || slots_[1].is_in_flight) && steady_now() < now + mend_within) run_events(now + mend_within);
    if (slots_[0].is_in_flight || slots_[1].is_in_flight) return;
    const int error = libusb_clear_halt(device_.handle(), endpoints_.in);
    if (error == LIBUSB_ERROR_NO_DEVICE) is_gone_ = true;
    if (error != LIBUSB_SUCCESS) return;
    is_in_stalled_ = false;
  }
  if (is_out_stalled_ && !slots_[2].is_in_flight) {
    const int error = libusb_clear_halt(device_.handle(), endpoints_.out);
    if (error == LIBUSB_ERROR_NO_DEVICE) is_gone_ = true;
    is_out_stalled_ = error != LIBUSB_SUCCESS;
  }
  if (!is_gone_ && !slots_[0].is_in_flight) submit(slots_[0]);
  if (!is_gone_ && !slots_[1].is_in_flight) submit(slots_[1]);
}

fs_status UsbPipes::receive(double within) noexcept {
  const double until = steady_now() + within;
  for (;;) {
    if (!slots_[0].is_in_flight || !slots_[1].is_in_flight || is_out_stalled_) mend();
    if (is_gone_) return FS_ERROR_DISCONNECTED;
    run_events(counts_.reports == taken_ ? until : 0);  // there may be a newer one
    if (is_gone_) return FS_ERROR_DISCONNECTED;
    if (faults_ != 0) {
      faults_ = 0;
      taken_ = counts_.reports;
      return FS_ERROR_IO;
    }
    if (counts_.reports != taken_) {
      taken_ = counts_.reports;
      return FS_OK;
    }
    if (steady_now() >= until) return FS_ERROR_TIMEOUT;
    if (!slots_[0].is_in_flight && !slots_[1].is_in_flight) {  // nothing can come until they are mended
      pause(std::clamp(std::min(until, mended_ + mend_after) - steady_now(), 0.0, mend_after));
    }
  }
}

fs_status UsbPipes::flush(double within) noexcept {
  const double until = steady_now() + within;
  while (slots_[2].is_in_flight && !is_gone_) {
    if (steady_now() >= until) return FS_ERROR_TIMEOUT;
    run_events(until);
  }
  if (is_gone_) return FS_ERROR_DISCONNECTED;
  if (!has_lost_) return FS_OK;
  has_lost_ = false;
  return FS_ERROR_IO;
}

fs_status UsbPipes::send(const uint8_t* data, size_t size, double within) noexcept {
  if (size > endpoints_.out_size) return FS_ERROR_INVALID;
  const fs_status status = flush(within);
  if (status != FS_OK) return status;
  if (is_out_stalled_) {
    mend();
    if (is_gone_) return FS_ERROR_DISCONNECTED;
    if (is_out_stalled_) return FS_ERROR_IO;
  }
  std::memcpy(slots_[2].buffer.get(), data, size);
  slots_[2].transfer->length = static_cast<int>(size);
  submit(slots_[2]);
  if (is_gone_) return FS_ERROR_DISCONNECTED;
  if (slots_[2].is_in_flight) return FS_OK;
  has_lost_ = false;
  return FS_ERROR_IO;
}

}  // namespace fs
