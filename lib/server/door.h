// The door of a server: the sockets at which clients ask to be let in. It lets in so many in a while, because each costs as
// much as many requests, and closes where the process has no descriptor left, until it is opened again.
#pragma once

#include <functional>

#include "ipc/socket.h"

namespace fs {

class Door {
 public:
  // Everybody is let in at the first address; where it is empty, it is not there. EXISTS, IO, FULL.
  Door(const std::string& own_address, const std::string& shared_address);

  const Descriptor& own_socket() const noexcept { return own_.socket(); }
  const Descriptor& shared_socket() const noexcept { return shared_.socket(); }  // may be none

  // Calls let_in(socket of a client) for those who wait. False: the door has to be closed for now.
  bool accept(const Descriptor& listener, const std::function<void(Descriptor&&)>& let_in);
  void reopen() noexcept;  // it lets in some more
  void close() noexcept;   // for good

 private:
  Listener own_, shared_;
  Descriptor spare_;  // given up to turn away somebody where none is left
  int accepted_ = 0;  // since it was opened
};

}  // namespace fs
