#include "client/event_queue.h"

#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

#include "base/enum.h"

namespace fs {

// Called with the lock. False: there is no event.
bool EventQueue::take(fs_event& out) {
  const char* loss = line_.connection.loss();  // looked at before the server's last events
  if (!loss) {
    try {
      pulls_.look();
    } catch (const Error&) {  // the next call meets the same error
    }
  }
  if (reader_.read(*line_.connection.outbox(), out)) {
    if (raw_value(out.kind) == FS_EVENT_OVERFLOW) out.time = replica_.scene->now();
    return true;
  }
  if (!loss) return false;
  if (std::exchange(is_end_told_, true)) throw Error{FS_ERROR_DISCONNECTED, loss};
  out.kind = FS_EVENT_DISCONNECTED;
  out.status = FS_ERROR_DISCONNECTED;
  out.time = replica_.scene->now();
  put_text(out.text, loss);
  return true;
}

fs_event EventQueue::next(double timeout) {
  check_timeout(timeout);
  const double start = steady_now();
  for (;;) {
    if (line_.connection.is_forked()) line_.connection.check();
    {
      const std::unique_lock lock = line_.enter_unchecked();
      fs_event event;
      if (take(event)) return event;
    }
    const double rest = timeout - (steady_now() - start);
    if (!(rest > 0)) return {};
    std::this_thread::sleep_for(std::chrono::duration<double>(std::fmin(rest, 2e-3)));
  }
}

}  // namespace fs
