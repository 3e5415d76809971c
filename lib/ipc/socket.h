// Sockets between clients and server: SOCK_SEQPACKET in the abstract name space, so that nothing is left in a file system
// when the process ends. There every user can take every name: both sides look whose process is at the other end, and
// where another user has taken the name, a server of this user listens at a file in a folder that is this user's alone. A
// message is a datagram that may carry descriptors.
#pragma once

#include <sys/socket.h>
#include <sys/types.h>
#include <sys/un.h>

#include <cstddef>
#include <span>
#include <string>

#include "base/descriptor.h"

namespace fs {

// "shm:NAME?user=U&timeout=T".
struct Endpoint {
  std::string text;       // as given, for error sentences
  std::string name;
  uid_t user;             // whose server
  bool is_own_user;       // of this process
  double timeout = -1;    // s; below 0: not given
};
// is_server: no options are allowed. INVALID; UNSUPPORTED: "dds:".
Endpoint parse_endpoint(const char* text, bool is_server);

// Where the server of a user listens, and where a server for all users listens as well.
std::string user_address(uid_t user, const std::string& name);
std::string name_of_user(uid_t user);  // for sentences; the number where there is no name
std::string shared_address(const std::string& name);

inline constexpr size_t most_message = 65536;  // bytes

// The socket at which a server listens, non-blocking. A child that is forked closes it at once: else the address would be
// taken as long as the child lives.
class Listener {
 public:
  Listener() = default;
  static Listener for_this_user(const std::string& name);  // waits 0.3 s at most. EXISTS, IO, FULL
  static Listener for_all_users(const std::string& name);  // the same
  Listener(Listener&&) noexcept = default;
  Listener& operator=(Listener&&) = delete;
  ~Listener() { reset(); }

  void reset() noexcept;
  const Descriptor& socket() const noexcept { return socket_; }

 private:
  bool listen_at(const sockaddr_un& place, socklen_t size);  // false: somebody has it. IO, FULL
  // The same; waits 0.3 s at most for somebody who cannot be asked. other: who has it, where he can be asked.
  bool listen_soon(const std::string& address, Descriptor& other);

  Descriptor socket_;
  Descriptor folder_;  // of the file at which it listens; none: the address is abstract
  std::string file_;
};

// Connects a client's socket. 0: done, else an errno.
int connect_to(const std::string& address, Descriptor& out);
// The same, to the server of this user; where that is not there, the other end may be of another user.
int connect_to_own_server(const std::string& name, Descriptor& out);

struct Peer {
  pid_t process;
  uid_t user;
};
Peer peer_of(const Descriptor& socket);  // IO
// A descriptor that is readable when the process has ended. None: the process is in another name space or gone already, or no
// descriptor is left.
Descriptor open_process(pid_t process) noexcept;

enum class Transfer { done, again, closed };

// Sends the parts as one message, with up to two descriptors. Never blocks or raises a signal. again: there is no room now;
// closed: the other side is gone, or the message can never be sent.
Transfer send_message(const Descriptor& socket, std::span<const std::span<const std::byte>> parts,
                      std::span<const int> descriptors) noexcept;

// Bytes, as the system counts them, that were sent and that the other side has not read.
size_t unread(const Descriptor& socket) noexcept;

// Receives a message of `size` bytes; never blocks. A message longer than the buffer counts as closed. Fills `descriptors`
// with the first that came, and closes the others. is_cut: some did not arrive, as this process has none left.
Transfer receive_message(const Descriptor& socket, std::span<std::byte> buffer, size_t& size, std::span<Descriptor> descriptors,
                         bool& is_cut) noexcept;

// Waits until there is something to read (or room to write) or the other side is gone. False: timeout s have passed.
bool wait_for(const Descriptor& socket, bool to_write, double timeout) noexcept;

}  // namespace fs
