#include "ipc/raw_client.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

namespace hostile {
namespace {

constexpr double patience = 30;  // s

void wait_a_little() { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }

[[noreturn]] void stop(const std::string& sentence) {  // ends the test: its set-up has failed
  std::fprintf(stderr, "raw client: %s\n", sentence.c_str());
  std::abort();
}

}  // namespace

RawClient::RawClient(const std::string& endpoint) : endpoint_(endpoint) {
  const std::string address = fs::user_address(geteuid(), endpoint.substr(4));
  const double start = fs::steady_now();
  int error;
  while ((error = fs::connect_to(address, socket)) != 0) {
    if (error != EAGAIN || fs::steady_now() - start > patience) stop(endpoint + ": " + std::strerror(error));
    wait_a_little();
  }
}

fs::wire::Hello RawClient::hello(const std::string& name) {
  fs::wire::Hello out{};
  out.magic = fs::wire::magic;
  out.wire = fs::wire::version;
  out.sizes = fs::own_sizes();
  fs::put_text(out.client, name);
  fs::put_text(out.version, "test");
  return out;
}

RawClient::Greeting RawClient::greet(const fs::wire::Hello& hello) { return greet_with(fs::bytes_of(&hello, 1)); }

RawClient::Greeting RawClient::greet_with(std::span<const std::byte> bytes) {
  Greeting out;
  if (!send_bytes(bytes)) return out;
  std::vector<std::byte> buffer(fs::most_message);
  fs::Descriptor came[2];
  size_t size = 0;
  bool is_cut = false;
  fs::Transfer transfer;
  do {
    if (!fs::wait_for(socket, false, patience)) return out;
    transfer = fs::receive_message(socket, buffer, size, came, is_cut);
  } while (transfer == fs::Transfer::again);
  fs::wire::HelloAnswer answer;
  if (transfer != fs::Transfer::done || size < sizeof answer) return out;
  std::memcpy(&answer, buffer.data(), sizeof answer);
  out.is_answered = true;
  out.status = static_cast<fs_status>(answer.status);
  out.magic = answer.magic;
  out.wire = answer.wire;
  out.version = fs::text_of(answer.version);
  out.text = fs::text_of(answer.text);
  if (out.status != FS_OK) return out;
  if (size != sizeof answer + sizeof welcome || !came[0] || !came[1]) stop("no good Welcome");
  std::memcpy(&welcome, buffer.data() + sizeof answer, sizeof welcome);
  inbox_file = std::move(came[0]);
  outbox_file = std::move(came[1]);
  inbox_memory = fs::map_region(inbox_file, welcome.inbox_bytes, true);
  outbox_memory = fs::map_region(outbox_file, welcome.outbox_bytes, false);
  inbox = fs::Inbox(inbox_memory.get(), welcome.max_objects);
  outbox = static_cast<const fs::Outbox*>(outbox_memory.get());
  return out;
}

int RawClient::join(const std::string& name) {
  const double start = fs::steady_now();
  for (int tries = 1;; ++tries) {
    const Greeting greeting = greet(hello(name));
    if (greeting.is_answered && greeting.status == FS_OK) return tries;
    if (greeting.is_answered) stop("'" + name + "' is not let in: " + greeting.text);
    if (fs::steady_now() - start > patience) stop("'" + name + "' is not let in, nor told why");
    wait_a_little();
    *this = RawClient(endpoint_);
  }
}

bool RawClient::send_bytes(std::span<const std::byte> bytes, std::span<const int> descriptors) {
  iovec vector{const_cast<std::byte*>(bytes.data()), bytes.size()};
  std::vector<char> control(CMSG_SPACE(descriptors.size_bytes()));
  msghdr message{};
  message.msg_iov = &vector;
  message.msg_iovlen = 1;
  if (!descriptors.empty()) {
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    cmsghdr* header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(descriptors.size_bytes());
    std::memcpy(CMSG_DATA(header), descriptors.data(), descriptors.size_bytes());
  }
  const double start = fs::steady_now();
  for (;;) {
    if (sendmsg(socket.get(), &message, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) return true;
    const bool may_pass = errno == EAGAIN || errno == EINTR || errno == ETOOMANYREFS || errno == ENOBUFS;
    if (!may_pass || fs::steady_now() - start > patience) return false;
    fs::wait_for(socket, true, 0.1);
  }
}

uint64_t RawClient::send(uint32_t type, std::span<const std::byte> body, int descriptor, bool more) {
  const auto append = [](std::vector<std::byte>& bytes, std::span<const std::byte> part) {
    bytes.insert(bytes.end(), part.begin(), part.end());
  };
  const bool is_in_group = more || !group_.empty();
  const fs::wire::Header header{type, 0, is_in_group ? 0 : ++serial};
  std::vector<std::byte> bytes;
  if (is_in_group) {
    append(group_, fs::bytes_of(&header, 1));
    append(group_, body);
    if (more) return serial + 1;
    const fs::wire::Header outer{fs::wire::type_group, 0, ++serial};
    const fs::wire::Group group{group_.size()};
    append(bytes, fs::bytes_of(&outer, 1));
    append(bytes, fs::bytes_of(&group, 1));
    const bool fits = bytes.size() + group_.size() <= fs::most_message;
    if (fits) append(bytes, group_);
    const fs::Descriptor blob = fits ? fs::Descriptor() : fs::make_blob({group_});
    const int number = fits ? descriptor : blob.get();
    send_bytes(bytes, std::span(&number, number >= 0 ? 1 : 0));
    group_.clear();
    return serial;
  }
  append(bytes, fs::bytes_of(&header, 1));
  append(bytes, body);
  send_bytes(bytes, std::span(&descriptor, descriptor >= 0 ? 1 : 0));
  return serial;
}

std::optional<RawClient::Reply> RawClient::reply_of(uint64_t wanted, double timeout) {
  std::vector<std::byte> buffer(fs::most_message);
  const double start = fs::steady_now();
  for (;;) {
    const double rest = timeout - (fs::steady_now() - start);
    if (!(rest > 0) || !fs::wait_for(socket, false, rest)) return {};
    fs::Descriptor data;
    size_t size = 0;
    bool is_cut = false;
    const fs::Transfer transfer = fs::receive_message(socket, buffer, size, {&data, 1}, is_cut);
    if (transfer == fs::Transfer::closed) return {};
    if (transfer == fs::Transfer::again) continue;
    fs::wire::Header header;
    fs::wire::Reply record;
    if (size < sizeof header + sizeof record) stop("a reply that is too short");
    std::memcpy(&header, buffer.data(), sizeof header);
    std::memcpy(&record, buffer.data() + sizeof header, sizeof record);
    if (header.type != fs::wire::type_reply) stop("a message that is no reply");
    if (header.serial != wanted) continue;
    return Reply{wanted, static_cast<fs_status>(record.status), fs::text_of(record.text),
                 {buffer.begin() + sizeof header + sizeof record, buffer.begin() + static_cast<ptrdiff_t>(size)},
                 std::move(data)};
  }
}

fs_status RawClient::status_of(const std::optional<Reply>& reply) const {
  if (reply) return reply->status;
  return is_dropped() ? FS_ERROR_DISCONNECTED : FS_ERROR_TIMEOUT;
}

bool RawClient::is_dropped() const {
  pollfd look{socket.get(), 0, 0};
  return !socket || (poll(&look, 1, 0) > 0 && (look.revents & (POLLHUP | POLLERR)));
}

bool RawClient::is_soon_dropped() const {
  pollfd look{socket.get(), 0, 0};
  return !socket || (poll(&look, 1, static_cast<int>(1000 * patience)) > 0 && (look.revents & (POLLHUP | POLLERR)));
}

uint64_t RawClient::set(uint32_t slot, const fs::wire::Object& record, uint32_t parts, bool more) {
  return send(fs::wire::type_set, fs::wire::Set{slot, parts, record}, -1, more);
}

uint64_t RawClient::set(uint32_t slot, const fs_object& object, bool more) {
  return set(slot, fs::to_record(object), all_parts, more);
}

uint64_t RawClient::remove(const std::string& name, bool more) {
  fs::wire::Remove record;
  fs::put_text(record.name, name);
  return send(fs::wire::type_remove, record, -1, more);
}

uint64_t RawClient::place(const std::string& name, const fs::wire::Motion& motion, bool more) {
  fs::wire::Place record{{}, motion};
  fs::put_text(record.name, name);
  return send(fs::wire::type_place, record, -1, more);
}

void RawClient::move(uint32_t slot, uint64_t after, const fs_pose& pose) {
  inbox.write(slot, {after, {pose, {}, fs::steady_now(), 0}});
  if (outbox->is_asleep.load()) send(fs::wire::type_wake);
}

uint64_t RawClient::polyline(uint64_t id, std::span<const fs_vec3> points) {
  const fs::Descriptor data = fs::make_blob({std::as_bytes(points)});
  return send(fs::wire::type_shape, fs::wire::Shape{id, FS_PRIMITIVE_POLYLINE, 0, points.size(), 0}, data.get());
}

uint64_t RawClient::expression(uint64_t id, const char* text) {
  fs::wire::Curve curve{};
  curve.id = id;
  fs::put_text(curve.expression, text);
  return send(fs::wire::type_curve, curve);
}

bool RawClient::next_event(fs_event& event) {
  const uint64_t written = outbox->events_written.load(std::memory_order_acquire);
  if (written - events_read_ > fs::kept_events) events_read_ = written - fs::kept_events;
  for (; events_read_ < written; ++events_read_) {
    fs::wire::NumberedEvent slot;
    if (!outbox->events[events_read_ % fs::kept_events].read(slot) || slot.number != events_read_) continue;
    event = slot.event;
    ++events_read_;
    return true;
  }
  return false;
}

bool RawClient::next_refusal(fs_event& event) {
  while (next_event(event)) {
    if (event.kind == FS_EVENT_REFUSED) return true;
  }
  return false;
}

fs::wire::Set change_of(const std::string& name, uint32_t parts, const fs::wire::Object& object) {
  fs::wire::Set out{fs::wire::no_slot, parts, object};
  fs::put_text(out.object.name, name);
  return out;
}
fs::wire::Set change_of(const std::string& name, uint32_t parts, const fs_object& object) {
  return change_of(name, parts, fs::to_record(object));
}
fs::wire::Place move_of(const std::string& name, const fs_pose& pose, const fs_twist* twist, double time) {
  fs::wire::Place out{{}, {pose, twist ? *twist : fs_twist{}, time, twist ? fs::extrapolation_limit : fs::wire::unknown_horizon}};
  fs::put_text(out.name, name);
  return out;
}
fs::wire::Remove remove_of(const std::string& name) {
  fs::wire::Remove out{};
  fs::put_text(out.name, name);
  return out;
}

fs::Descriptor memory_file(std::span<const std::byte> bytes, size_t size, unsigned seals) {
  fs::Descriptor file(memfd_create("test", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!file || ftruncate(file.get(), static_cast<off_t>(size)) != 0 ||
      pwrite(file.get(), bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()) ||
      (seals && fcntl(file.get(), F_ADD_SEALS, seals) != 0)) {
    stop(std::string("a memory file: ") + std::strerror(errno));
  }
  return file;
}

}  // namespace hostile
