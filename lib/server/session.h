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

#include "base/error.h"
#include "base/name_map.h"
#include "ipc/socket.h"
#include "transfer/records.h"
#include "transfer/shared_memory.h"
#include "server/allowance.h"
#include "server/server.h"

namespace fs {

class List;  // list.h

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

  // So many of the messages that are there, or as many as can be handled in a slice.
  void receive(int most) noexcept;
  // Whether the next message can be handled amid a long one of `busy`'s (null: amid nothing that is half done): it is short,
  // and not about busy's objects. `round`: in which it is not looked at again when it cannot.
  bool is_next_apart(const Session* busy, uint64_t round) noexcept;
  Usage& usage() noexcept { return usage_; }
  // What comes each period: takes the moves, and posts the changes to the servo.
  void turn(double now) noexcept;
  // Applies what has waited for shapes: where many changes wait, not after every shape but every few turns.
  void catch_up() noexcept;
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
  fs_client describe() const;
  fs_report own_report(const std::string& name) const;  // NOT_FOUND

 private:
  struct Slot {
    std::string name;    // of the object that is moved through it; empty: of none
    uint64_t after = 0;  // serial of the change that last set the pose
  };
  // An object that is not in the scene: being built, or refused.
  struct Absent {
    fs_primitive primitive;
    fs_object_state state;
  };
  // All that is known of a name, to be put back when a group is refused.
  struct Kept {
    std::optional<uint32_t> slot;  // none: there was no such object
    uint64_t after = 0;
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
  // A shape or curve of others that the client was told of.
  struct Offer {
    uint64_t number;  // the server's
    Ref<const Shape> shape;
    Ref<const Curve> curve;
  };
  struct Message {
    wire::Header header;
    std::span<const std::byte> body;
    std::shared_ptr<const void> memory;  // that the body lies in; nobody can change it any more
    template <class T>
    const T& as() const { return *reinterpret_cast<const T*>(body.data()); }  // its size was checked
  };
  // Changes that belong together: a group, or one.
  struct Unit {
    uint64_t serial = 0;
    std::vector<Message> messages;
    std::set<std::string, std::less<>> names;  // of objects; those of others with their client
    std::set<uint64_t> ids;  // shapes and curves that it needs, or forgets
    bool is_about_all = false, is_about_view = false, is_forget = false;
    bool is_mapped = false;  // its changes lie in a memory file, of which a process can have so many
  };
  // What parked units hold up.
  struct Held {
    std::set<std::string, std::less<>> names;
    std::set<uint64_t> ids;
    size_t all = 0, view = 0;
    size_t cost = 0;  // messages, or what comes to as much
    void add(const Unit& unit);
    bool blocks(const Unit& unit) const;
    bool has(const std::string& name) const { return all > 0 || names.contains(name); }
  };
  // Changes of another scene's objects that a group makes.
  struct Foreign {
    Foreign(std::shared_ptr<Session> the_owner, Ref<LocalScene> the_scene)
        : owner(std::move(the_owner)), scene(std::move(the_scene)), draft(scene->draft()) {}
    ~Foreign() { scene->discard(draft); }
    const std::shared_ptr<Session> owner;  // null: the server itself
    const Ref<LocalScene> scene;
    LocalScene::Draft draft;
    std::map<std::string, bool> names;  // of the objects; true: removed
  };
  struct Sync {
    uint64_t serial;
    bool has_begun;  // its targets are sampled at the next turn that has taken all moves
    uint64_t own;    // sequence wanted of the servo's own scene, and those of the clients
    std::vector<std::pair<std::weak_ptr<const Session>, uint64_t>> wanted;
  };

  void handle(Message&& message, Descriptor&& data);
  void greet(std::span<const std::byte> message);
  void answer(fs_status status, const std::string& text, std::span<const std::byte> rest = {},
              std::span<const int> descriptors = {});
  void take_upload(Message&& message, Descriptor&& data);
  void finish_upload(uint64_t id, Upload&& upload) noexcept;
  void finish_job() noexcept;
  void regulate() noexcept;
  void take_group(const Message& message, Descriptor&& data);
  bool add(Unit& unit, const Message& message) const;
  void submit(Unit&& unit);
  void tell_settled() noexcept;
  bool is_ready(const Unit& unit) const;
  void retry_parked();
  void apply(const Unit& unit);
  void apply_group(const Unit& unit);
  struct Applying;
  void let_others();
  template <class Map>
  void empty(Map& map);
  void let_go(Unit&& unit);
  void apply(const Message& message, uint64_t serial);
  void apply_set(const wire::Set& set, uint64_t serial, bool is_change);
  void change_foreign(Foreign& other, const Message& message, const std::string& name) const;
  void apply_foreign(const Message& message, std::map<const LocalScene*, Foreign>& foreign) const;
  void forget_object(const std::string& name);
  void bind(const std::string& name, uint32_t slot, uint64_t after);
  Kept keep(const std::string& name) const;
  void put_back(const std::string& name, const Kept& kept);
  void note_absent(const wire::Set& set, fs_object_state state);
  void refuse(const Unit& unit, const Message& failed, const Error& error);
  bool take_moves();  // false: a group of them is being written, all comes later
  fs_object resolve(const wire::Object& record, uint32_t parts, const fs_object* target) const;
  wire::Object offer(const fs_object& object);

  void request(const Message& message);
  void edit(const Message& message, Session*& owner, std::string& name);
  bool must_wait(const Message& message) const;
  void retry_requests();
  const Offer* find_offer(uint64_t number) const noexcept;  // null: it has been let go of
  void note_untold(const std::string& name);
  void tell_edit(LocalScene& scene, Session* owner, const std::string& name, bool is_removed);
  void pull(const Message& message);
  void tell_object(const std::string& name, wire::Pulled& out);
  void fetch(const Message& message);
  void tell_view(const Message& message);     // lists.cpp
  void tell_motions(const Message& message);
  void tell_list(uint64_t serial, const std::shared_ptr<List>& list);  // now, or when the worker has made it
  void tell_made(uint64_t serial, const List& list);
  void tell_reports(const Message& message);
  Session* find_client(const std::string& name) const;  // null: the server. NOT_FOUND
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
  bool is_applying_ = false;  // a group, amid which others have their turns
  bool is_amid_drafts_ = false;  // of other scenes: nobody changes them meanwhile
  Usage usage_{1e-3};  // s. Who comes anew does not come first
  uint64_t round_to_wait_ = 0;

  Ref<LocalScene> scene_;
  Ref<Channel> channel_;
  std::shared_ptr<void> inbox_memory_;
  Inbox inbox_;
  std::shared_ptr<Outbox> outbox_;

  std::map<std::string, uint32_t, std::less<>> objects_;  // that are in the scene, with their slot, or wire::no_slot
  std::vector<Slot> slots_;
  std::map<std::string, Absent, std::less<>> absent_;
  std::vector<uint64_t> dirty_;  // a bit each slot: there is a move to be looked at
  std::vector<std::pair<uint32_t, wire::Move>> moved_;
  Allowance moves_allowed_{256};  // each turn, about 40 us
  bool are_moves_taken_ = false;  // in this turn
  uint64_t last_serial_ = 0;
  size_t steps_ = 0;
  std::deque<Unit> parked_;  // until shapes are built
  Held held_;
  bool is_retry_due_ = false;  // something is there that parked changes wait for
  size_t turns_until_retry_ = 0;
  std::map<uint64_t, Upload> uploads_;  // by the client's number
  std::map<const void*, uint64_t> upload_of_;  // of a shape or curve that was made of one
  std::set<uint64_t> refused_uploads_;  // that the client has not been told of
  unsigned jobs_ = 0;  // of the worker, that are not done
  const std::shared_ptr<std::atomic<uint64_t>> shape_bytes_ = std::make_shared<std::atomic<uint64_t>>(0);
  std::vector<Message> waiting_requests_;  // changes of others' objects that wait for shapes, or behind parked ones
  std::deque<Offer> offered_;  // that the client can fetch or give to an object; the oldest first
  // What the client has to be told of: names, with whoever changed them, and its view.
  std::map<std::string, std::string, std::less<>> edited_;
  bool is_view_edited_ = false;
  uint64_t edits_told_ = 0;
  std::string awaited_next_;  // where the next turn goes on with them
  std::map<std::string, uint64_t, std::less<>> awaited_;  // names that no tick has used yet, with the sequence; 0: not posted
  std::vector<Sync> syncs_;
  std::optional<std::pair<fs_status, std::string>> first_refused_;
  uint64_t moves_ = 0, changes_ = 0, refused_ = 0;
};

}  // namespace fs
