// A Novint Falcon that is connected: what module.cpp makes a driver's table of. For each function see driver.h.
//
// A command is answered by a report, so one is sent for each report, and again when none has come for 5 ms. One thread at a time
// calls receive, send and get_link; a request may take the device from it while firmware is loaded.
#pragma once

#include <array>
#include <atomic>
#include <mutex>
#include <optional>
#include <string>

#include <forceserver/driver.h>

#include "device/falcon/kinematics.h"
#include "device/falcon/packet.h"
#include "device/support/address.h"
#include "device/support/encoder_watch.h"
#include "device/support/link_meter.h"
#include "device/support/usb.h"
#include "device/support/usb_pipes.h"

namespace fs::falcon {

class Falcon {
 public:
  explicit Falcon(const Address& address);  // "0?firmware=PATH"; throws a Refusal
  ~Falcon();                             // force 0, lights off
  Falcon(const Falcon&) = delete;
  Falcon& operator=(const Falcon&) = delete;

  void get_info(fs_device_info& out) const;
  fs_status receive(fs_state& out) noexcept;
  fs_status send(const fs_wrench& wrench) noexcept;
  fs_status get_link(fs_link& out) noexcept;
  std::string control(const std::string& text);  // any thread; throws a Refusal

 private:
  void start_pipes();
  static void take(void* self, const uint8_t* data, size_t size) noexcept;
  fs_status await_report(double within, uint64_t known) noexcept;
  void judge(double time, fs_state& out) noexcept;
  fs_status without_report(fs_status status, double time, fs_state& out) noexcept;
  void doubt(uint32_t reason) noexcept;  // not ready, until some reports have come without trouble
  void tell() noexcept;
  Command command_for(const fs_wrench& wrench, double time) const noexcept;
  std::string load(const std::string& path);
  std::string status();

  const double motor_constant_;
  double force_max_ = 0;
  UsbDevice usb_;
  std::mutex mutex_;                     // of the device and of what follows, as far as it is not atomic
  std::atomic<bool> is_wanted_{false};   // a request waits for the device, or has it
  std::atomic<int> lights_{-1};          // -1: they tell the state
  std::atomic<bool> wants_homing_{false};

  std::optional<UsbPipes> pipes_;
  Reports reports_;
  Report newest_;
  uint64_t count_ = 0, told_ = 0;        // reports; those that receive has told of
  double report_time_ = 0;               // s, monotonic clock, of the newest; or when the device was opened
  bool has_answered_ = false;
  bool is_waiting_ = false;              // a command has not been answered
  bool has_sent_twice_ = false;          // another was sent meanwhile
  bool is_homing_ = false;
  double homing_since_ = 0;              // s
  EncoderWatch watch_;
  EncoderWatch::Verdict verdict_ = EncoderWatch::good;
  uint32_t reason_ = FS_STATE_CONNECTING;  // why it is not ready
  int settled_ = 0;                      // good reports since the last fault
  std::optional<Pose> pose_;             // of the newest report
  Vec3 position_{};                      // m, device frame, the last that was known
  bool is_ready_ = false;
  LinkMeter meter_;
  uint32_t sent_ = 0;                    // commands
  double sent_at_ = 0;                   // s, the one that waits for its answer

  // What the request "status" tells, as of the newest report or fault.
  struct Told {
    Report report;
    uint64_t reports = 0, stray = 0;
    UsbPipes::Counts usb;
    const char* condition = "it has not answered yet";
  };
  std::mutex told_mutex_;  // receive never waits for it
  Told now_;
};

}  // namespace fs::falcon
