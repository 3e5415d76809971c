// The server: lets other processes in to a servo. It is the fs_server of the C contract itself. One thread owns the
// sessions, and goes on with one client's work at a time (work.h); at the servo's rate it takes the moves that the clients have
// written, in turn. Each client has a scene and a channel of its own in the servo, so their forces add; a turn makes one
// snapshot of a scene at most.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "server/claims.h"
#include "server/clients.h"
#include "server/door.h"
#include "server/host.h"
#include "server/sessions.h"
#include "server/watcher.h"
#include "server/worker.h"

struct fs_server final : fs::Counted<fs_server>, fs::Host {
  // EXISTS, IO, FULL, STATE.
  fs_server(fs::Ref<fs::Servo> servo, const fs::Endpoint& endpoint, const fs::ServerSettings& settings);
  ~fs_server() { stop(); }

  void stop() noexcept;  // lets go of all clients, whose objects begin to fade

  fs::Servo& servo() const noexcept override { return *servo_; }

 private:
  // Numbers of the descriptors that are watched. A client's process has the number after that of its socket.
  enum Source : uint64_t { source_wake, source_timer, source_listener, source_shared_listener, first_session = 16 };
  static uint64_t socket_source(const fs::Client& client) noexcept { return first_session + 2 * client.id; }

  // ---- For the sessions.
  const fs::ServerSettings& settings() const noexcept override { return settings_; }
  const fs::Clients& clients() const noexcept override { return clients_; }
  fs::Claims& claims() noexcept override { return claims_; }
  void start_job(fs::Client& client, uint64_t bytes, std::function<void(fs::StopToken&)> work,
                 std::function<void()> done) override;
  void destroy(std::shared_ptr<void> what) override;
  bool is_slice_over() const noexcept override;
  void resume_later(const fs::Client& client) noexcept override;
  void note_activity() noexcept override;
  // On the heap: a thread-local buffer would keep the library from being loaded at run time.
  std::span<std::byte> message_buffer() noexcept override { return message_; }
  void set_reading(const fs::Client& client, bool is_reading) noexcept override;
  void require_room() override { clients_.require_room(); }
  void let_go(fs::Client& client) noexcept override;

  void run() noexcept;
  void set_timer() noexcept;
  void handle(uint64_t source);
  void finish_jobs();
  fs::Session* find_socket(const epoll_event& event) const;  // null: it is not the socket of a client
  void list(fs::Session& session) noexcept;
  fs::Session* next_of(std::span<const epoll_event> events) noexcept;
  void serve(fs::Session& session) noexcept;
  void wake_up() noexcept;
  void turn_if_due() noexcept;
  void open_door(bool is_open) noexcept;
  void accept_clients(const fs::Descriptor& listener);
  void let_in(fs::Descriptor&& socket);
  void turn(double now);
  void keep_house();
  void bury_sessions() noexcept;
  void fall_asleep() noexcept;
  void wake() const noexcept;

  const fs::Ref<fs::Servo> servo_;
  const fs::ServerSettings settings_;
  const double period_;  // s

  fs::Watcher watcher_;
  fs::Descriptor timer_, wake_;
  fs::Door door_;
  bool is_door_open_ = true;
  fs::Worker worker_, builder_;
  fs::Clients clients_{*servo_, settings_.max_clients};
  fs::Claims claims_;
  fs::Sessions sessions_;
  std::vector<fs::Session*> listed_;  // sessions that have more to do; with room for all of them
  std::vector<std::byte> message_;
  uint64_t last_id_ = 0, turns_ = 0;
  double slice_begin_ = 0;  // s
  bool is_asleep_ = false;
  double last_activity_ = 0, last_turn_ = 0, last_housekeeping_ = 0;

  // Shared with the threads that stop the server or the servo.
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_stopping_ = false, is_servo_stopping_ = false, has_let_go_ = false;
  std::thread thread_;
};
