#include "client/line.h"

#include <chrono>
#include <cmath>
#include <thread>

#include "base/text.h"

namespace fs {
namespace {

constexpr double answer_limit = 1;     // s, the longest wait of a call for the server
constexpr double longest_wait = 2e-3;  // s, of one poll: another thread may have received the answer already

}  // namespace

// In a forked child it does not even touch the lock, which nobody may ever give back there.
Call Line::enter(double* steady) const {
  if (connection.is_forked()) connection.check();
  std::unique_lock lock(mutex_);
  const double now = steady_now();
  connection.check(now);
  if (steady) *steady = now;
  return {std::move(lock), answer_limit, now + answer_limit};
}

bool Line::try_pause(Call& call, bool is_for_room) {
  const double rest = std::fmin(call.end - steady_now(), longest_wait);
  if (!(rest > 0)) return false;
  call.lock.unlock();
  if (is_for_room) {
    connection.wait_for_room(rest);
    // Room alone is not enough where too many descriptors are in transit.
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  } else {
    connection.wait(rest);
  }
  call.lock.lock();
  connection.check();
  return true;
}

void Line::pause(Call& call, bool is_for_room) {
  if (try_pause(call, is_for_room)) return;
  if (call.limit == 0) fail(FS_ERROR_TIMEOUT, "the server has no room for this move now; a move never waits");
  fail(FS_ERROR_TIMEOUT,
       is_for_room ? "the server has not taken earlier changes within %g s" : "the server has not answered within %g s",
       call.limit);
}

Answer Line::request(Call& call, wire::Type type, std::span<const std::byte> body) {
  uint64_t serial;
  while (!(serial = connection.ask(type, body))) pause(call, true);
  try {
    Answer answer;
    while (!connection.take_answer(serial, answer)) pause(call, false);
    return answer;
  } catch (...) {
    connection.give_up(serial);
    throw;
  }
}

void Line::extend(Call& call) noexcept { call.end = std::fmax(call.end, steady_now() + answer_limit); }

wire::Target to_target(const char* name, const char* field) {
  wire::Target out{};
  const size_t size = strnlen(name, sizeof out.name);
  if (size == sizeof out.name) {
    fail(FS_ERROR_NOT_FOUND, "%s is '%s': too long for a name", field, shortened(std::string_view(name, size)).c_str());
  }
  std::memcpy(out.name, name, size);
  return out;
}

}  // namespace fs
