// The socket between clients and server: SOCK_SEQPACKET in the abstract name space, which leaves nothing in a file system
// and is gone with its process. A message is a datagram, with a descriptor at most.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <span>
#include <string>

#include "base/descriptor.h"

namespace fs {

// "shm:NAME?user=U&timeout=T".
struct Endpoint {
  std::string text;       // as given, for sentences
  std::string name;
  uid_t user;             // whose server
  bool is_own_user;       // of this process
  double timeout = -1;    // s; below 0: not given
};
// INVALID; UNSUPPORTED ("dds:"). is_server: no options.
Endpoint parse_endpoint(const char* text, bool is_server);

// Where the server of a user listens, and the one that lets in all users.
std::string user_address(uid_t user, const std::string& name);
std::string shared_address(const std::string& name);

inline constexpr size_t most_message = 65536;  // bytes

// The server's socket, not blocking. A process that is forked from this one does not keep it: its address would be taken
// as long as that lives.
class Listener {
 public:
  Listener() = default;
  explicit Listener(const std::string& address);  // EXISTS, IO, FULL
  Listener(Listener&&) noexcept = default;
  Listener& operator=(Listener&&) noexcept = default;
  ~Listener() { reset(); }

  void reset() noexcept;
  const Descriptor& socket() const noexcept { return socket_; }

 private:
  Descriptor socket_;
};

// The client's, blocking; 0: done, else an errno.
int connect_to(const std::string& address, Descriptor& out);

struct Peer {
  pid_t process;
  uid_t user;
};
Peer peer_of(const Descriptor& socket);  // IO
// Readable when the process has ended. None: of another name space of processes, or gone already, or no descriptor left.
Descriptor open_process(pid_t process) noexcept;

enum class Transfer { done, again, closed };

// Never blocks or raises a signal. The parts are one message, with up to two descriptors. closed: nobody is there; also
// when the message cannot be sent at all.
Transfer send_message(const Descriptor& socket, std::span<const std::span<const std::byte>> parts,
                      std::span<const int> descriptors) noexcept;

// Bytes (as the system counts them) that were sent and that the other side has not read so far.
size_t unread(const Descriptor& socket) noexcept;

// Never blocks. size: of the message; one longer than the buffer counts as closed. The first descriptors that came are
// put in `descriptors`, what came beyond is closed; is_cut: some did not come, as this process has none left.
Transfer receive_message(const Descriptor& socket, std::span<std::byte> buffer, size_t& size,
                         std::span<Descriptor> descriptors, bool& is_cut) noexcept;

// Waits until there is something to read (or room to write), the other side is gone, or timeout s have passed: false.
bool wait_for(const Descriptor& socket, bool to_write, double timeout) noexcept;

}  // namespace fs
