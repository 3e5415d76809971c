// A FIDEL as its host meets it: the reference firmware with simulated arms, and a hand at the handle: a mass on a spring.
//
// Its state is in memory that is shared with the children of this process: a parent can look at it, and let its time go on, when
// the process that had the bus is dead.
#pragma once

#include <memory>

#include <forceserver/base.h>

#include "device/usb/fidel_firmware.h"
#include "device/usb/usb_model.h"

namespace scenes {

struct FidelOptions {
  std::string serial = "F0001";
  bool is_homed = true;            // has been, before it is plugged in
  double mark_errors[3] = {0, 0, 0};  // rad: where the marks are, beyond 30 degrees
  double scale = 1;                // of its positions to those of the lengths in its identity
  double wrist_torque = 0.5;       // N m
};

// What the device does, and what a test makes of it.
struct FidelBody {
  fidel_firmware firmware{};
  fidel_inputs inputs{};           // counters and marks are written by the model
  FidelOptions* options = nullptr;
  double time = 0;                 // s, of the bus, up to which it has been simulated
  bool has_time = false;
  uint32_t clock = 0;              // us, of the device

  fs_vec3 position{}, velocity{};  // of the handle, device frame
  fs_vec3 target{};                // where the hand goes to, at 0.5 m/s
  fs_vec3 hand{};                  // where it is, as the other end of its spring
  fs_vec3 force{};                 // N, that the motors give at the handle
  fs_vec3 wrist{};                 // rad
  double hand_stiffness = 300, hand_damping = 30, mass = 0.8;  // N/m, N s/m, kg
  bool shakes = false;             // the target circles by 20 mm, twice a second

  int stuck_joint = -1;            // its encoder gives stuck_count
  int32_t stuck_count = 0;
  int32_t jump[3] = {0, 0, 0};     // counts, added to what the encoders give
  bool is_silent = false;          // makes no reports
  bool is_deaf = false;            // takes no notice of commands
  int damages = 0;                 // of each so many reports one has a wrong bit; 0: none
  int cuts = 0;                    // bytes, by which each report is shorter; negative: longer
  bool repeats = false;            // the number of reports stands still
  uint8_t version = 1;             // that its identity tells

  uint32_t commands = 0, reports = 0;
  uint32_t last_torque = 0;        // us of its clock, when a torque acted last
  uint32_t last_command = 0;       // us, when the last command came
  double largest_start = 0;        // N, of the forces with which the motors began, since a test set it to 0
};

class FidelModel final : public UsbModel {
 public:
  explicit FidelModel(const FidelOptions& options = {});
  ~FidelModel() override;
  FidelModel(const FidelModel&) = delete;
  FidelModel& operator=(const FidelModel&) = delete;

  FidelBody& body() { return *body_; }
  void advance(double time);   // s, of the bus
  void run(double duration);   // s: without a bus

  std::vector<uint8_t> device_descriptor() const override;
  std::vector<uint8_t> configuration_descriptor() const override;
  std::string string(uint8_t index) const override;
  int control(const UsbSetup& setup, Bytes data, std::vector<uint8_t>& answer, double time) override;
  int out(uint8_t endpoint, Bytes data, double time) override;
  int in(uint8_t endpoint, size_t capacity, std::vector<uint8_t>& data, double time) override;

 private:
  void step();
  void tick();
  void read_encoders();

  FidelOptions options_;
  FidelBody* body_;
  uint32_t reported_ = 0;  // us, the tick of the newest report that was fetched
};

}  // namespace scenes
