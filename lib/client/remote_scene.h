// A scene at a server. It has a scene of its own in this process, the replica, which checks every change before it is
// sent, is what getters of its own objects look at, and what tools evaluate. fs_object_move goes through shared
// memory. Every other change is a message, and a group of changes is one message: into the replica's group, then the
// message, then the replica's commit. So the server has all of a change or nothing of it.
//
// The server may refuse a change, and others may change this client's objects. Then the server counts up
// Outbox::edits, and the client asks (pull) name by name what there is now. A change that the client made after it
// asked is newer than the answer: that name is asked again.
#pragma once

#include <array>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "base/name_map.h"
#include "client/connection.h"
#include "scene/local_scene.h"
#include "transfer/asset.h"
#include "transfer/records.h"

namespace fs {

struct RemoteScene final : Scene {
  // client: a good name. NOT_FOUND, EXISTS, VERSION, DENIED, FULL, TIMEOUT, IO.
  RemoteScene(const Endpoint& endpoint, const std::string& client);

  void close() noexcept override { connection_.shut(); }
  LocalScene& local() override;
  bool is_remote() const noexcept override { return true; }

  // Objects. A name with '/' is another client's, unless it is this one's.
  void set(const fs_object& object) override;
  void change(const fs_object& object, uint32_t parts) override;
  void move(const char* name, const fs_pose& pose, const fs_twist* twist, double time) override;
  void remove(const char* name) override;
  void clear() override;
  Ref<const Object> get(const char* name, fs_object& out) override;
  Contents contents() override;
  void set_contents(const std::vector<fs_object>& objects, const fs_frame& frame,
                    const std::vector<Vec3>& tool) override;

  void begin() override;
  void commit() override;
  void cancel() override;
  void sync(double timeout) override;

  void set_frame(const fs_frame& frame) override;
  fs_frame get_frame(const char* client) override;
  void set_clutch(bool held) override;
  void set_tool(const Vec3* points, size_t count) override;
  std::vector<Vec3> get_tool() override;
  fs_view view(const char* client) override;
  void set_accuracy(double newtons) override;
  void set_max_stiffness(double stiffness) override;

  fs_status get_time(double& out) const noexcept override;
  fs_status set_time(double time) noexcept override;

  std::vector<fs_report> reports() override;
  fs_report report(const char* name) override;
  std::vector<fs_motion> motions(const char* client) override;
  fs_event next_event(double timeout) override;

  fs_status get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept override;
  void get_servo_stats(fs_servo_stats& out) override;
  void get_device_info(fs_device_info& out) override;
  std::vector<fs_client> clients() override;

 private:
  using Lock = std::unique_lock<std::mutex>;
  static constexpr const char* no_memory_text = "there was no memory in the middle of a change: the server is given up";
  static constexpr int most_tries = 4;  // to get an object that others change again and again

  // A call that is under way. It has the lock, but for the times in which it waits for the server.
  struct Call {
    Lock lock;
    double limit;  // s, that it waits at most
    double end;    // s, monotonic clock: then it waits no longer
  };

  // An object of this client at the server.
  struct Slot {
    uint32_t index = wire::no_slot;  // of the inbox; no_slot: there is none for it, so it is moved by messages
    uint64_t after = 0;              // serial of the change that last set its pose
    bool has_lifetime = false;
    bool is_refused = false;         // the server has it not: it is here alone
    std::array<uint64_t, 3> data{};  // shape and curves that it uses, of those that the server has from this client
    // Moved, and the replica does not know yet.
    bool is_ahead = false;
    Movement movement;
    std::pair<const std::string, Slot>* next_ahead = nullptr;
    uint64_t moved_in = 0;           // the newest question at its last move
  };
  using Slots = NameMap<Slot>;

  // A shape or curve that the server has from this client.
  struct Data {
    Ref<const Shape> shape;
    Ref<const Curve> curve;
    uint32_t uses = 0;
    bool is_refused = false;         // so the server has it not
  };

  // A change on its way: its record but for the slot, which a set begins with.
  struct Change {
    wire::Type type;
    std::string name;                // of the object
    std::vector<std::byte> record;
    uint32_t parts = 0;              // of a set, change or edit
    Ref<const Object> object;        // as it is then
  };
  // Another client's object, as the group has it.
  struct Other {
    fs_object object;
    Ref<const Object> kept;          // null: removed
  };
  struct Group {
    std::vector<Change> changes;
    // Names that the changes speak of; true: there is such an object then.
    std::map<std::string, bool, std::less<>> names;
    ptrdiff_t more_names = 0, more_objects = 0;  // than there were; what was refused is a name, but no object
    std::map<std::string, Other, std::less<>> others;
  };

  // What a server's record stands for, with its handles.
  struct Received {
    fs_object object;
    Ref<const Shape> shape;
    Ref<const Curve> front, back;
    void link();
  };
  template <class T>
  using Fetched = std::deque<std::pair<uint64_t, Ref<const T>>>;  // by the server's number, the oldest first

  Call enter(double* steady = nullptr) const;  // DISCONNECTED. steady: s, monotonic clock
  double now() const noexcept { return replica_->now(); }
  const char* own_name(const char* name) const noexcept;  // null: it is another client's
  static wire::Target to_target(const char* name, const char* field);  // NOT_FOUND

  // ---- Own objects (remote_scene.cpp). All that follow want the lock; those with a Call may wait without it.
  template <class F>
  void mutate(Call& call, F&& f);
  void publish();
  void flush_ahead();
  fs_view own_view(Call& call);  // lists.cpp

  // ---- Groups and how they are sent (sending.cpp).
  bool has(const Group& group, std::string_view name) const;
  bool is_object(const Group& group, std::string_view name) const;
  void note_name(Group& group, const std::string& name, bool is_there) const;
  void require_room(const Group& group, size_t objects, size_t changes = 1) const;  // FULL
  void add(Group& group, wire::Type type, const char* name, std::span<const std::byte> record = {}) const;
  void add_object(Group& group, wire::Type type, const char* name, uint32_t parts) const;
  void add_frame(Group& group) const;
  void add_tool(Group& group) const;
  bool deliver(Group& group);
  bool may_be_written(const Group& group) const;
  void write_moves(const Group& group) noexcept;
  class SlotNumbers;
  uint64_t send(Group& group);
  void note_sent(const Group& group, uint64_t serial) noexcept;
  uint32_t take_index() noexcept;
  void set_taken(uint32_t index, bool is_taken) noexcept;
  void release_index(Slot& slot) noexcept;
  Slots::iterator drop_slot(Slots::iterator slot);
  void note_object(Slot& slot, const Object* object);
  void note_refused(Slot& slot, bool is_refused) noexcept;
  bool is_missing(uint64_t id) const;
  bool upload(const Shape* shape);
  bool upload(const Curve* curve);
  bool upload(wire::Type type, uint64_t id, std::span<const std::byte> record, const Descriptor& content, Data data);
  bool has_room_for_data() const;
  bool upload_parts(const Object& object, uint32_t parts);
  void forget_unused();

  // ---- What is asked of the server (asking.cpp).
  bool try_pause(Call& call, bool is_for_room);  // false: its time is over
  void pause(Call& call, bool is_for_room);      // TIMEOUT
  Answer request(Call& call, wire::Type type, std::span<const std::byte> body = {});
  struct Asking;
  void end_question() noexcept;
  bool is_current() const noexcept;
  void look();
  bool start_pull();
  void catch_up(Call& call, const char* name = nullptr);
  void fetch_behind(Call& call, const std::string& name);
  void touch(const Change& change);
  bool is_touched(std::string_view name, uint64_t question) const;
  void adopt(const wire::Pulled& pulled, uint64_t question);
  bool is_here(const wire::Object& record) const;
  Ref<const Shape> find_shape(uint64_t id) const;
  Ref<const Curve> find_curve(uint64_t id) const;
  void take_over(const wire::Pulled& pulled, const Received& received, uint64_t question);
  Received receive(Call& call, const wire::Object& record);
  Answer fetch(Call& call, uint64_t id);
  Ref<const Shape> receive_shape(Call& call, uint64_t id);
  Ref<const Curve> receive_curve(Call& call, uint64_t id);

  // ---- Other clients and what they have (others.cpp).
  Ref<const Object> get_other(Call& call, const char* name, fs_object& out);
  void change_other(Call& call, const fs_object& object, uint32_t parts);
  void move_other(Call& call, const char* name, const Pose& pose, const fs_twist* twist, double time);
  void remove_other(Call& call, const char* name);
  Other& join_group(Call& call, const char* name);
  fs_report in_group(const fs_report& ours, const fs_report* theirs);
  bool take_event(fs_event& out);

  const std::string client_;
  mutable std::mutex mutex_;
  Connection connection_;
  const Ref<LocalScene> replica_;
  // A tool may look at the replica, so each move goes there too.
  std::atomic<bool> is_evaluated_here_{false};

  Slots slots_;
  size_t refused_count_ = 0;  // of slots_
  std::vector<bool> taken_;  // slots of the inbox, by number
  size_t first_free_ = 0;    // all before it are taken
  Slots::value_type* ahead_ = nullptr;  // the first of those that are
  std::unordered_map<uint64_t, Data> data_;  // by their serial in this process
  std::map<uint64_t, uint64_t> maybe_unused_;  // of data_, with the serial of the message after which they may be
  std::unique_ptr<Group> group_;

  Fetched<Shape> fetched_shapes_;
  Fetched<Curve> fetched_curves_;
  std::set<std::string, std::less<>> behind_;  // of which the server may have something else than the replica
  uint64_t edits_seen_ = 0;
  EventReader events_;
  std::optional<uint64_t> pull_;        // serial of the one that has not been answered: what it brings is told once
  std::optional<wire::Pulled> pulled_;  // its answer, until the replica has it
  // Questions about objects are numbered. While one is open: names that were changed since, with the newest question then.
  // An answer is out of date where the name was changed in its own question or in a later one.
  uint64_t question_ = 0, pull_question_ = 0;
  unsigned open_questions_ = 0;
  std::map<std::string, uint64_t, std::less<>> touched_;
  uint64_t all_touched_ = 0;            // the newest question at the last clear
  std::deque<uint64_t> syncs_;    // serials of those not answered, the oldest first: each may bring a refusal
  bool is_end_told_ = false;
};

}  // namespace fs
