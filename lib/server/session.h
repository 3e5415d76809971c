// One client as the server has it: its socket, its memory, its scene and channel. Nothing that comes from it is trusted:
// it is copied, checked, then used; what is not good harms this client alone. All on the server's thread.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/name_map.h"
#include "ipc/region.h"
#include "ipc/socket.h"
#include "scene/transfer.h"
#include "server/server.h"

namespace fs {

class Session : public std::enable_shared_from_this<Session> {
 public:
  // refusal: FS_OK, or what it will be told when it says who it is.
  Session(fs_server& server, uint64_t id, Descriptor socket, const Peer& peer, fs_status refusal);
  ~Session();

  uint64_t id() const noexcept { return id_; }
  const std::string& name() const noexcept { return name_; }  // empty: it has not said yet
  const Descriptor& socket() const noexcept { return socket_; }
  const Descriptor& process() const noexcept { return process_; }  // pidfd; may be none
  bool is_gone() const noexcept { return is_gone_; }
  bool is_refused() const noexcept { return refusal_ != FS_OK; }

  // A few of the messages that are there.
  void receive() noexcept;
  // What comes each period: takes the moves, and posts the changes to the servo.
  void turn(double now) noexcept;
  // After all have had their turn: tells what a tick has used.
  void settle() noexcept;
  // Now and then: passes on the scene's events, and looks after the channel.
  void keep_house() noexcept;
  bool is_busy() const noexcept;  // it waits for something that the servo or the worker must do
  bool is_alive() const noexcept;  // its process, as far as the system tells
  // From now on the client is gone; its objects fade from `lease` s on.
  void drop(double lease) noexcept;
  void set_asleep(bool is_asleep) noexcept;
  bool has_moves() const noexcept { return outbox_ && inbox_.has_dirty(); }

  // For the sessions of others: it changed one of this one's objects.
  void note_edit(const std::string& object, const std::string& editor, bool is_removed);
  std::vector<fs_report> reports();
  fs_client describe() const;
  std::vector<fs_report> own_reports() const;  // in its own frame, by bare names
  fs_report own_report(const std::string& name) const;  // NOT_FOUND

 private:
  struct Slot {
    std::string name;    // empty: free
    uint64_t after = 0;  // serial of the change that last set the pose
  };
  // An object that is not in the scene: being built, or refused.
  struct Absent {
    std::string name;
    fs_primitive primitive;
    fs_object_state state;
  };
  // All that is known of a slot.
  struct Kept {
    Slot slot;
    std::optional<Absent> absent;
    std::optional<std::string> editor;
    std::optional<uint64_t> awaited;
  };
  struct Upload {
    bool is_ready = false;
    Ref<const Shape> shape;
    Ref<const Curve> curve;
    fs_status status = FS_OK;  // why there is neither
    std::string text;
  };
  struct Message {
    wire::Header header;
    std::vector<std::byte> body;
    template <class T>
    const T& as() const { return *reinterpret_cast<const T*>(body.data()); }  // its size was checked
  };
  // Changes that belong together: a group, or one.
  struct Unit {
    std::vector<Message> messages;
    std::set<uint32_t> slots;
    std::set<uint64_t> ids;  // shapes and curves that it needs, or forgets
    bool is_about_all = false, is_about_view = false, is_forget = false;
  };
  // What parked units hold up.
  struct Held {
    std::set<uint32_t> slots;
    std::set<uint64_t> ids;
    std::set<std::string> names;  // a client that has removed an object may give its slot and its name to others
    size_t all = 0, view = 0, messages = 0;
    void add(const Unit& unit, const std::vector<Slot>& present);
    bool blocks(const Unit& unit) const;
  };
  struct Sync {
    uint64_t serial;
    bool has_begun;  // it does with the next turn
    uint64_t own;    // sequence wanted of the servo's own scene, and those of the clients
    std::vector<std::pair<std::weak_ptr<const Session>, uint64_t>> wanted;
  };

  void handle(Message&& message, Descriptor&& data);
  void greet(const Message& message);
  void answer(fs_status status, const std::string& text, std::span<const std::byte> rest = {},
              std::span<const int> descriptors = {});
  void take_upload(Message&& message, Descriptor&& data);
  void finish_upload(uint64_t id, Upload&& upload) noexcept;
  void finish_job() noexcept;
  void regulate() noexcept;
  void submit(Unit&& unit);
  void tell_settled() noexcept;
  bool is_ready(const Unit& unit) const;
  void retry_parked();
  void apply(const Unit& unit);
  void apply(const Message& message);
  void apply_set(const wire::Set& set, uint64_t serial, bool is_change);
  void free_slot(uint32_t slot);
  Kept keep(uint32_t slot) const;
  void note_absent(const wire::Set& set, fs_object_state state);
  void refuse(const Message& message, fs_status status, const std::string& text);
  void take_moves();
  fs_object resolve(const wire::Object& record, uint32_t parts, const fs_object* target) const;
  wire::Object offer(const fs_object& object);

  void request(const Message& message);
  void edit(const Message& message);
  void tell_edit(LocalScene& scene, Session* owner, const std::string& name, bool is_removed);
  void pull(const Message& message);
  void fetch(const Message& message);
  void settle_syncs();
  void reply(uint64_t serial, std::span<const std::byte> body = {}, int descriptor = -1);
  void reply_failure(uint64_t serial, fs_status status, const std::string& text);
  void send_reply(uint64_t serial, fs_status status, const std::string& text, std::span<const std::byte> body,
                  int descriptor);
  // The scene and object that "client/object" means. NOT_FOUND, INVALID.
  LocalScene& target(const wire::Target& name, bool is_to_change, Session*& owner, std::string& object) const;

  void push_event(const fs_event& event) noexcept;
  void mark(uint32_t slot) noexcept { dirty_[slot / 64] |= uint64_t{1} << (slot % 64); }

  fs_server& server_;
  const uint64_t id_;
  Descriptor socket_, process_;
  const Peer peer_;
  const fs_status refusal_;
  const double since_;
  double connected_ = 0;  // s, scene's clock
  std::string name_;
  bool is_gone_ = false, is_reading_ = true;
  bool is_applying_ = false;  // a group: others have their turns meanwhile

  Ref<LocalScene> scene_;
  Ref<Channel> channel_;
  std::shared_ptr<void> inbox_memory_;
  Inbox inbox_;
  std::shared_ptr<Outbox> outbox_;

  std::vector<Slot> slots_;
  NameMap<uint32_t> slot_of_;
  std::map<uint32_t, Absent> absent_;  // by slot
  std::vector<uint64_t> dirty_;  // a bit each slot: there is a move to be looked at
  std::vector<std::pair<uint32_t, wire::Move>> moved_;
  uint64_t last_serial_ = 0;
  Unit unit_;  // that is coming in
  std::deque<Unit> parked_;  // until shapes are built
  Held held_;
  std::map<uint64_t, Upload> uploads_;  // by the client's number
  std::set<uint64_t> refused_uploads_;  // that the client has not been told of
  unsigned jobs_ = 0;  // of the worker, that are not done
  const std::shared_ptr<std::atomic<uint64_t>> shape_bytes_ = std::make_shared<std::atomic<uint64_t>>(0);
  std::vector<Message> waiting_edits_;
  std::map<uint64_t, std::pair<Ref<const Shape>, Ref<const Curve>>> offered_;  // by the server's number
  std::map<uint32_t, std::string> edited_;  // slots, and by whom
  uint64_t edits_told_ = 0;
  std::map<uint32_t, uint64_t> awaited_;  // slots that no tick has used yet, with the sequence; 0: not posted so far
  std::vector<Sync> syncs_;
  std::optional<std::pair<fs_status, std::string>> first_refused_;
  uint64_t moves_ = 0, changes_ = 0, refused_ = 0;
};

}  // namespace fs
