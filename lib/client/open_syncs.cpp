#include "client/open_syncs.h"

namespace fs {

constexpr size_t most_syncs = 32;

void OpenSyncs::take_answers() {
  while (!serials_.empty() && line_.connection.has_answer(serials_.front())) {
    const uint64_t serial = serials_.front();
    serials_.pop_front();
    Answer answer;
    line_.connection.take_answer(serial, answer);
  }
}

// Returns its serial; 0: there is no room.
uint64_t OpenSyncs::ask() {
  if (serials_.size() >= most_syncs) return 0;
  serials_.push_back(0);  // before it is asked for, so that its answer cannot be lost
  try {
    serials_.back() = line_.connection.ask(wire::type_sync);
  } catch (...) {
    serials_.pop_back();
    throw;
  }
  const uint64_t serial = serials_.back();
  if (!serial) serials_.pop_back();
  return serial;
}

void OpenSyncs::wait(Call& call, double timeout) {
  uint64_t own = 0;  // serial; 0: it is not asked for yet
  for (;;) {
    try {
      take_answers();
    } catch (const Error&) {
      pulls_.catch_up_in_time(call);
      throw;
    }
    if (!own) own = ask();
    if (own && (serials_.empty() || serials_.front() > own)) return pulls_.catch_up_in_time(call);
    if (!line_.try_pause(call, !own)) {
      fail(FS_ERROR_TIMEOUT, "no tick has used the changes within timeout %g s", timeout);
    }
  }
}

}  // namespace fs
