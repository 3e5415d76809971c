// A Touch, a Touch X or a Phantom that is open: what module.cpp makes a driver's table of. For each function see driver.h.
//
//   OpenHaptics' thread (1 kHz), for all devices of the process:   run: pose -> state_ .... command_ -> force
//   the servo's thread, or the library's for this driver:          receive: waits for state_     send: command_
//
// The callback never waits for anyone: a force that has not come yet goes with the next cycle, and one that is 20 ms old counts as 0.
// The other two threads never call OpenHaptics, so the servo's own thread may be one of them.
#pragma once

#include <atomic>
#include <mutex>
#include <string>

#include <forceserver/driver.h>

#include "base/seqlock.h"
#include "device/openhaptics/api.h"
#include "device/support/address.h"
#include "device/support/link_meter.h"

namespace fs::openhaptics {

class Touch {
 public:
  explicit Touch(const Address& address);  // "NAME?library=PATH"; throws a Refusal
  // Sets the force to 0, and gives the device back. False: the thread of OpenHaptics hangs within run, so this must not be deleted.
  bool end() noexcept;
  Touch(const Touch&) = delete;
  Touch& operator=(const Touch&) = delete;

  void get_info(fs_device_info& out) const;
  fs_status receive(fs_state& out) noexcept;
  fs_status send(const fs_wrench& wrench) noexcept;
  fs_status get_link(fs_link& out) noexcept;
  std::string control(const std::string& request);  // any thread; throws a Refusal

  // Called by the thread of OpenHaptics once in a cycle. may_push: otherwise the force is 0. False: the force was 0, and it must not be
  // called again.
  bool run(bool may_push) noexcept;
  Handle handle() const noexcept { return handle_; }

 private:
  struct State {
    fs_state state{};
    ErrorInfo error{};  // that this cycle had last
    uint32_t errors_in_a_row = 0;  // cycles, up to this one, in which the device could not be reached
    double answered = 0;  // s, from the pose to its force, where this cycle sent one; 0: none
    float temperature = 0, padding = 0;  // of the hottest motor, 0..1
    int64_t calibration = calibrated;
  };
  struct Command {
    fs_wrench wrench{};
    double time = 0;  // s, when it was given
    double answers = 0;  // s, the time of the pose that it answers
  };

  void initialise(const std::string& name);
  bool run_cycle(bool may_push) noexcept;
  void look_around(double time) noexcept;
  uint32_t reason(double time) const noexcept;
  void read_pose(fs_state& out) noexcept;
  void write_force(const Command& command) const noexcept;
  std::string status() const;
  std::string home();

  const Api& api_;
  Handle handle_ = no_handle;
  std::string name_, serial_;
  double force_max_ = 0;  // N
  bool has_torque_ = false;
  int style_ = 0;  // bits of Style
  double low_[3] = {}, high_[3] = {};  // mm, of the workspace, in the frame of OpenHaptics

  Latest<State> state_;  // written by run
  Latest<Command> command_;  // written by send
  std::atomic<uint32_t> number_{0};  // of states
  std::atomic<bool> is_ending_{false}, is_in_run_{false}, wants_calibration_{false};

  // run uses these.
  double updated_at_ = 0;  // s: when the calibration was last updated
  double looked_at_ = 0;  // s: when the temperature was looked at
  double interrupted_at_ = 0;  // s: when a force was ended here, of which the servo has not heard yet; 0: none
  bool has_force_ = false;  // the newest that was sent is not 0
  double stopped_until_ = 0, fast_until_ = 0;  // s: until when an error counts
  bool is_in_inkwell_ = false;
  State now_;
  double answered_time_ = 0;  // s, of the newest force that was sent

  // Who calls receive and send uses these.
  uint32_t seen_ = 0;  // the number of the newest state that receive has told
  double heard_ = 0;  // s, when that was
  double pose_time_ = 0;  // s, of that state
  uint32_t sent_ = 0;
  LinkMeter meter_;
};

// As fs_driver.list: the default device, where one of 3D Systems is on the USB.
void list_touches(fs_device_entry* out, size_t capacity, size_t* count);

}  // namespace fs::openhaptics
