#include "server/server.h"

#include <pthread.h>
#include <sys/epoll.h>
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

#include "base/error.h"
#include "base/signals.h"
#include "ipc/inbox.h"
#include "server/session.h"

using namespace fs;

namespace {

constexpr double awake_for = 0.05;        // s after the last change, before it sleeps
constexpr double asleep_period = 0.02;    // s: the heartbeat, and the scenes' events
constexpr double housekeeping_period = 0.01;
constexpr double shortest_lead = 1.5e-4;  // s before a tick: for a thread to wake up and to take some moves
constexpr int most_accepted = 16;         // in a housekeeping period: letting one in takes as long as many requests
constexpr ptrdiff_t most_strangers = 64;  // that have not said who they are
constexpr ptrdiff_t most_refused = 16;
constexpr int most_messages = 64;  // of one client, before all are looked at again

template <class T>
T parse_bound(T given, T standard, T most, const char* field) {
  if (given > most) fail(FS_ERROR_INVALID, "%s is %g, must be at most %g", field, double(given), double(most));
  return given ? given : standard;
}

timespec to_timespec(double time) noexcept {  // s
  const double whole = std::floor(time);
  return {static_cast<time_t>(whole), static_cast<long>((time - whole) * 1e9)};
}

Descriptor open_file() { return Descriptor(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)); }

}  // namespace

ServerSettings fs::parse_options(const fs_server_options& options, const ServoSettings& servo) {
  ServerSettings out{};
  out.max_clients = parse_bound<uint32_t>(options.max_clients, 32, 4096, "max_clients");
  out.max_objects = parse_bound<uint32_t>(options.max_objects, 4096, most_slots, "max_objects");
  out.max_bytes = uint64_t{1'000'000} * parse_bound<uint32_t>(options.max_megabytes, 1024, 1'000'000, "max_megabytes");
  if (!(options.lease >= 0 && options.lease <= 1e6)) {
    fail(FS_ERROR_INVALID, "lease is %g, must be within 0..1e6 s", options.lease);
  }
  out.lease = options.lease > 0 ? options.lease : 0.2;
  const double most = servo.limits.force;
  if (!(options.force_limit >= 0 && options.force_limit <= most)) {
    fail(FS_ERROR_INVALID, "force_limit is %g, must be within 0..%g N, what the servo sends", options.force_limit, most);
  }
  out.limits.force = options.force_limit > 0 ? options.force_limit : most;
  // A device without torque makes none of what it gets: no reason to lower the force.
  out.limits.torque = servo.limits.torque_axes ? servo.limits.torque * (out.limits.force / most) : never;
  for (const uint8_t byte : options.reserved) {
    if (byte) fail(FS_ERROR_INVALID, "reserved is %u, must be 0", byte);
  }
  out.is_locked = options.locked;
  out.is_for_all_users = options.all_users;
  return out;
}

fs_server::fs_server(Ref<Servo> servo, const Endpoint& endpoint, const ServerSettings& settings)
    : servo_(std::move(servo)),
      endpoint_(endpoint),
      settings_(settings),
      period_(1 / servo_->settings().rate),
      worker_([this] { wake(); }),
      builder_([this] { wake(); }) {
  epoll_ = Descriptor(epoll_create1(EPOLL_CLOEXEC));
  timer_ = Descriptor(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK));
  wake_ = open_file();
  spare_ = open_file();
  if (!epoll_ || !timer_ || !wake_ || !spare_) {
    fail(errno == EMFILE || errno == ENFILE ? FS_ERROR_FULL : FS_ERROR_IO, "the server could not be made: %s",
         std::strerror(errno));
  }
  watch(wake_, source_wake, EPOLLIN);
  watch(timer_, source_timer, EPOLLIN);
  listener_ = Listener(user_address(geteuid(), endpoint_.name));
  watch(listener_.socket(), source_listener, EPOLLIN);
  if (settings_.is_for_all_users) {
    shared_listener_ = Listener(shared_address(endpoint_.name));
    watch(shared_listener_.socket(), source_shared_listener, EPOLLIN);
  }
  servo_->reap_channels();  // of a server before this one
  servo_->add_listener(this, [this] {
    std::unique_lock lock(mutex_);
    is_servo_stopping_ = true;
    wake();
    changed_.wait(lock, [this] { return has_let_go_; });
  });
  try {
    const SignalsBlocked blocked;
    thread_ = std::thread([this] { run(); });
  } catch (const std::system_error& error) {
    {
      const std::lock_guard lock(mutex_);
      has_let_go_ = true;
      changed_.notify_all();
    }
    servo_->remove_listener(this);
    fail(FS_ERROR_IO, "the server's thread could not be started: %s", error.what());
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

void fs_server::watch(const Descriptor& descriptor, uint64_t source, uint32_t events) {
  epoll_event event{};
  event.events = events;
  event.data.u64 = source;
  if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, descriptor.get(), &event) != 0) {
    fail(FS_ERROR_IO, "the server cannot watch a descriptor: %s", std::strerror(errno));
  }
}

void fs_server::unwatch(const Session& session) noexcept {
  for (const Descriptor* descriptor : {&session.socket(), &session.process()}) {
    if (*descriptor) epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, descriptor->get(), nullptr);
  }
}

void fs_server::set_reading(const Session& session, bool is_reading) noexcept {
  epoll_event event{};
  event.events = is_reading ? static_cast<uint32_t>(EPOLLIN) : 0;
  event.data.u64 = first_session + 2 * session.id();
  epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, session.socket().get(), &event);
}

// Awake, its turns come as often as the servo's ticks and a little before them: what has been moved until then is felt
// at once.
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
  std::array<epoll_event, 64> events;
  for (;;) {
    const int count = epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), -1);
    {
      const std::lock_guard lock(mutex_);
      if (is_stopping_ || is_servo_stopping_) break;
    }
    // Of the clients only the one that has used least of this thread lately: then all are looked at again.
    ++rounds_;
    Session* next = nullptr;
    for (const epoll_event& event : std::span(events).first(static_cast<size_t>(std::max(count, 0)))) {
      try {
        if (Session* const session = find_socket(event)) {
          if (!(event.events & EPOLLIN)) session->drop(settings_.lease);
          else if (!next || session->usage().lately() < next->usage().lately()) next = session;
        } else {
          handle(event.data.u64);
        }
        turn_if_due();
      } catch (...) {  // no memory: what was asked for is not done
      }
    }
    if (next) serve(*next, most_messages);
    turn_if_due();
    bury_sessions();
  }
  for (const std::shared_ptr<Session>& session : sessions_) session->drop(0);
  sessions_.clear();
  listener_.reset();
  shared_listener_.reset();
  const std::lock_guard lock(mutex_);
  has_let_go_ = true;
  changed_.notify_all();
}

Session* fs_server::find_socket(const epoll_event& event) const {
  const uint64_t source = event.data.u64;
  return source >= first_session && (source - first_session) % 2 == 0 ? find((source - first_session) / 2).get() : nullptr;
}

void fs_server::serve(Session& session, int most) noexcept {
  const double start = last_look_ = steady_now();
  used_by_others_ = 0;
  session.receive(most);
  last_look_ = steady_now();
  session.usage().spend(last_look_ - start - used_by_others_);
}

void fs_server::let_others(const Session* busy, bool is_alone) noexcept {
  turn_if_due();
  if (is_alone || is_among_others_ || steady_now() - last_look_ < slice) return;
  is_among_others_ = true;
  std::array<epoll_event, 64> events;
  const int count = epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), 0);
  Session* next = nullptr;
  for (const epoll_event& event : std::span(events).first(static_cast<size_t>(std::max(count, 0)))) {
    Session* const session = find_socket(event);
    if (!session || !(event.events & EPOLLIN) || session == busy || (next && session->usage().lately() >= next->usage().lately())) continue;
    if (session->is_next_apart(busy, rounds_)) next = session;
  }
  last_look_ = steady_now();
  if (next) {
    const double used = used_by_others_, start = last_look_;
    serve(*next, 1);
    used_by_others_ = used + last_look_ - start;
  }
  is_among_others_ = false;
}

void fs_server::handle(uint64_t source) {
  uint64_t count;
  if (source == source_wake) {
    [[maybe_unused]] const ssize_t got = read(wake_.get(), &count, sizeof count);
    note_activity();
    for (Worker* const worker : {&worker_, &builder_}) {
      for (const Worker::Job& job : worker->take_done()) {
        try {
          job.done();
        } catch (...) {  // no memory for this client; the others' jobs are done
        }
        let_others(nullptr, false);
      }
    }
  } else if (source == source_timer) {
    if (read(timer_.get(), &count, sizeof count) == sizeof count) turn(steady_now());
    for (const std::shared_ptr<Session>& session : sessions_) {
      session->catch_up();
      let_others(nullptr, false);
    }
  } else if (source == source_listener) {
    accept_clients(listener_.socket());
  } else if (source == source_shared_listener) {
    accept_clients(shared_listener_.socket());
  } else if (const std::shared_ptr<Session> session = find((source - first_session) / 2)) {
    session->drop(settings_.lease);  // its process has ended
  }
}

void fs_server::wake_up() noexcept {
  is_asleep_ = false;
  for (const std::shared_ptr<Session>& session : sessions_) session->set_asleep(false);
  set_timer();
}

// However much there is to be done, the moves are taken at the servo's rate.
void fs_server::turn_if_due() noexcept {
  const double now = steady_now();
  if (is_asleep_ && now - last_activity_ < awake_for) {
    wake_up();
  } else if (is_asleep_ || now - last_turn_ < period_) {
    return;
  }
  try {
    turn(now);
  } catch (...) {  // no memory: the next one makes good for it
  }
}

// What was theirs may be a gigabyte of shapes and thousands of objects: letting go of it takes a while, so the worker does.
void fs_server::bury_sessions() noexcept {
  const auto gone = std::stable_partition(sessions_.begin(), sessions_.end(), [](const auto& s) { return !s->is_gone(); });
  if (gone == sessions_.end()) return;
  try {
    const auto dead = std::make_shared<std::vector<std::shared_ptr<Session>>>(gone, sessions_.end());
    sessions_.erase(gone, sessions_.end());
    worker_.add(0, {[dead](Wanted&) { dead->clear(); }, [] {}});
  } catch (const std::bad_alloc&) {  // then here, as long as it takes
    std::erase_if(sessions_, [](const std::shared_ptr<Session>& session) { return session->is_gone(); });
  }
}

// What comes each period. Whoever comes first in one is last in the next.
void fs_server::turn(double now) {
  const size_t count = sessions_.size();
  last_turn_ = now;
  ++turns_;
  for (const std::shared_ptr<Session>& session : sessions_) session->usage().fade();
  for (size_t i = 0; i < count; ++i) sessions_[(i + turns_) % count]->turn(now);
  bool is_busy = false;
  for (const std::shared_ptr<Session>& session : sessions_) {
    session->settle();
    is_busy = is_busy || session->is_busy();
  }
  if (is_busy) note_activity();
  if (now - last_housekeeping_ >= housekeeping_period) {
    last_housekeeping_ = now;
    for (const std::shared_ptr<Session>& session : sessions_) session->keep_house();
    count_leaving();
    accepted_ = 0;
    if (!is_door_open_) open_door(true);
    if (!is_asleep_) set_timer();  // the servo skips what it is too late for
  }
  if (!is_asleep_ && now - last_activity_ > awake_for) fall_asleep();
}

// Says so, then looks once more: whoever has written before it could know is seen now, whoever writes later wakes.
void fs_server::fall_asleep() noexcept {
  for (const std::shared_ptr<Session>& session : sessions_) session->set_asleep(true);
  const bool has_moves = std::any_of(sessions_.begin(), sessions_.end(), [](const auto& s) { return s->has_moves(); });
  if (has_moves) {
    for (const std::shared_ptr<Session>& session : sessions_) session->set_asleep(false);
    note_activity();
    return;
  }
  is_asleep_ = true;
  set_timer();
}

void fs_server::forget_jobs(uint64_t session) noexcept {
  worker_.forget(session);
  builder_.forget(session);
}

void fs_server::note_leaving(Ref<Channel> channel) noexcept {
  try {
    leaving_.push_back(std::move(channel));
  } catch (const std::bad_alloc&) {  // then it is not counted
  }
}

size_t fs_server::count_leaving() {
  servo_->reap_channels();
  std::erase_if(leaving_, [now = servo_->scene()->now()](const Ref<Channel>& channel) { return channel->is_gone(now); });
  return leaving_.size();
}

void fs_server::end_leases() noexcept {
  for (const Ref<Channel>& channel : leaving_) channel->end_lease(servo_->scene()->now());
}

Session* fs_server::find(std::string_view client) const {
  for (const std::shared_ptr<Session>& session : sessions_) {
    if (!session->is_gone() && !session->name().empty() && session->name() == client) return session.get();
  }
  return nullptr;
}

std::shared_ptr<Session> fs_server::find(uint64_t id) const {
  const auto found = std::lower_bound(sessions_.begin(), sessions_.end(), id,
                                      [](const auto& session, uint64_t wanted) { return session->id() < wanted; });
  return found != sessions_.end() && (*found)->id() == id && !(*found)->is_gone() ? *found : nullptr;
}

size_t fs_server::client_count() const {
  return static_cast<size_t>(std::count_if(sessions_.begin(), sessions_.end(), [](const auto& session) {
    return !session->is_gone() && !session->name().empty();
  }));
}

std::vector<fs_client> fs_server::describe() const {
  std::vector<fs_client> out;
  fs_client own{};
  std::strcpy(own.name, "server");
  own.process = static_cast<uint32_t>(getpid());
  own.user = geteuid();
  own.objects = static_cast<uint32_t>(servo_->scene()->object_count());
  own.force_limit = servo_->settings().limits.force;
  own.wrench = servo_->own_wrench();
  out.push_back(own);
  for (const std::shared_ptr<Session>& session : sessions_) {
    if (!session->is_gone() && !session->name().empty()) out.push_back(session->describe());
  }
  return out;
}

// ------------------------------------------------------------------------------------------------------------ the door

// Closed, nobody is asked in, nor is the server told again and again that somebody waits.
void fs_server::open_door(bool is_open) noexcept {
  is_door_open_ = is_open;
  if (is_open && !spare_) spare_ = open_file();
  epoll_event event{};
  event.events = is_open ? static_cast<uint32_t>(EPOLLIN) : 0;
  event.data.u64 = source_listener;
  epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, listener_.socket().get(), &event);
  event.data.u64 = source_shared_listener;
  if (shared_listener_.socket()) epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, shared_listener_.socket().get(), &event);
}

void fs_server::accept_clients(const Descriptor& listener) {
  for (;;) {
    if (accepted_ == most_accepted) return open_door(false);  // until the next housekeeping
    Descriptor socket(accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    const int error = socket ? 0 : errno;
    if (error == EAGAIN || error == EWOULDBLOCK) return;
    ++accepted_;
    if (error == EINTR || error == ECONNABORTED) continue;
    if ((error == EMFILE || error == ENFILE) && spare_) {
      // One is kept for this: to turn away whoever waits.
      spare_.reset();
      socket = Descriptor(accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
      socket.reset();
      spare_ = open_file();
      if (spare_) continue;
    }
    if (error) return open_door(false);  // nothing can be done about it but to look again a little later
    note_activity();
    try {
      const Peer peer = peer_of(socket);
      // Who has to be told no gets a few places of its own, so that nobody can take all of them.
      const bool is_refused = peer.user != geteuid() && !settings_.is_for_all_users;
      const auto is_rival = [&](const auto& session) {
        return !session->is_gone() && session->name().empty() && session->is_refused() == is_refused;
      };
      if (std::count_if(sessions_.begin(), sessions_.end(), is_rival) >= (is_refused ? most_refused : most_strangers)) {
        // Who says nothing makes room for who comes: the one that has stood here longest.
        const std::shared_ptr<Session> longest = *std::find_if(sessions_.begin(), sessions_.end(), is_rival);
        longest->receive(1);  // it may have said something by now
        if (longest->name().empty()) longest->drop(0);
      }
      const auto session = std::make_shared<Session>(*this, ++last_id_, std::move(socket), peer,
                                                     is_refused ? FS_ERROR_DENIED : FS_OK);
      sessions_.push_back(session);
      try {
        watch(session->socket(), first_session + 2 * session->id(), EPOLLIN);
        if (session->process()) watch(session->process(), first_session + 2 * session->id() + 1, EPOLLIN);
      } catch (const Error&) {
        session->drop(0);
      }
    } catch (const Error&) {  // it is gone already
    }
  }
}
