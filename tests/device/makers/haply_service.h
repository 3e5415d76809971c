// A stand-in for the Haply Inverse Service, in threads of the test's own process, on a free port of the loopback. It tells all of
// its devices first, answers each message with a state, and speaks as the service 3.4 or 3.5 does.
#pragma once

#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "device/makers/handle.h"

namespace makers {

struct HaplyDevice {
  explicit HaplyDevice(std::string its_id, double force_max = 8, double watchdog = 0.05);

  std::string id, kind = "inverse3", basis = "XYZ";
  bool is_calibrated = true, is_ready = true, has_power = true, is_in_use = false;
  double scale = 1, damping = 0;  // of the transform, of the filter
  double force_told = 1;          // what it tells of a force, as a part of what was sent
  double weight = 1;              // what it gives of a force
  fs_vec3 shift{};                // m, of the position that it tells
  fs_vec3 offset{0, -0.12, 0.15}; // m, of the origin, until the preset is asked for
  fs_vec3 commanded{};            // N
  Handle handle;                  // Haply's frame is that of forceserver
};

struct HaplyGrip {
  std::string id;
  bool is_wireless = false, a = false, b = false, c = false;
  fs_quat orientation{1, 0, 0, 0};
};

class HaplyService {
 public:
  explicit HaplyService(std::string version = "3.5.0");
  ~HaplyService();

  std::vector<std::shared_ptr<HaplyDevice>> devices{std::make_shared<HaplyDevice>("049D")};
  std::vector<HaplyGrip> grips;
  double lag = 0;           // s, before each answer
  bool is_deaf = false;     // it stops reading
  bool is_silent = false;   // it answers nothing
  std::string answer;       // this is the answer, if it is not empty
  std::string bytes;        // these are written in place of an answer, without a frame
  bool closes = false;      // it closes the connection in place of an answer
  uint64_t refused = 0;     // commands in words that it does not know
  uint64_t messages = 0;    // that came
  int most_waiting = 0;     // bytes that lay unread when a message had been taken

  // Looks at the above, or changes it, while no answer is made.
  template <class Change>
  auto with(Change change) {
    const std::lock_guard lock(mutex_);
    return change(*this);
  }

  void stop();   // all connections end
  void start();  // on the same port
  unsigned short port() const { return port_; }
  std::string state(bool is_full);  // as a message; the caller holds the lock

 private:
  void listen(int listener);
  void serve(int socket);
  void take(const std::string& text);

  std::mutex mutex_;
  const std::string version_;
  unsigned short port_ = 0;
  int listener_ = -1;
  bool is_ending_ = false, wants_all_ = false;
  std::set<int> sockets_;
  std::vector<std::thread> threads_;
};

}  // namespace makers
