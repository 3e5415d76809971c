// The server as its sessions see it: what is the same for all sessions, and who else is connected. Long work does not keep
// other clients waiting: either a worker does it, or the session lets the server look after the others again and again.
// All calls come from the server's thread.
//
// Who may run inside whom: a client's long work (a group, a clear, changes that were parked) marks the client with is_applying
// and calls let_others() between its steps. In there run only
//   - turns that are due: they take and post the moves of all clients but those with is_applying;
//   - one message of one other client, with is_among_others_: its own long work inside lets turns run, and nobody else.
// That message must not touch what is half done: Session::is_next_apart looks into it, and leaves groups, questions about all
// clients, and whatever is about the busy client's objects for later. While a group keeps drafts of other clients' scenes
// (is_amid_drafts), turns alone run. Jobs that are done, parked changes and the door are looked at by the server's loop only,
// never inside a client's work.
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
  virtual Servo& servo() const noexcept = 0;  // which also has the server's own scene
  virtual const Clients& clients() const noexcept = 0;

  // A worker calls work, which must not throw and looks at `wanted` at every step. Then the server's thread calls done,
  // unless the client is gone. bytes: the size of the work; a small job does not wait for large ones.
  virtual void start_job(Client& client, uint64_t bytes, std::function<void(Wanted& wanted)> work,
                         std::function<void()> done) = 0;
  // Lets a worker destroy what would take long here.
  virtual void destroy(std::shared_ptr<void> what) = 0;
  // Called in the middle of long work for `busy` (null: for nobody): does the turns that are due, and handles a message of
  // another client, if there is one that does not touch what is half done. is_alone: does turns only.
  virtual void let_others(const Client* busy, bool is_alone) noexcept = 0;
  virtual void note_activity() noexcept = 0;  // the server stays awake

  // ---- For the life of a session.
  virtual std::span<std::byte> message_buffer() noexcept = 0;  // to read one message into
  virtual void set_reading(const Client& client, bool is_reading) noexcept = 0;
  virtual void require_room() = 0;                             // for one more client. FULL
  virtual void let_go(const Client& client) noexcept = 0;      // it is gone: drops its jobs, and watches it no more

 protected:
  ~Host() = default;
};

}  // namespace fs
