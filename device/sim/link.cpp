#include "device/sim/link.h"

namespace fs {

Link::Link(int64_t delay, int64_t period)
    : delay_(delay), period_(period), up_(static_cast<size_t>(delay / period) + 2),
      down_(2 * static_cast<size_t>(delay / period) + 4) {
  state_.flags = FS_STATE_CONNECTING;
}

const fs_state& Link::read(int64_t step) noexcept {
  if (up_.receive(step, state_)) is_fresh_ = true;
  return state_;
}

void Link::write(const Command& command, int64_t step) noexcept {
  waiting_ = command;
  has_waiting_ = true;
  if (is_fresh_) send(step);
}

void Link::send(int64_t step) noexcept {
  down_.send(waiting_, step + delay_ - delay_ / 2);
  last_write_ = step;
  has_waiting_ = is_fresh_ = false;
}

}  // namespace fs
