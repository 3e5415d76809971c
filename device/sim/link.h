// A link between the servo and a controller at the simulated device. Poses travel one way, commands the other, each
// for half of the link's delay.
//
// The controller sends its pose at the link's rate. The command that answers a pose leaves at once: it is the first that
// is written after the pose was read. Later commands replace it only where no newer pose comes.
#pragma once

#include <cstdint>
#include <vector>

#include <forceserver/driver.h>

#include "device/sim/parameters.h"
#include "math/filters.h"

namespace fs {

// What is on its way, each entry with the step at which it arrives. Holds as many entries as are ever on their way.
template <class T>
class Way {
 public:
  explicit Way(size_t capacity) : entries_(capacity) {}

  void send(const T& value, int64_t arrival) noexcept {
    if (end_ - begin_ == entries_.size()) ++begin_;  // cannot happen at the rate that the capacity is for
    entries_[end_++ % entries_.size()] = {value, arrival};
  }
  // Takes the newest that has arrived by this step. Returns false when none has.
  bool receive(int64_t step, T& out) noexcept {
    bool any = false;
    for (; begin_ < end_ && entries_[begin_ % entries_.size()].arrival <= step; ++begin_, any = true) {
      out = entries_[begin_ % entries_.size()].value;
    }
    return any;
  }

 private:
  struct Entry {
    T value;
    int64_t arrival;
  };
  std::vector<Entry> entries_;
  uint64_t begin_ = 0, end_ = 0;
};

class Link {
 public:
  struct Command {
    Pose x0 = identity_pose();
    Wrench f0{};
    Mat3 dfdx{}, dtdr{};
    double hold = fidel::fade_after;  // s, for which it counts
  };

  // In steps of the simulation: from a pose to the command that answers it, and from one pose to the next.
  Link(int64_t delay, int64_t period);

  // The servo's end.
  const fs_state& read(int64_t step) noexcept;
  void write(const Command& command, int64_t step) noexcept;

  // The controller's end, called at each step: sends a pose when one is due (`pose` gives it), and receives commands.
  template <class GivePose>
  void step(int64_t step, GivePose pose) noexcept {
    if (step % period_ == 0) up_.send(pose(), step + delay_ / 2);
    if (has_waiting_ && step - last_write_ >= 2 * period_) send(step);
    if (down_.receive(step, command_)) last_arrival_ = step;
  }
  const Command& command() const noexcept { return command_; }
  int64_t last_arrival() const noexcept { return last_arrival_; }  // the step at which the newest command came

 private:
  void send(int64_t step) noexcept;

  int64_t delay_, period_;
  Way<fs_state> up_;
  Way<Command> down_;
  fs_state state_{};  // the newest that arrived
  bool is_fresh_ = false;
  Command waiting_, command_;
  bool has_waiting_ = false;
  int64_t last_write_ = 0, last_arrival_ = 0;
};

}  // namespace fs
