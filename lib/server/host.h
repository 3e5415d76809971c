// The server as its sessions see it: what is the same for all sessions, and who else is connected. What takes long is done by
// a worker, or step by step (work.h). All calls come from the server's thread.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "base/stop_token.h"
#include "server/settings.h"

namespace fs {

struct Client;
class Claims;
class Clients;

class Host {
 public:
  virtual const ServerSettings& settings() const noexcept = 0;
  virtual Servo& servo() const noexcept = 0;  // which also has the server's own scene
  virtual const Clients& clients() const noexcept = 0;
  virtual Claims& claims() noexcept = 0;

  // A worker calls work, which must not throw and looks at `stop` at every step. Then the client's session calls done, unless
  // the client is gone. bytes: the size of the work; a small job does not wait for large ones.
  virtual void start_job(Client& client, uint64_t bytes, std::function<void(StopToken& stop)> work,
                         std::function<void()> done) = 0;
  // Lets a worker destroy what would take long here.
  virtual void destroy(std::shared_ptr<void> what) = 0;
  virtual bool is_slice_over() const noexcept = 0;  // the running client is to give way to others
  virtual void resume_later(const Client& client) noexcept = 0;  // when it is scheduled
  virtual void note_activity() noexcept = 0;        // the server stays awake

  // ---- For the life of a session.
  virtual std::span<std::byte> message_buffer() noexcept = 0;  // to read one message into
  virtual void set_reading(const Client& client, bool is_reading) noexcept = 0;
  virtual void require_room() = 0;                             // for one more client. FULL
  virtual void let_go(Client& client) noexcept = 0;            // it is gone: drops its jobs and claims, and watches it no more

 protected:
  ~Host() = default;
};

}  // namespace fs
