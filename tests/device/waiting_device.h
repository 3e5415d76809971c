// A device behind a driver that waits (receive and send), in this process: it does what a test says, and keeps what it was sent.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include <forceserver/driver.h>

#include "scenes/handles.h"

namespace scenes {

class WaitingDevice {
 public:
  struct Sent {
    double time;  // s, monotonic clock
    uint64_t answers;  // the number of the newest state that receive had given
    fs_wrench wrench;
    uint64_t thread;
  };

  explicit WaitingDevice(const char* scheme, uint32_t flags = 0);  // registers its driver; only once for each scheme
  ~WaitingDevice();
  WaitingDevice(const WaitingDevice&) = delete;
  WaitingDevice& operator=(const WaitingDevice&) = delete;

  Device open() const { return open_device((scheme_ + ":0").c_str()); }

  // A call that hangs returns when the test lets it go.
  enum Call { in_none, in_receive, in_send, in_close, in_control, in_open, in_link };
  void hang(Call call);
  void let_go() { hang(in_none); }
  void await_hanging();  // until a thread hangs there

  // Each is asked for with the mutex held.
  std::mutex mutex;
  double period = 1e-3;                        // s, of its states
  fs_status receive_status = FS_OK, open_status = FS_OK, send_status = FS_OK;
  fs_status next_receive = FS_OK, next_send = FS_OK;  // of the next call only; a state follows at once
  bool throws = false;                         // receive does
  const char* words = nullptr;                 // that receive says beside a status that is not OK
  std::string serial = "1";
  double mass = 0.3;                           // kg
  std::function<void(fs_state&, uint64_t)> on_state;  // the state with this number; at rest at the origin, and ready

  std::vector<Sent> sent() const;
  uint64_t opens() const { return opens_; }
  uint64_t closes() const { return closes_; }
  uint64_t states() const { return states_; }
  bool is_open() const { return opens_ > closes_; }

  // For its driver.
  fs_status open_it();
  void close_it();
  void describe(fs_device_info& out);
  fs_status receive(fs_state& out);
  fs_status send(const fs_wrench& wrench);
  fs_status get_link(fs_link& out);
  fs_status control(const char* request, char* answer, size_t size);

 private:
  void hang_in(Call call);

  const std::string scheme_;
  mutable std::mutex hanging_mutex_, sent_mutex_;
  std::condition_variable changed_;
  Call hangs_ = in_none;
  int hanging_ = 0;
  std::vector<Sent> sent_;
  std::atomic<uint64_t> opens_{0}, closes_{0}, states_{0};
  double next_ = 0;  // s
};

double now_s();             // s, monotonic clock
uint64_t thread_number();   // of the calling thread

}  // namespace scenes
