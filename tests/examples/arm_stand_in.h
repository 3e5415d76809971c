// Stands in for a WoodenHaptics arm: a pseudo terminal in the place of the hidraw node, and behind it the mechanism, held by a
// spring. Its mechanics are worked out anew, from the drawing of the arm, and its Jacobian by differences.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <forceserver/base.h>

namespace arm {

// The angles of the three bodies (rad), and the handle in the device frame (m), for the numbers of woodenhaptics.json.
struct Angles {
  double a, b, c;
};
fs_vec3 handle_of(const Angles& angles);
Angles angles_of(fs_vec3 handle);
// The force at the handle (N) that three motors with these currents (A) make together, without friction.
fs_vec3 force_of(const Angles& angles, const double (&current)[3]);

inline constexpr fs_vec3 home{0, -0.025, 0.205};  // m: where the handle is with body b upright and body c level
inline constexpr fs_vec3 centre{0, 0, 0};

class StandIn {
 public:
  explicit StandIn(std::string node);  // a path, which becomes a link to the pseudo terminal
  ~StandIn();
  StandIn(const StandIn&) = delete;
  StandIn& operator=(const StandIn&) = delete;

  void plug();    // as the constructor does; the handle is where it was, the counts go on from there, which a real one does not
  void unplug();

  void hold_at(fs_vec3 handle);     // it stands there at once, whatever the force
  void hold_loosely(fs_vec3 rest);  // a spring of 100 N/m and a damper hold it there
  fs_vec3 handle() const;
  fs_vec3 force() const;            // N, of the newest currents; 0 where none came for 0.5 s, as the firmware has it
  std::vector<int> current() const;  // mA, the newest
  uint64_t commands() const { return commands_; }  // that have come
  uint64_t bad_commands() const { return bad_commands_; }
  uint64_t reports() const { return reports_; }

  // Each is asked for with the mutex held.
  mutable std::mutex mutex;
  bool is_silent = false;
  int count_offset[3] = {0, 0, 0};  // is added to the encoders' counts
  std::function<void(std::vector<uint8_t>&)> on_report;  // may change what is sent

 private:
  void run();
  void take_commands();
  void move(double dt);
  void report();

  const std::string node_;
  int terminal_ = -1;  // its master side
  bool is_open_ = false;  // by a driver
  std::vector<uint8_t> received_;
  fs_vec3 handle_ = home, speed_{}, rest_{};
  bool is_loose_ = false;
  double current_[3] = {0, 0, 0};  // A
  double commanded_ = 0;  // s
  uint16_t number_ = 0;
  std::atomic<uint64_t> commands_{0}, bad_commands_{0}, reports_{0};
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace arm
