// The door of a servo to other processes. It is the fs_server of the C contract itself. One thread owns the sessions: it
// takes what the clients have written at the servo's rate, in turn, and answers what they ask. Each client has a scene and
// a channel of its own in the servo, so their forces add; a scene gets one snapshot a period at most.
#pragma once

#include <condition_variable>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "ipc/socket.h"
#include "server/worker.h"
#include "servo/servo.h"

struct epoll_event;

namespace fs {

class Session;

// fs_server_options, checked and with the defaults for what was left 0.
struct ServerSettings {
  uint32_t max_clients, max_objects;
  uint64_t max_bytes;  // of shapes, a client
  double lease;        // s
  Channel::Limits limits;
  bool is_locked, is_for_all_users;
};
ServerSettings parse_options(const fs_server_options& options, const ServoSettings& servo);  // INVALID

}  // namespace fs

struct fs_server : fs::Counted<fs_server> {
  static constexpr double slice = 1e-5;  // s of one client's work; then others are looked at

  // EXISTS, IO, FULL, STATE.
  fs_server(fs::Ref<fs::Servo> servo, const fs::Endpoint& endpoint, const fs::ServerSettings& settings);
  ~fs_server() { stop(); }

  void stop() noexcept;  // closes the door; the clients' objects begin to fade

  // ---- For the sessions, on the server's thread.
  fs::Servo& servo() const noexcept { return *servo_; }
  const fs::ServerSettings& settings() const noexcept { return settings_; }
  // For what takes long, by its bytes: what is small does not wait for what is large.
  fs::Worker& worker(uint64_t bytes) noexcept { return bytes > quick_bytes ? builder_ : worker_; }
  void forget_jobs(uint64_t session) noexcept;
  const std::vector<std::shared_ptr<fs::Session>>& sessions() const noexcept { return sessions_; }
  fs::Session* find(std::string_view client) const;  // null: none of that name, or it is gone
  std::shared_ptr<fs::Session> find(uint64_t id) const;
  size_t client_count() const;
  std::vector<fs_client> describe() const;  // the server's own scene, then the clients
  void set_reading(const fs::Session& session, bool is_reading) noexcept;
  void unwatch(const fs::Session& session) noexcept;
  // The scenes of clients that are gone, as long as they can be felt.
  void note_leaving(fs::Ref<fs::Channel> channel) noexcept;
  size_t count_leaving();
  void end_leases() noexcept;  // they begin to fade now
  // Amid something that takes long: the turns that are due, and a message of another client than `busy`, if there is one
  // that does not touch what is half done. `is_alone`: turns only.
  void let_others(const fs::Session* busy, bool is_alone) noexcept;
  void note_activity() noexcept { last_activity_ = fs::steady_now(); }
  // Where a message is read into, one at a time. On the heap: thread-local it would keep the library from being loaded at
  // run time.
  std::span<std::byte> message_buffer() noexcept { return message_; }

 private:
  static constexpr uint64_t quick_bytes = 1'000'000;  // more of them are for the builder
  // What epoll tells of; a session's is `first_session` + 2 id, its process one more.
  enum Source : uint64_t { source_wake, source_timer, source_listener, source_shared_listener, first_session = 16 };

  void run() noexcept;
  void watch(const fs::Descriptor& descriptor, uint64_t source, uint32_t events);  // IO
  void set_timer() noexcept;
  void handle(uint64_t source);
  fs::Session* find_socket(const epoll_event& event) const;  // null: it is no client's
  void serve(fs::Session& session, int most_messages) noexcept;
  void wake_up() noexcept;
  void turn_if_due() noexcept;
  void accept_clients(const fs::Descriptor& listener);
  void open_door(bool is_open) noexcept;
  void turn(double now);
  void bury_sessions() noexcept;
  void fall_asleep() noexcept;
  void wake() const noexcept;

  const fs::Ref<fs::Servo> servo_;
  const fs::Endpoint endpoint_;
  const fs::ServerSettings settings_;
  const double period_;  // s

  fs::Listener listener_, shared_listener_;
  fs::Descriptor epoll_, timer_, wake_, spare_;
  fs::Worker worker_, builder_;
  std::vector<std::shared_ptr<fs::Session>> sessions_;  // and those that have not said who they are
  std::list<fs::Ref<fs::Channel>> leaving_;
  std::vector<std::byte> message_ = std::vector<std::byte>(fs::most_message);
  uint64_t last_id_ = 0, turns_ = 0, rounds_ = 0;
  bool is_among_others_ = false;  // of something long
  double last_look_ = 0, used_by_others_ = 0;
  bool is_asleep_ = false, is_door_open_ = true;
  int accepted_ = 0;  // since the last housekeeping
  double last_activity_ = 0, last_turn_ = 0, last_housekeeping_ = 0;

  // Between the server's thread and those who stop it or the servo.
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_stopping_ = false, is_servo_stopping_ = false, has_let_go_ = false;
  std::thread thread_;
};
