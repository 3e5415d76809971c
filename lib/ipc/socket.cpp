#include "ipc/socket.h"

#include <fcntl.h>
#include <linux/sockios.h>
#include <poll.h>
#include <pthread.h>
#include <pwd.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <thread>
#include <vector>

#include "base/clock.h"
#include "base/error.h"
#include "base/text.h"

namespace fs {
namespace {

constexpr size_t longest_endpoint = 64;

uid_t parse_user(const std::string& text) {
  uid_t id = 0;
  if (read_number(text, id)) return id;
  std::vector<char> buffer(16384);
  passwd entry, *found = nullptr;
  getpwnam_r(text.c_str(), &entry, buffer.data(), buffer.size(), &found);
  if (!found) {
    fail(FS_ERROR_INVALID, "user is '%s', must be a user of this machine, by name or number", shortened(text).c_str());
  }
  return found->pw_uid;
}

double parse_timeout(const std::string& text) {
  double timeout = 0;
  if (!read_number(text, timeout) || !(timeout >= 0 && timeout <= 1e6)) {
    fail(FS_ERROR_INVALID, "timeout is '%s', must be within 0..1e6 s", shortened(text).c_str());
  }
  return timeout;
}

// The listeners that are open, for the child of a fork to close. A fork waits while one is opened or closed.
struct Listeners {
  std::mutex mutex;
  std::vector<int> numbers;
};
Listeners& listeners() {
  static Listeners& all = *new Listeners;  // never destroyed: a fork may come late
  [[maybe_unused]] static const int is_watching =
      pthread_atfork([] { listeners().mutex.lock(); }, [] { listeners().mutex.unlock(); },
                     [] {
                       for (const int number : all.numbers) close(number);
                       all.numbers.clear();
                       all.mutex.unlock();
                     });
  return all;
}

struct Place {
  sockaddr_un address{};
  socklen_t size = sizeof(sockaddr_un);
  Place() { address.sun_family = AF_UNIX; }
};

Place abstract_place(const std::string& address) {
  Place out;
  std::memcpy(out.address.sun_path + 1, address.data(), address.size());  // after a 0
  out.size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + address.size());
  return out;
}

// A file of an open folder, whatever the folder is called by now.
Place place_in(const Descriptor& folder, const std::string& file) {
  Place out;
  std::snprintf(out.address.sun_path, sizeof out.address.sun_path, "/proc/self/fd/%d/%s", folder.get(), file.c_str());
  return out;
}
std::string file_of(const std::string& name) { return ".forceserver-" + name; }

// A field of a user's entry in the list of users, such as its name; empty: there is no such user.
std::string of_user(uid_t user, char* passwd::* field) {
  std::vector<char> buffer(16384);
  passwd entry, *found = nullptr;
  getpwuid_r(user, &entry, buffer.data(), buffer.size(), &found);
  return found ? found->*field : "";
}

// The folders in which no other user can make a file. The first exists as long as the user is logged in, so a server and its
// client may not see the same ones.
std::vector<Descriptor> open_own_folders() {
  const uid_t user = geteuid();
  std::vector<Descriptor> all;
  for (const std::string& folder : {"/run/user/" + std::to_string(user), of_user(user, &passwd::pw_dir)}) {
    Descriptor opened(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    struct stat info;
    if (!opened || fstat(opened.get(), &info) != 0) continue;
    if (info.st_uid == user && !(info.st_mode & (S_IWGRP | S_IWOTH))) all.push_back(std::move(opened));
  }
  return all;
}

int connect_to(const Place& place, Descriptor& out) {
  Descriptor made(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!made) return errno;
  while (connect(made.get(), reinterpret_cast<const sockaddr*>(&place.address), place.size) != 0) {
    if (errno != EINTR) return errno;
  }
  out = std::move(made);
  return 0;
}

// Connects to a server of this user that listens at a file. False: there is none.
bool connect_in(const std::vector<Descriptor>& folders, const std::string& name, Descriptor& out) {
  for (const Descriptor& folder : folders) {
    Descriptor made;
    if (connect_to(place_in(folder, file_of(name)), made) != 0 || peer_of(made).user != geteuid()) continue;
    out = std::move(made);
    return true;
  }
  return false;
}

[[noreturn]] void fail_taken(const std::string& name, const std::string& by) {
  fail(FS_ERROR_EXISTS, "endpoint is 'shm:%s': %s", name.c_str(), by.c_str());
}

constexpr const char* own_server = "a server of this user has that name already";

}  // namespace

Endpoint parse_endpoint(const char* given, bool is_server) {
  Endpoint out;
  out.text = given;
  const std::string shown = shortened(given);  // in sentences
  if (out.text.starts_with("dds:")) {
    fail(
        FS_ERROR_UNSUPPORTED,
        "endpoint is '%s': the library does not speak DDS; connect to the server of this machine (shm:NAME), and join the servers of "
        "several machines by the program forceserver-bridge",
        shown.c_str());
  }
  if (!out.text.starts_with("shm:")) {
    fail(FS_ERROR_INVALID, "endpoint is '%s', must begin with shm:", shown.c_str());
  }
  const size_t question = out.text.find('?');
  out.name = out.text.substr(4, question == std::string::npos ? question : question - 4);
  out.user = geteuid();
  if (out.name.empty() || out.name.size() > longest_endpoint) {
    fail(FS_ERROR_INVALID, "endpoint is '%s': its name is %zu bytes long, must be 1..%zu", shown.c_str(), out.name.size(),
         longest_endpoint);
  }
  for (const char c : out.name) {
    if (c == '/' || static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      fail(FS_ERROR_INVALID, "endpoint is '%s': its name must be without '/' and control characters", shown.c_str());
    }
  }
  std::string options = question == std::string::npos ? "" : out.text.substr(question + 1);
  bool has_user = false;
  while (!options.empty()) {
    const size_t end = options.find('&');
    const std::string option = options.substr(0, end);
    options = end == std::string::npos ? "" : options.substr(end + 1);
    const size_t equals = option.find('=');
    const std::string key = option.substr(0, equals), value = equals == std::string::npos ? "" : option.substr(equals + 1);
    const bool is_known = !is_server && equals != std::string::npos && (key == "user" || key == "timeout");
    if (!is_known) {
      fail(FS_ERROR_INVALID, "endpoint is '%s': option '%s' is unknown; %s", shown.c_str(), shortened(option).c_str(),
           is_server ? "a server has no options" : "the options are user=USER and timeout=SECONDS");
    }
    if (key == "user" ? has_user : out.timeout >= 0) {
      fail(FS_ERROR_INVALID, "endpoint is '%s': %s is given twice", shown.c_str(), key.c_str());
    }
    if (key == "user") {
      out.user = parse_user(value);
      has_user = true;
    } else {
      out.timeout = parse_timeout(value);
    }
  }
  out.is_own_user = out.user == geteuid();
  return out;
}

std::string name_of_user(uid_t user) {
  const std::string name = of_user(user, &passwd::pw_name);
  return name.empty() ? std::to_string(user) : name;
}

std::string user_address(uid_t user, const std::string& name) { return "forceserver/" + std::to_string(user) + "/" + name; }

std::string shared_address(const std::string& name) { return "forceserver/" + name; }

bool Listener::listen_at(const sockaddr_un& place, socklen_t size) {
  Listeners& all = listeners();
  const std::lock_guard lock(all.mutex);
  all.numbers.reserve(all.numbers.size() + 1);
  Descriptor made(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!made || bind(made.get(), reinterpret_cast<const sockaddr*>(&place), size) != 0 || listen(made.get(), 64) != 0) {
    if (made && errno == EADDRINUSE) return false;
    fail(status_without_descriptor(errno), "no server can listen at this endpoint: %s", std::strerror(errno));
  }
  all.numbers.push_back(made.get());
  socket_ = std::move(made);
  return true;
}

bool Listener::listen_soon(const std::string& address, Descriptor& other) {
  const Place place = abstract_place(address);
  // Who cannot be asked may be about to begin or to end.
  for (int tries = 0; tries < 30 && !other; ++tries) {
    if (tries > 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    if (listen_at(place.address, place.size)) return true;
    connect_to(place, other);
  }
  return false;
}

Listener Listener::for_this_user(const std::string& name) {
  Listener out;
  Descriptor other;
  std::vector<Descriptor> folders = open_own_folders();
  if (connect_in(folders, name, other)) fail_taken(name, own_server);
  if (out.listen_soon(user_address(geteuid(), name), other)) return out;
  const bool is_known = bool(other);
  if (is_known && peer_of(other).user == geteuid()) fail_taken(name, own_server);
  if (folders.empty()) {
    fail_taken(name, (is_known ? "user " + name_of_user(peer_of(other).user) : "somebody who does not answer") +
                         " has that name, and this user has no folder of its own for a socket");
  }
  Descriptor& folder = folders.front();
  out.file_ = file_of(name);
  const Place file = place_in(folder, out.file_);
  // Of two servers that begin, one comes first. The lock is given back below, or with the descriptor.
  while (flock(folder.get(), LOCK_EX) != 0 && errno == EINTR) {
  }
  if (!out.listen_at(file.address, file.size)) {
    if (connect_to(file, other) == 0) fail_taken(name, own_server);
    unlinkat(folder.get(), out.file_.c_str(), 0);  // of a server that was killed
    if (!out.listen_at(file.address, file.size)) fail_taken(name, own_server);
  }
  flock(folder.get(), LOCK_UN);
  out.folder_ = std::move(folder);
  return out;
}

Listener Listener::for_all_users(const std::string& name) {
  Listener out;
  Descriptor other;
  if (out.listen_soon(shared_address(name), other)) return out;
  fail_taken(name,
             (other ? "user " + name_of_user(peer_of(other).user) : "another server") + " has that name already for all users");
}

void Listener::reset() noexcept {
  if (!socket_) return;
  Listeners& all = listeners();
  const std::lock_guard lock(all.mutex);
  std::erase(all.numbers, socket_.get());
  if (folder_) unlinkat(folder_.get(), file_.c_str(), 0);
  // A process that was forked just now may hold it open for a moment. Nobody can connect to it there any more, so a new server sees
  // that the name is being given up.
  shutdown(socket_.get(), SHUT_RDWR);
  socket_.reset();
  folder_.reset();
}

int connect_to(const std::string& address, Descriptor& out) { return connect_to(abstract_place(address), out); }

int connect_to_own_server(const std::string& name, Descriptor& out) {
  const int error = connect_to(user_address(geteuid(), name), out);
  if (error == 0 && peer_of(out).user == geteuid()) return 0;
  return connect_in(open_own_folders(), name, out) ? 0 : error;
}

Peer peer_of(const Descriptor& socket) {
  ucred found{};
  socklen_t size = sizeof found;
  if (getsockopt(socket.get(), SOL_SOCKET, SO_PEERCRED, &found, &size) != 0) {
    fail(FS_ERROR_IO, "the system does not say which process is at the other end: %s", std::strerror(errno));
  }
  return {found.pid, found.uid};
}

Descriptor open_process(pid_t process) noexcept {
  return Descriptor(process > 0 ? static_cast<int>(syscall(SYS_pidfd_open, process, 0)) : -1);
}

Transfer send_message(const Descriptor& socket, std::span<const std::span<const std::byte>> parts,
                      std::span<const int> descriptors) noexcept {
  std::array<iovec, 4> vectors{};
  for (size_t i = 0; i < parts.size(); ++i) {
    vectors[i] = {const_cast<std::byte*>(parts[i].data()), parts[i].size()};
  }
  alignas(cmsghdr) std::array<char, CMSG_SPACE(2 * sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = vectors.data();
  message.msg_iovlen = parts.size();
  if (!descriptors.empty()) {
    message.msg_control = control.data();
    message.msg_controllen = CMSG_SPACE(descriptors.size_bytes());
    cmsghdr* header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(descriptors.size_bytes());
    std::memcpy(CMSG_DATA(header), descriptors.data(), descriptors.size_bytes());
  }
  for (;;) {
    if (sendmsg(socket.get(), &message, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) return Transfer::done;
    if (errno == EINTR) continue;
    // ETOOMANYREFS: too many descriptors are in transit.
    const bool may_pass = errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS || errno == ETOOMANYREFS;
    return may_pass ? Transfer::again : Transfer::closed;
  }
}

size_t unread(const Descriptor& socket) noexcept {
  int bytes = 0;
  return ioctl(socket.get(), SIOCOUTQ, &bytes) == 0 ? static_cast<size_t>(bytes) : 0;
}

Transfer receive_message(const Descriptor& socket, std::span<std::byte> buffer, size_t& size, std::span<Descriptor> descriptors,
                         bool& is_cut) noexcept {
  iovec vector{buffer.data(), buffer.size()};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(16 * sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &vector;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  ssize_t got;
  do {
    got = recvmsg(socket.get(), &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
  } while (got < 0 && errno == EINTR);
  if (got < 0) return errno == EAGAIN || errno == EWOULDBLOCK ? Transfer::again : Transfer::closed;

  size_t kept = 0;
  for (cmsghdr* header = CMSG_FIRSTHDR(&message); header; header = CMSG_NXTHDR(&message, header)) {
    if (header->cmsg_level != SOL_SOCKET || header->cmsg_type != SCM_RIGHTS) continue;
    for (size_t i = 0; i < (header->cmsg_len - CMSG_LEN(0)) / sizeof(int); ++i) {
      int number;
      std::memcpy(&number, CMSG_DATA(header) + i * sizeof(int), sizeof number);
      Descriptor came(number);
      if (kept < descriptors.size()) descriptors[kept++] = std::move(came);
    }
  }
  is_cut = message.msg_flags & MSG_CTRUNC;
  size = static_cast<size_t>(got);
  return got == 0 || (message.msg_flags & MSG_TRUNC) ? Transfer::closed : Transfer::done;
}

bool wait_for(const Descriptor& socket, bool to_write, double timeout) noexcept {
  pollfd waiting{socket.get(), static_cast<short>(to_write ? POLLOUT : POLLIN), 0};
  const double end = steady_now() + timeout;
  for (double rest = timeout;; rest = end - steady_now()) {  // after a signal it goes on for the rest of the time
    const double limited = std::fmax(rest, 0), whole = std::floor(limited);
    const timespec limit{static_cast<time_t>(whole), static_cast<long>((limited - whole) * 1e9)};
    const int found = ppoll(&waiting, 1, &limit, nullptr);
    if (found > 0) return true;
    if (found == 0 || errno != EINTR || !(rest > 0)) return false;
  }
}

}  // namespace fs
