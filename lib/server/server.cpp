#include "server/server.h"

#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <new>
#include <system_error>

#include "base/clock.h"
#include "base/error.h"
#include "base/signals.h"
#include "ipc/region.h"

using namespace fs;

namespace {

constexpr double awake_for = 0.05;        // s after the last activity, until the server sleeps
constexpr double asleep_period = 0.02;    // s, for the heartbeat and the scenes' events
constexpr double housekeeping_period = 0.01;
constexpr double shortest_lead = 1.5e-4;  // s before a tick: time to wake up and to take some moves
constexpr double slice = 1e-5;     // s of work for one client, before others are looked at
constexpr uint64_t quick_bytes = 1'000'000;  // a job with more of them goes to the builder

}  // namespace

fs_server::fs_server(Ref<Servo> servo, const Endpoint& endpoint, const ServerSettings& settings)
    : servo_(std::move(servo)), settings_(settings), period_(1 / servo_->settings().rate),
      timer_(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)), wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      door_(endpoint.name, settings.is_for_all_users), worker_("fs-worker", [this] { wake(); }),
      builder_("fs-builder", [this] { wake(); }), message_(most_message) {
  if (!timer_ || !wake_) {
    fail(status_without_descriptor(errno), "the server could not be made: %s", std::strerror(errno));
  }
  make_region("forceserver-trial", 4096);  // where the system makes none, no client could connect: better said now
  watcher_.add(wake_, source_wake);
  watcher_.add(timer_, source_timer);
  watcher_.add(door_.own_socket(), source_listener);
  if (door_.shared_socket()) watcher_.add(door_.shared_socket(), source_shared_listener);
  servo_->channels().reap();  // those of an earlier server
  servo_->set_listener(this, [this] {
    std::unique_lock lock(mutex_);
    is_servo_stopping_ = true;
    wake();
    changed_.wait(lock, [this] { return has_let_go_; });
  });
  // The servo may be stopping already: then it waits until the server has let go.
  const auto stop_listening = [this] {
    {
      const std::lock_guard lock(mutex_);
      has_let_go_ = true;
      changed_.notify_all();
    }
    servo_->remove_listener(this);
  };
  try {
    const SignalsBlocked blocked;
    thread_ = std::thread([this] { run(); });
  } catch (const std::system_error& error) {
    stop_listening();
    fail_to_start("the server's thread", error.what());
  } catch (...) {  // there is no memory
    stop_listening();
    throw;
  }
}

void fs_server::stop() noexcept {
  if (!thread_.joinable()) return;
  servo_->remove_listener(this);
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  wake();
  thread_.join();
}

void fs_server::wake() const noexcept {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(wake_.get(), &one, sizeof one);
}

// While it is awake, its turns come as often as the servo's ticks and a little before them, so that a tick uses the newest
// moves.
void fs_server::set_timer() noexcept {
  const double period = is_asleep_ ? asleep_period : period_;
  itimerspec timer{};
  timer.it_interval = to_timespec(period);
  timer.it_value = timer.it_interval;
  int flags = 0;
  if (const double due = servo_->due(); due > 0 && !is_asleep_) {
    const double phase = due - std::fmax(shortest_lead, period / 4), soonest = steady_now() + period / 2;
    timer.it_value = to_timespec(phase + period * std::ceil((soonest - phase) / period));
    flags = TFD_TIMER_ABSTIME;
  }
  timerfd_settime(timer_.get(), flags, &timer, nullptr);
}

// --------------------------------------------------------------------------------------------------------- its thread

void fs_server::run() noexcept {
  begin_thread("fs-server");
  set_timer();
  std::array<epoll_event, 64> buffer;
  for (;;) {
    const std::span<const epoll_event> events = watcher_.wait(buffer, listed_.empty() ? -1 : 0);
    {
      const std::lock_guard lock(mutex_);
      if (is_stopping_ || is_servo_stopping_) break;
    }
    if (Session* const next = next_of(events)) serve(*next);
    turn_if_due();
    bury_sessions();
  }
  for (const std::shared_ptr<Session>& session : sessions_) session->client().drop(0);
  sessions_.clear();
  clients_.remove_gone();
  door_.close();
  const std::lock_guard lock(mutex_);
  has_let_go_ = true;
  changed_.notify_all();
}

Session* fs_server::find_socket(const epoll_event& event) const {
  const uint64_t source = event.data.u64;
  const bool is_socket = source >= first_session && (source - first_session) % 2 == 0;
  return is_socket ? sessions_.find((source - first_session) / 2).get() : nullptr;
}

// Handles the events that are about no messages. Returns the session that has used least of this thread lately, of those that
// have something to do; null: none has.
Session* fs_server::next_of(std::span<const epoll_event> events) noexcept {
  Session* next = nullptr;
  const auto consider = [&](Session& session) {
    if (!next || session.usage().lately() < next->usage().lately()) next = &session;
  };
  for (const epoll_event& event : events) {
    if (Session* const session = find_socket(event)) {
      if (!(event.events & EPOLLIN)) session->client().drop();
      else if (session->is_idle()) consider(*session);
      continue;
    }
    try {
      handle(event.data.u64);
    } catch (...) {  // there is no memory: this event is not handled
    }
    turn_if_due();
  }
  for (Session* const session : listed_) {
    if (session->client().work.state() != Work::State::waiting) consider(*session);
  }
  return next;
}

void fs_server::list(Session& session) noexcept {
  if (std::exchange(session.is_listed, true)) return;
  listed_.push_back(&session);
}

void fs_server::serve(Session& session) noexcept {
  if (session.client().is_gone) return;
  if (std::exchange(session.is_listed, false)) std::erase(listed_, &session);
  slice_begin_ = steady_now();
  session.resume();
  session.usage().spend(steady_now() - slice_begin_);
  if (!session.client().is_gone && session.has_more()) list(session);
}

void fs_server::handle(uint64_t source) {
  uint64_t count;
  if (source == source_wake) {
    [[maybe_unused]] const ssize_t got = read(wake_.get(), &count, sizeof count);
    note_activity();
    finish_jobs();
  } else if (source == source_timer) {
    if (read(timer_.get(), &count, sizeof count) == sizeof count) turn(steady_now());
  } else if (source == source_listener) {
    accept_clients(door_.own_socket());
  } else if (source == source_shared_listener) {
    accept_clients(door_.shared_socket());
  } else if (const std::shared_ptr<Session> session = sessions_.find((source - first_session) / 2)) {
    session->client().drop();  // its process has ended
  }
}

void fs_server::finish_jobs() {
  for (Worker* const worker : {&worker_, &builder_}) {
    for (std::list<Worker::Job> done = worker->take_done(); !done.empty();) {
      if (const std::shared_ptr<Session> session = sessions_.find(done.front().owner)) session->take_job(done);
      else done.pop_front();
    }
  }
}

void fs_server::wake_up() noexcept {
  is_asleep_ = false;
  for (const std::shared_ptr<Session>& session : sessions_) session->set_asleep(false);
  set_timer();
}

// However much work there is, the moves are taken at the servo's rate.
void fs_server::turn_if_due() noexcept {
  const double now = steady_now();
  if (is_asleep_ && now - last_activity_ < awake_for) {
    wake_up();
  } else if (is_asleep_ || now - last_turn_ < period_) {
    return;
  }
  try {
    turn(now);
  } catch (...) {  // there is no memory: the next turn does what this one could not
  }
}

// Claims have ended by now. A worker destroys them: a session may hold a gigabyte of shapes and thousands of objects.
void fs_server::bury_sessions() noexcept {
  std::erase_if(listed_, [](const Session* session) { return session->client().is_gone; });
  try {
    std::vector<std::shared_ptr<Session>> gone = sessions_.take_gone();
    clients_.remove_gone();
    if (!gone.empty()) destroy(std::make_shared<std::vector<std::shared_ptr<Session>>>(std::move(gone)));
  } catch (const std::bad_alloc&) {  // then they are destroyed here, now or later
  }
}

// Done each period. The session that comes first in one period comes last in the next.
void fs_server::turn(double now) {
  const size_t count = sessions_.size();
  last_turn_ = now;
  ++turns_;
  for (const std::shared_ptr<Session>& session : sessions_) session->usage().fade();
  for (size_t i = 0; i < count; ++i) sessions_[(i + turns_) % count].turn(now);
  bool is_busy = false;
  for (const std::shared_ptr<Session>& session : sessions_) {
    session->end_turn();
    is_busy = is_busy || session->is_busy();
  }
  if (is_busy) note_activity();
  if (now - last_housekeeping_ >= housekeeping_period) {
    last_housekeeping_ = now;
    keep_house();
  }
  if (!is_asleep_ && now - last_activity_ > awake_for) fall_asleep();
}

void fs_server::keep_house() {
  for (const std::shared_ptr<Session>& session : sessions_) session->keep_house();
  clients_.reap_leaving();
  door_.reopen();
  if (!is_door_open_) open_door(true);
  if (!is_asleep_) set_timer();  // aligned anew, because the servo skips ticks that it is too late for
}

// Sets the flag, then looks again: a client that wrote before it is seen now, one that writes later sees the flag and wakes
// the server.
void fs_server::fall_asleep() noexcept {
  for (const std::shared_ptr<Session>& session : sessions_) session->set_asleep(true);
  if (std::any_of(sessions_.begin(), sessions_.end(), [](const auto& session) { return session->has_moves(); })) {
    for (const std::shared_ptr<Session>& session : sessions_) session->set_asleep(false);
    note_activity();
    return;
  }
  is_asleep_ = true;
  set_timer();
}

// --------------------------------------------------------------------------------------------------- for the sessions

void fs_server::note_activity() noexcept { last_activity_ = steady_now(); }

void fs_server::start_job(Client& client, uint64_t bytes, std::function<void(StopToken&)> work, std::function<void()> done) {
  Worker& worker = bytes > quick_bytes ? builder_ : worker_;
  worker.add({std::move(work), std::move(done), client.id});
  ++client.jobs;
}

void fs_server::destroy(std::shared_ptr<void> what) {
  const auto dead = std::make_shared<std::shared_ptr<void>>(std::move(what));
  worker_.add({[dead](StopToken&) { dead->reset(); }, [] {}});
}

void fs_server::set_reading(const Client& client, bool is_reading) noexcept {
  watcher_.set_reading(client.socket, socket_source(client), is_reading);
}

bool fs_server::is_slice_over() const noexcept { return steady_now() - slice_begin_ >= slice; }

void fs_server::resume_later(const Client& client) noexcept {
  if (const std::shared_ptr<Session> session = sessions_.find(client.id)) list(*session);
}

void fs_server::let_go(Client& client) noexcept {
  if (client.claim) claims_.end(*client.claim);
  clients_.note_leaving(client);
  watcher_.remove(client.socket);
  watcher_.remove(client.process);
  worker_.forget(client.id);
  builder_.forget(client.id);
}

// ------------------------------------------------------------------------------------------------------------ the door

// While it is closed nobody is let in, and epoll does not report again and again that somebody waits.
void fs_server::open_door(bool is_open) noexcept {
  is_door_open_ = is_open;
  watcher_.set_reading(door_.own_socket(), source_listener, is_open);
  if (door_.shared_socket()) watcher_.set_reading(door_.shared_socket(), source_shared_listener, is_open);
}

void fs_server::accept_clients(const Descriptor& listener) {
  if (!door_.accept(listener, [this](Descriptor&& socket) { let_in(std::move(socket)); })) open_door(false);
}

void fs_server::let_in(Descriptor&& socket) {
  note_activity();
  try {
    const Peer peer = peer_of(socket);
    const bool is_refused = peer.user != geteuid() && !settings_.is_for_all_users;
    sessions_.make_room(is_refused);
    const auto session =
        std::make_shared<Session>(*this, ++last_id_, std::move(socket), peer, is_refused ? FS_ERROR_DENIED : FS_OK);
    listed_.reserve(sessions_.size() + 1);
    sessions_.add(session);
    clients_.add(session->shared_client());
    Client& client = session->client();
    try {
      watcher_.add(client.socket, socket_source(client));
      if (client.process) watcher_.add(client.process, socket_source(client) + 1);
    } catch (const Error&) {
      client.drop(0);
    }
  } catch (const Error&) {  // it is gone already
  }
}
