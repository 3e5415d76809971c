// The stream of a USB device: reports that come at one endpoint, commands that go to another, both bulk or both interrupt.
//
// Two IN transfers are always in flight, and one OUT transfer at most, so no command waits behind another. All are allocated
// before the first; libusb itself allocates a little when one is submitted. There is no thread: receive and send run the events of
// libusb, and never wait longer than they are told, but for 20 ms after a stall. One thread at a time uses the pipes.
//
// A device that is gone shows in one of two ways, both of which give DISCONNECTED: the transfers in flight end with NO_DEVICE, or, if
// all of them had just been completed, the next that is submitted is refused with NO_DEVICE.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include <forceserver/driver.h>

#include "device/support/usb.h"

struct libusb_transfer;

namespace fs {

struct UsbEndpoints {
  uint8_t in, out;  // addresses: 0x81, 0x02
  uint32_t in_size, out_size;  // bytes of the longest report and command; in_size: a multiple of the endpoint's packet size
  bool is_interrupt;  // otherwise bulk
};

class UsbPipes {
 public:
  // What each IN transfer brought, in the order in which they came: called within receive and send. Must not call the pipes.
  using Taker = void (*)(void* self, const uint8_t* data, size_t size) noexcept;
  struct Counts {
    uint64_t reports = 0,  // IN transfers that brought something
        stalls = 0,  // of either endpoint, each cleared at once
        overlong = 0,  // reports that were longer than in_size
        errors = 0,  // other errors on the bus
        lost = 0;  // commands that the device did not take within 20 ms, or that failed
  };

  UsbPipes(UsbDevice& device, const UsbEndpoints& endpoints, Taker taker, void* self);  // throws a Refusal
  // Cancels what is in flight, and waits until it has come back, for 0.5 s at most: if it has not by then, its memory is left to
  // libusb, and the device stays open until the process ends.
  ~UsbPipes();
  UsbPipes(const UsbPipes&) = delete;
  UsbPipes& operator=(const UsbPipes&) = delete;

  // Waits until at least one report has been taken since the last call, for `within` s at most: then TIMEOUT. IO: there was an error
  // on the bus, or a stall, which has been cleared, so that the next call may succeed (clearing takes the kernel 5 s at most if
  // the device does not answer at all). DISCONNECTED, for good.
  fs_status receive(double within) noexcept;

  // Waits until the command before has been taken, for `within` s at most (then TIMEOUT, and this one is dropped), then hands this
  // one over, without waiting for it. A command that the device does not take within 20 ms is withdrawn; the next call then returns
  // IO, and is dropped as well. size: at most out_size.
  fs_status send(const uint8_t* data, size_t size, double within) noexcept;

  // Waits until the last command has been taken. TIMEOUT, IO, DISCONNECTED.
  fs_status flush(double within) noexcept;

  const Counts& counts() const noexcept { return counts_; }

 private:
  struct Slot {
    UsbPipes* pipes = nullptr;
    libusb_transfer* transfer = nullptr;
    std::unique_ptr<uint8_t[]> buffer;
    bool is_in_flight = false;
  };
  struct Callbacks;

  void prepare(Slot& slot, uint8_t endpoint, uint32_t size, unsigned timeout);
  void submit(Slot& slot) noexcept;
  void in_done(Slot& slot) noexcept;
  void out_done(Slot& slot) noexcept;
  void run_events(double until) noexcept;
  void mend() noexcept;
  void cancel_all(double until) noexcept;
  bool is_any_in_flight() const noexcept;

  UsbDevice& device_;
  const UsbEndpoints endpoints_;
  const Taker taker_;
  void* const self_;
  std::array<Slot, 3> slots_;  // two for reports, one for commands
  Counts counts_;
  uint64_t taken_ = 0;  // reports of which receive has told
  uint64_t faults_ = 0;  // of the IN endpoint, not yet told by receive
  int events_ = 0;  // an event has come that somebody waits for
  bool is_gone_ = false, is_in_stalled_ = false, is_out_stalled_ = false, has_lost_ = false, is_ending_ = false;
  double mended_ = 0;  // s, monotonic clock: when reports were last asked for anew after an error
};

}  // namespace fs
