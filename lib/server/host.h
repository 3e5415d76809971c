// The server as its sessions see it: what is the same for all of them, who else is connected, and the two ways in which
// long work does not keep others waiting: a worker does it, or the server looks after the others in the middle of it.
// All of it on the server's thread.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "base/wanted.h"
#include "server/settings.h"

namespace fs {

struct Client;
class Clients;
class Session;

class Host {
 public:
  virtual const ServerSettings& settings() const noexcept = 0;
  virtual Servo& servo() const noexcept = 0;  // with the server's own scene
  virtual const Clients& clients() const noexcept = 0;

  // A worker calls work, which must not throw, and looks at `wanted` at every step. Then the server's thread calls done,
  // unless the client is gone. bytes: that it works on; what is small does not wait for what is large.
  virtual void start_job(Client& client, uint64_t bytes, std::function<void(Wanted& wanted)> work,
                         std::function<void()> done) = 0;
  // A worker destroys it, as that takes a while.
  virtual void destroy(std::shared_ptr<void> what) = 0;
  // In the middle of long work for `busy` (null: for nobody): does the turns that are due, and handles a message of another
  // client, if there is one that does not touch what is half done. is_alone: turns only.
  virtual void let_others(const Client* busy, bool is_alone) noexcept = 0;
  virtual void note_activity() noexcept = 0;  // the server stays awake

  // ---- For the life of a session.
  virtual std::span<std::byte> message_buffer() noexcept = 0;  // where a message is read into, one at a time
  virtual void set_reading(const Client& client, bool is_reading) noexcept = 0;
  virtual void require_room() = 0;                             // for one more client. FULL
  virtual void let_go(const Client& client) noexcept = 0;      // it is gone: its socket and its jobs are looked at no more

 protected:
  ~Host() = default;
};

}  // namespace fs
