// A scene at a server. It has a scene of its own in this process, the replica, which checks every change before it is
// sent, is what getters of its own objects look at, and what tools evaluate. Small and frequent is only fs_object_move:
// it goes through shared memory. Everything else is messages, and one change or a group of them takes the same way:
// into the replica's group, then all that may fail, then the replica's commit, then the messages.
#pragma once

#include <array>
#include <deque>
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

  // An object of this client at the server.
  struct Slot {
    uint32_t index = 0;              // of the inbox
    uint64_t after = 0;              // serial of the change that last set its pose
    bool has_lifetime = false;
    std::array<uint64_t, 3> data{};  // shape and curves that it uses, of those that the server has from this client
    // Moved, and the replica does not know yet.
    bool is_ahead = false;
    Movement movement;
    std::pair<const std::string, Slot>* next_ahead = nullptr;
  };
  using Slots = NameMap<Slot>;

  // A shape or curve that the server has from this client.
  struct Data {
    Ref<const Shape> shape;
    Ref<const Curve> curve;
    uint32_t uses = 0;
    bool is_refused = false;         // so the server has it not
  };

  // A change on its way: its record but for the slot, which it begins with where it is about an object.
  struct Change {
    wire::Type type;
    std::string name;                // of the object
    std::vector<std::byte> record;
    uint32_t parts = 0;              // of a set or change
    Ref<const Object> object;        // as it is then
  };
  struct Group {
    std::vector<Change> changes;
    std::set<std::string, std::less<>> fresh, gone;  // names that slots_ has not, and has no more
  };

  // What a server's record stands for, with its handles.
  struct Received {
    fs_object object;
    Ref<const Shape> shape;
    Ref<const Curve> front, back;
  };
  template <class T>
  using Fetched = std::deque<std::pair<uint64_t, Ref<const T>>>;  // by the server's number, the oldest first

  Lock enter(double* steady = nullptr) const;  // DISCONNECTED. steady: s, monotonic clock
  double now() const noexcept { return replica_->now(); }
  const char* own_name(const char* name) const noexcept;  // null: it is another client's
  void require_no_group() const;                          // STATE
  static wire::Target to_target(const char* name, const char* field);  // NOT_FOUND

  // ---- Own objects (remote_scene.cpp). All that follow want the lock.
  template <class F>
  void mutate(F&& f);
  void publish();
  void flush_ahead();
  fs_view own_view();  // lists.cpp

  // ---- Groups and how they are sent (sending.cpp).
  bool has(const Group& group, std::string_view name) const;
  void require_room(const Group& group, size_t objects, size_t changes = 1) const;  // FULL
  void add(Group& group, wire::Type type, const char* name, std::span<const std::byte> record = {}) const;
  void add_object(Group& group, wire::Type type, const char* name, uint32_t parts) const;
  void add_frame(Group& group) const;
  void add_tool(Group& group) const;
  void prepare(const Group& group);
  void transmit(Group& group) noexcept;
  void transmit_moves(const Group& group) noexcept;
  void send(Change& change, bool has_more);
  void make_slot(const std::string& name);
  Slots::iterator drop_slot(Slots::iterator slot);
  void note_object(Slot& slot, const Object* object);
  bool is_missing(uint64_t id) const;
  uint64_t upload(const Shape* shape);
  uint64_t upload(const Curve* curve);
  void upload(wire::Type type, uint64_t id, std::span<const std::byte> record, const Descriptor& content, Data data);
  void forget_unused();

  // ---- What others have done, and what they have (others.cpp).
  void pull();
  void catch_up(const char* name = nullptr);
  bool is_here(const wire::Object& record) const;
  void take_over(Slots::value_type& slot, const wire::Object& record);
  Received receive(const wire::Object& record);
  Ref<const Shape> receive_shape(uint64_t id);
  Ref<const Curve> receive_curve(uint64_t id);
  Ref<const Object> get_other(const char* name, fs_object& out);
  void change_other(const fs_object& object, uint32_t parts);
  void move_other(const char* name, const Pose& pose, const fs_twist* twist, double time);
  fs_report in_group(const fs_report& ours, const fs_report* theirs);
  bool take_event(fs_event& out);

  const std::string client_;
  mutable std::mutex mutex_;
  Connection connection_;
  const Ref<LocalScene> replica_;
  // A tool may look at the replica, so each move goes there too.
  std::atomic<bool> is_evaluated_here_{false};

  Slots slots_;
  std::set<uint32_t> free_indexes_;
  uint32_t indexes_end_ = 0;
  Slots::value_type* ahead_ = nullptr;  // the first of those that are
  std::unordered_map<uint64_t, Data> data_;  // by their serial in this process
  std::vector<uint64_t> maybe_unused_;
  std::unique_ptr<Group> group_;

  Fetched<Shape> fetched_shapes_;
  Fetched<Curve> fetched_curves_;
  std::set<std::string> behind_;  // that others have changed, and their mesh is not here yet
  uint64_t edits_seen_ = 0, events_read_ = 0;
  std::optional<uint64_t> pull_;  // serial of the one that has not been answered: what it brings is told once
  std::deque<uint64_t> syncs_;    // and those, the oldest first: each may bring a refusal
  bool is_end_told_ = false;
};

}  // namespace fs
