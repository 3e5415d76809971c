// A device of Force Dimension that is open: what module.cpp makes a driver's table of. For each function see driver.h.
//
// The functions of the SDK work on the USB in the thread that calls them. So the library's thread for this driver calls them, and never
// the servo's. It goes on when no servo has a force: with each force that is sent the SDK adds what carries the device's own weight,
// and the device's watchdog wants to hear from us.
#pragma once

#include <atomic>
#include <mutex>
#include <string>

#include <forceserver/driver.h>

#include "device/dhd/model.h"
#include "device/dhd/session.h"
#include "device/support/address.h"
#include "device/support/link_meter.h"

namespace fs::dhd {

class Arm {
 public:
  explicit Arm(const Address& address);  // "0?home=yes"; throws a Refusal
  ~Arm();  // force 0, then the brakes
  Arm(const Arm&) = delete;
  Arm& operator=(const Arm&) = delete;

  void get_info(fs_device_info& out) const;
  fs_status receive(fs_state& out) noexcept;
  fs_status send(const fs_wrench& wrench) noexcept;
  fs_status get_link(fs_link& out) noexcept;
  std::string control(const std::string& request);  // any thread; throws a Refusal

 private:
  bool end_force() noexcept;
  void take_commands();
  void measure_mechanism() noexcept;
  std::string home();
  std::string status();
  fs_status read(fs_state& out) noexcept;
  void look_at_status(double time) noexcept;
  fs_status without_pose(double time) noexcept;
  fs_status failed(const char* what) noexcept;

  const std::string place_;
  const double period_;  // s, from one pose to the next
  const Api& api_;
  const Session session_;
  const char id_;
  const Limits limits_;
  bool has_wrist_ = false, has_torque_ = false, has_gripper_ = false, has_watchdog_ = false;
  double force_max_ = 0;  // N
  double mass_ = 0, resolution_ = 0;  // kg, m; 0: not known

  std::mutex mutex_;  // of the device and of what follows: a request has it while the device homes
  bool is_initialized_ = false;
  StatusArray status_{};
  double looked_at_ = 0;  // s, monotonic clock: when status_ was read
  double braked_at_ = 0;  // s: when the device was first seen to have braked; 0: it has not
  double next_ = 0;  // s: when the next pose is due
  double measured_ = 0;  // s: the time of the newest pose; 0: a force has answered it
  bool is_slow_ = false;  // the newest call for a pose took long
  double failing_since_ = 0;  // s: since when every call fails; 0: the last one has succeeded
  uint32_t poses_ = 0, commands_ = 0, saturated_ = 0;
  LinkMeter meter_;

  // What the request "status" tells, as of the newest look at it.
  struct Told {
    StatusArray status{};
    bool is_initialized = false;
    double time = 0;  // s
    uint32_t commands = 0, saturated = 0;
  };
  std::atomic<bool> is_homing_{false};
  std::mutex told_mutex_;  // receive never waits for it
  Told told_;
};

}  // namespace fs::dhd
