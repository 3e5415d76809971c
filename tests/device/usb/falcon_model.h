// A Novint Falcon as its host meets it: an FT232R, behind it a microcontroller without firmware, and then motors, encoders and a handle
// that somebody's hand holds by a spring. Its kinematics are its own, worked out by differences, so that they check the driver's.
#pragma once

#include <array>
#include <deque>
#include <vector>

#include "device/usb/usb_model.h"
#include "scenes/vector.h"

namespace scenes {

class FalconModel final : public UsbModel {
 public:
  explicit FalconModel(std::string serial) : serial_(std::move(serial)) {}

  // What a test sets, with the bus's mutex held (EmulatedBus::with_models).
  std::vector<uint8_t> firmware;     // the image that it wants
  bool has_firmware = false;         // it has it already
  int deaf_greetings = 0;            // so many greetings are not answered, as users tell of it
  int wrong_echo_at = -1;            // this byte of the image comes back wrong, once
  bool is_homed = true;
  bool homes_when_asked = true;      // a command with the homing bit homes it: somebody moves the handle as it must be
  bool answers = true;               // false: its reports stop
  double late = 0;                   // s, by which the next report comes too late, once
  std::array<int, 3> encoder_offset{};           // a jump
  std::array<bool, 3> is_encoder_stuck{};
  int odd_buttons = 0;
  fs_vec3 target{0, 0, 0.125};       // m, in its own frame: where the hand wants the handle
  double hand_stiffness = 200, hand_damping = 5, mass = 0.25;  // N/m, N s/m, kg
  bool is_held_fast = false;         // the handle is at the target whatever the motors do

  void rest() { motors = {}, force_ = {}; }  // its motors have no power

  // What it sees.
  fs_vec3 position() const { return position_; }
  fs_vec3 force() const { return force_; }       // N, of the motors on the handle, own frame
  std::array<int, 3> motors{};                   // of the newest command
  int lights = 0;                                // bits of the newest command: homing 1, red 2, green 4, blue 8
  int most_motor = 0;                            // the largest command that was ever seen
  uint64_t commands = 0, nonsense = 0;           // packets; bytes that are none
  uint64_t queued = 0;                           // commands that came while another waited for its report
  std::vector<double>* turnarounds = nullptr;    // s, from each report that was taken to the next command, if somebody wants them
  double last_force_time = 0;                    // s, of the clock of the bus: until when it had a force
  double time() const { return time_; }

  std::vector<uint8_t> device_descriptor() const override;
  std::vector<uint8_t> configuration_descriptor() const override;
  std::string string(uint8_t index) const override;
  int control(const UsbSetup& setup, Bytes data, std::vector<uint8_t>& answer, double time) override;
  int out(uint8_t endpoint, Bytes data, double time) override;
  int in(uint8_t endpoint, size_t capacity, std::vector<uint8_t>& data, double time) override;

  static std::array<double, 3> counts_at(fs_vec3 position);  // of the encoders

 private:
  void boot(uint8_t byte);
  void image_byte(uint8_t byte);
  void packet_byte(uint8_t byte);
  void command();
  void report();
  void advance(double time);

  const std::string serial_;
  uint16_t baud_ = 0, latency_ = 16;
  bool dtr_ = false, is_listening_ = false, is_loading_ = false, is_announced_ = false;
  std::vector<uint8_t> heard_, image_, packet_;
  std::deque<uint8_t> for_host_;
  double time_ = 0, last_in_ = 0, last_command_ = 0;
  double reported_ = 0;              // s, when the newest report was taken; 0: it has been answered
  std::deque<double> owed_;          // s, when each report is due
  std::array<int, 3> stuck_at_{};
  fs_vec3 position_{0, 0, 0.125}, velocity_{}, force_{};
};

}  // namespace scenes
