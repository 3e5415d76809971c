// The thread of a driver that waits for its device (receive and send in driver.h). To the servo the device looks like one
// that never waits: it reads the newest state, and leaves a force for the thread to send.
//
//   driver's thread:  receive -> newest_ -> ..... waits for command_ ..... -> send -> receive -> ..
//   servo's thread:               wakes: tick: read newest_, write command_
//
// The driver may also lend itself to the servo's own thread (FS_DRIVER_IN_SERVO), which then receives and sends between two ticks.
// Then this thread sleeps until the servo ends or the device is lost.
//
//   servo's thread:   receive -> newest_ -> tick: read newest_, write command_ -> send -> receive -> ..
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <string>

#include "base/counted.h"
#include "base/seqlock.h"
#include "driver/opened.h"

namespace fs {

struct Trouble {
  fs_status status = FS_OK;  // that it explains
  std::string words;  // a sentence; "": nobody knows
  std::string of(fs_status wanted) const { return wanted == status ? words : ""; }
};

class DriverThread final : public Counted<DriverThread> {
 public:
  DriverThread(const fs_driver& driver, std::string address, std::shared_ptr<Opened> device, const fs_device_info& info);
  static void start(const Ref<DriverThread>& thread);  // once; waits a moment for the first state; IO

  // Asks the thread to send 0, to close the device and to end.
  void begin_end() noexcept;
  // The same, and waits for it, until `deadline` (s, monotonic clock) at most: a driver that hangs leaves its thread behind.
  void end(double deadline) noexcept;

  // [rt] The newest state, and whether the device gives any at present. A servo is told once of what was no good since
  // the last call, an error or a state that is not ready, even if a good state has followed: so its force begins again by the ramp.
  fs_status read(fs_state& out) noexcept;
  // [rt] What is to be sent from now on; the status is that of the newest send. is_lasting: it counts until the next call,
  // otherwise for 25 ms and a period of the servo.
  fs_status write(const fs_wrench& wrench, bool is_lasting) noexcept;
  fs_status write_model(const fs_model& model) noexcept;
  // Sends 0, and waits until that is done, for 60 ms at most.
  fs_status write_zero() noexcept;

  // A servo has the device from begin_servo to end_servo. priority: its thread's, of SCHED_FIFO; negative: an ordinary thread.
  // may_lend: it has a thread, which calls await_state. period: of its ticks, s.
  void begin_servo(int priority, bool may_lend, double period) noexcept;
  void end_servo() noexcept;
  // [rt] Called by the servo's thread between two ticks: waits until a state that was not read yet has come, but not before
  // `soonest`, and not beyond `latest` (s, monotonic clock). Returns the time at which the next tick was due, which is `usual` where no
  // state has come. Of a driver that has
  // lent itself it first sends what the last tick left, then receives, which may take 20 ms longer; the tick is due after that.
  double await_state(double soonest, double usual, double latest) noexcept;
  // [rt] The servo's thread no longer uses the driver: for good, or until it is lent again.
  void give_back(bool is_for_good) noexcept;

  // What the driver measures of its link while a servo has the device; UNSUPPORTED: nothing new since the last call. One thread.
  fs_status get_link(fs_link& out) noexcept;

  std::shared_ptr<Opened> device() const noexcept;  // null: it is not connected
  // Why the driver has failed, or the device does not come back. number: from 1 to troubles(). Only the newest are kept: for an older one
  // the newest is given.
  Trouble trouble(uint32_t number) const;
  uint32_t troubles() const noexcept {
    return troubles_told_.load(std::memory_order_acquire);
  }  // [rt] how many; repeated ones count once

 private:
  struct State {
    fs_state state{};
    double came = 0;  // s
    int64_t status = FS_OK;
  };
  struct Command {
    fs_model model{};  // of a plain force only f0 counts
    double time = 0;  // s
    uint32_t number = 0;
    uint32_t bad_seen = 0;  // how many bad states the servo knew of: it counts only if there has been none since
    uint8_t is_model = 0, is_lasting = 0, padding[6]{};
  };
  enum Owner : uint32_t { thread_has, servo_has };

  void run() noexcept;
  void exchange(void* self) noexcept;  // a state and what answers it
  void lend(void* self) noexcept;
  void publish(const State& state) noexcept;
  void lose() noexcept;
  void reconnect() noexcept;
  void finish() noexcept;
  void measure(void* self) noexcept;
  void tell(Trouble trouble) noexcept;  // with the mutex
  template <class F>
  fs_status call(F&& f, fs_status usual) noexcept;  // usual: beside OK, what is no trouble
  fs_status receive(void* self, uint32_t& before) noexcept;  // before: commands_ when the state came
  fs_status send(void* self, const Command& command) noexcept;
  fs_status leave(Command command) noexcept;
  Command present() const noexcept;

  const fs_driver driver_;
  const std::string address_;
  const fs_device_info info_;
  const double period_;  // s

  mutable std::mutex mutex_;  // of the next two
  std::shared_ptr<Opened> device_;
  std::array<Trouble, 8> troubles_;  // the newest
  std::atomic<uint32_t> troubles_told_{0};

  Latest<State> newest_;  // written by who has the driver
  std::atomic<uint32_t> states_{0};  // how many have come
  Latest<State> newest_bad_;  // the newest that no force may answer
  std::atomic<uint32_t> bad_{0};  // how many of those there were
  Latest<fs_link> link_;
  std::atomic<uint32_t> links_{0};  // how many have been measured
  Latest<Command> command_;  // written by who has the turn of the device
  std::atomic<uint32_t> commands_{0}, sent_{0};  // the numbers of the newest command, and of the newest that was sent
  std::atomic<int64_t> send_status_{FS_OK};  // of the newest send

  std::atomic<bool> has_servo_{false}, may_lend_{false};
  std::atomic<int> priority_{-1};
  std::atomic<double> servos_period_{0};  // s
  std::atomic<uint32_t> owner_{thread_has}, is_ending_{0}, has_ended_{0};

  // Who has the driver uses these.
  void* lent_ = nullptr;  // the handle that was lent to the servo's thread
  bool is_lost_ = false;  // the servo's thread found that the device is
  uint64_t number_ = 0;  // of the newest state
  double tried_at_ = 0;  // s, when the device was last opened anew
  double measured_at_ = 0;  // s, when the driver was last asked for its link
  uint32_t forgotten_ = 0;  // the number of the newest command when a lost device came back: no force comes back by itself

  std::atomic<uint64_t> servos_thread_{0};  // that the driver is lent to; 0: none
  uint32_t states_seen_ = 0;  // by the servo's thread
  uint32_t bad_seen_ = 0;  // by read, in the thread that also writes
  uint32_t links_seen_ = 0;  // by get_link
};

}  // namespace fs
