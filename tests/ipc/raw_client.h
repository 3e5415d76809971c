// A client that speaks the protocol itself and keeps to no rule: it sends whatever a test wants. The records are the
// library's own (transfer/wire.h), so a layout that changes changes here too.
#pragma once

#include <cstring>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/text.h"
#include "ipc/blob.h"
#include "ipc/region.h"
#include "ipc/socket.h"
#include "transfer/records.h"
#include "transfer/shared_memory.h"

namespace hostile {

constexpr uint32_t all_parts = FS_PART_POSE | FS_PART_PROFILES | FS_PART_CONTACT | FS_PART_SHAPE | FS_PART_OTHER;

class RawClient {
 public:
  // The server's answer to a Hello, if it gave one.
  struct Greeting {
    bool is_answered = false;
    fs_status status = FS_OK;
    uint64_t magic = 0;
    uint32_t wire = 0;
    std::string text, version;
  };
  struct Reply {
    uint64_t serial;
    fs_status status;
    std::string text;
    std::vector<std::byte> body;
    fs::Descriptor data;
    template <class T>
    const T& as() const { return *reinterpret_cast<const T*>(body.data()); }
  };

  // Connects to the endpoint ("shm:NAME") of this user, as a stranger; waits where the server's queue is full.
  explicit RawClient(const std::string& endpoint);
  RawClient(RawClient&&) = default;
  RawClient& operator=(RawClient&&) = default;

  static fs::wire::Hello hello(const std::string& name);
  Greeting greet(const fs::wire::Hello& hello);  // maps what comes with a Welcome
  Greeting greet_with(std::span<const std::byte> bytes);
  int join(const std::string& name);  // must be accepted; returns how often it had to try

  // Sends bytes as they are, with descriptors; waits for room, 30 s at most. False: nobody takes them.
  bool send_bytes(std::span<const std::byte> bytes, std::span<const int> descriptors = {});
  // Sends a message with the next serial and returns that serial, whether or not the message arrives. more: the message
  // waits for the rest of its group, which then goes as one message of that serial.
  uint64_t send(uint32_t type, std::span<const std::byte> body, int descriptor = -1, bool more = false);
  template <class Record>
  uint64_t send(uint32_t type, const Record& record, int descriptor = -1, bool more = false) {
    return send(type, std::as_bytes(std::span(&record, 1)), descriptor, more);
  }
  uint64_t send(uint32_t type) { return send(type, std::span<const std::byte>()); }

  // The reply of a serial, others being thrown away; none within 30 s, or dropped: nothing.
  std::optional<Reply> reply_of(uint64_t serial, double timeout = 30);
  // Sends and waits. Dropped meanwhile: DISCONNECTED; no answer: TIMEOUT.
  template <class... Arguments>
  fs_status ask(uint32_t type, const Arguments&... arguments) {
    return status_of(reply_of(send(type, arguments...)));
  }
  fs_status status_of(const std::optional<Reply>& reply) const;

  bool is_dropped() const;       // now
  bool is_soon_dropped() const;  // within 30 s

  // Own objects. Only `parts` count of a Set.
  uint64_t set(uint32_t slot, const fs_object& object, bool more = false);
  uint64_t set(uint32_t slot, const fs::wire::Object& record, uint32_t parts = all_parts, bool more = false);
  uint64_t remove(const std::string& name, bool more = false);
  uint64_t place(const std::string& name, const fs::wire::Motion& motion, bool more = false);
  uint64_t forget(uint64_t id) { return send(fs::wire::type_forget, fs::wire::Forget{id}); }
  void move(uint32_t slot, uint64_t after, const fs_pose& pose);  // in the inbox
  uint64_t polyline(uint64_t id, std::span<const fs_vec3> points);
  uint64_t expression(uint64_t id, const char* text);

  bool next_event(fs_event& event);  // of the outbox; false: no more
  bool next_refusal(fs_event& event);

  fs::Descriptor socket;
  uint64_t serial = 0;

  // Valid once the client was accepted.
  fs::wire::Welcome welcome{};
  fs::Descriptor inbox_file, outbox_file;
  std::shared_ptr<void> inbox_memory, outbox_memory;
  fs::Inbox inbox;
  const fs::Outbox* outbox = nullptr;

 private:
  std::string endpoint_;
  uint64_t events_read_ = 0;
  std::vector<std::byte> group_;  // the group that is being built
};

// Changes of another client's object, "client/object".
fs::wire::Set change_of(const std::string& name, uint32_t parts, const fs::wire::Object& object);
fs::wire::Set change_of(const std::string& name, uint32_t parts, const fs_object& object);
fs::wire::Place move_of(const std::string& name, const fs_pose& pose = {{}, {1, 0, 0, 0}}, const fs_twist* twist = nullptr,
                        double time = 0);
fs::wire::Remove remove_of(const std::string& name);

// A memory file of this size with these seals; its content is `bytes`, then zeros.
fs::Descriptor memory_file(std::span<const std::byte> bytes, size_t size, unsigned seals);

}  // namespace hostile
