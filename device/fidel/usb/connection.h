// "fidel:usb": a FIDEL on the USB. receive, send and get_link are called by one thread at a time, in which the reports are also taken; control
// by any thread beside it. What they share is atomic.
#pragma once

#include <atomic>
#include <mutex>
#include <string>

#include "device/fidel/connection.h"
#include "device/fidel/usb/arm.h"
#include "device/fidel/usb/calibration.h"
#include "device/fidel/usb/device_clock.h"
#include "device/fidel/usb/requests.h"
#include "device/support/address.h"
#include "device/support/encoder_watch.h"
#include "device/support/link_meter.h"
#include "device/support/usb_pipes.h"

namespace fs::fidel_usb {

class UsbConnection final : public FidelConnection {
 public:
  explicit UsbConnection(const Address& address);  // throws a Refusal
  ~UsbConnection() override;
  UsbConnection(const UsbConnection&) = delete;
  UsbConnection& operator=(const UsbConnection&) = delete;

  void get_info(fs_device_info& out) const override;
  fs_status receive(fs_state& out) noexcept override;
  fs_status send(const fs_wrench& wrench) noexcept override;
  fs_status write_model(const fs_model&) noexcept override {
    return FS_ERROR_UNSUPPORTED;
  }  // never called: there is no controller
  fs_status get_link(fs_link& out) noexcept override;
  std::string control(const std::string& request) override;

 private:
  struct Means {
    std::array<double, 3> counts;
  };
  enum Step { idle, at_first, at_second };  // what calibrate does next

  Identity ask_identity();
  void take(std::span<const uint8_t> bytes) noexcept;
  void measure(const Report& report, uint32_t missing, double now) noexcept;
  void judge(const Report& report, double step) noexcept;
  std::string calibrate(const std::string& way);
  Means measure();
  std::string told_status();
  std::string trouble() const;

  UsbDevice device_;
  const Identity identity_;
  const std::string serial_;
  const Arm arm_;
  const std::string file_;  // of the calibration; "": none is kept

  // The thread of receive and send uses these.
  Calibration calibration_;
  EncoderWatch watch_;
  DeviceClock clock_;
  LinkMeter meter_;
  LinkMeter::Totals totals_;
  std::array<double, 256> sent_at_{};  // s, by the number of a command; 0: none, or it has been answered
  Arm::Measured measured_;
  fs_state state_{};
  bool is_fresh_ = false, was_homed_ = false, has_report_ = false;
  uint16_t last_report_ = 0, command_ = 0, refused_ = 0;
  int damaged_in_a_row_ = 0;
  double came_ = 0;  // s, the newest report

  // All threads use these.
  std::atomic<uint64_t> reports_{0}, reports_lost_{0}, reports_damaged_{0};
  std::array<std::atomic<int32_t>, 3> joints_{};  // counts of the newest report
  std::atomic<int> verdict_{EncoderWatch::good}, place_{Arm::good};
  std::atomic<bool> is_homed_{false}, is_calibrating_{false}, is_to_change_{false};
  std::atomic<uint64_t> commands_lost_{0};

  std::mutex mutex_;  // of what follows: calibrations one after another
  Step step_ = idle;
  Means first_{};
  Calibration next_;  // is_to_change_: the thread of receive takes it

  UsbPipes pipes_;  // the last but one: it calls take
  UsbRequests requests_;
};

}  // namespace fs::fidel_usb
