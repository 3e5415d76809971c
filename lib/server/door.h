// The door of a server: the sockets to which clients connect. It lets in only so many at a time, because each costs as much as
// many requests; then it stays closed until it is reopened. It also closes when the process has no descriptor left.
#pragma once

#include <functional>

#include "ipc/socket.h"

namespace fs {

class Door {
 public:
  Door(const std::string& name, bool is_for_all_users);  // EXISTS, IO, FULL

  const Descriptor& own_socket() const noexcept { return own_.socket(); }
  const Descriptor& shared_socket() const noexcept { return shared_.socket(); }  // may be none

  // Calls let_in(socket) for each client that waits. False: no more can be let in until the door is reopened.
  bool accept(const Descriptor& listener, const std::function<void(Descriptor&&)>& let_in);
  void reopen() noexcept;  // it may let in some more
  void close() noexcept;   // for good

 private:
  Listener own_, shared_;
  Descriptor spare_;  // closed for a moment, to accept and turn away a client when no other is left
  int accepted_ = 0;  // since it was reopened
};

}  // namespace fs
