// A scene whose objects are evaluated in this process. Every change takes the same way: check, rows, snapshot, mailbox.
// Functions that are not marked [rt] may allocate and take the scene's lock; none waits for a reader.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "scene/clock.h"
#include "scene/events.h"
#include "scene/open_group.h"
#include "scene/scene.h"

namespace fs {

// [rt] What fs_scene_get_hand gives. Null: not asked.
fs_status read_hand(const ServoOutput& output, fs_state* state, fs_response* response, fs_wrench* sent) noexcept;

// Throw INVALID: unless they are 1..32 points within bounds; for a field out of its range.
void check_tool(const Vec3* points, size_t count);
fs_frame parse_frame(const fs_frame& frame);
void check_timeout(double timeout);
void check_accuracy(double newtons);
void check_max_stiffness(double stiffness);
void require_no_client(const char* client);  // NOT_FOUND: it is not null

// How an object moves, with what the next worked-out twist needs.
struct Movement {
  Motion motion;
  Track track;
};

struct LocalScene final : Scene {
  // output: where a servo leaves its word; null: memory of the scene's own. clock: of a scene that has no servo here, but
  // stands for one whose servo writes output elsewhere.
  explicit LocalScene(std::shared_ptr<ServoOutput> output = nullptr, ClockKind clock = ClockKind::caller);

  LocalScene& local() noexcept override { return *this; }
  bool is_remote() const noexcept override { return false; }

  // Objects.
  void set(const fs_object& object) override;
  void change(const fs_object& object, uint32_t parts) override;
  void move(const char* name, const fs_pose& pose, const fs_twist* twist, double time) override;
  void remove(const char* name) override;
  void clear() override;
  Ref<const Object> get(const char* name, fs_object& out) override;
  Contents contents() override;
  void set_contents(const std::vector<fs_object>& objects, const fs_frame& frame,
                    const std::vector<Vec3>& tool) override;

  // The motion of an object, as an open group has it; and the motion that another process has worked out, to be set
  // without a check.
  Movement movement(const char* name) const;
  void set_movement(const char* name, const Movement& movement);
  // Sets several motions at once. Returns how many of the objects exist.
  struct Move {
    const std::string* name;
    Motion motion;
  };
  size_t set_motions(const std::vector<Move>& moves);
  void set_motion(const std::string& name, const Motion& motion);  // NOT_FOUND

  // Groups.
  void begin() override;
  void commit() override;
  // The same in steps of at most `most` objects; true: done. Between the steps nobody may change or post the scene.
  bool commit(size_t most);
  void cancel() override;
  void sync(double timeout) override;

  // A draft collects changes that somebody else makes to existing objects, until take applies all of them at once. It is
  // independent of the application's open group. take changes only the parts that the draft has changed.
  class Draft;
  Draft draft();
  void change(Draft& draft, const fs_object& object, uint32_t parts);  // its shape is built
  void move(Draft& draft, const char* name, const fs_pose& pose, const fs_twist* twist, double time);
  void remove(Draft& draft, const char* name);
  Ref<const Object> get(const Draft& draft, const char* name, fs_object& out);
  void take(Draft& draft);
  void discard(Draft& draft) noexcept;  // must be called at the end in any case

  // The most objects that the scene can hold, including those that fade out.
  void set_capacity(uint32_t capacity);

  // After hold() changes reach the readers only with post().
  void hold();
  void post();
  uint64_t sequence() const;  // of the newest change

  // Frame, clutch, tool, accuracy, slope.
  void set_frame(const fs_frame& frame) override;
  fs_frame get_frame(const char* client) override;
  void set_clutch(bool held) override;
  void set_tool(const Vec3* points, size_t count) override;
  std::vector<Vec3> get_tool() override;
  fs_view view(const char* client) override;
  fs_view view(bool with_group) const;  // as an open group has it, or as it is evaluated
  void set_accuracy(double newtons) override;
  void set_max_stiffness(double stiffness) override;

  // Clock, s.
  double now() const noexcept { return clock_.now(); }                                // [rt]
  double now(ClockKind clock) const noexcept { return clock_.now(clock); }            // [rt]
  fs_status get_time(double& out) const noexcept override;                             // [rt]
  fs_status set_time(double time) noexcept override;                                   // [rt]

  // Reports and events.
  std::vector<fs_report> reports() override;
  fs_report report(const char* name) override;
  std::vector<fs_motion> motions(const char* client) override;
  class Moment;  // moment.h
  fs_event next_event(double timeout) override;
  bool take_event(fs_event& out);  // one that is there; false: none
  void note_edit(const char* name, const char* editor);  // another client changed or removed an object
  size_t object_count() const;
  bool is_empty() const;  // nothing is there, nor fading out

  // Readers. The newest snapshot is in the mailbox when attach returns; detach when the reader reads no more.
  void attach(Reader& reader);
  void detach(Reader& reader) noexcept;
  // Calls f(snapshot, row of name; no_row: name is null) outside of the lock.
  void with_snapshot(const char* name, const std::function<void(const Snapshot&, uint32_t)>& f);
  // A scene that nobody evaluates leaves meshes unbuilt, until it has a reader.
  void leave_unbuilt() noexcept { builds_shapes_ = is_built_ = false; }

  // The servo. Attaching and detaching change the clock: stored times shift along, so ages stay; fades end.
  // starts_in: what is there is felt in full from the first tick on; else it fades in.
  void attach_servo(const ServoLink& servo, ServoReader& reader, bool starts_in);  // STATE
  void detach_servo(ServoReader& reader) noexcept;
  bool has_servo() const noexcept { return has_servo_.load(std::memory_order_acquire); }  // [rt]
  fs_status get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept override;  // [rt]
  void get_servo_stats(fs_servo_stats& out) override;                                     // STATE
  void get_device_info(fs_device_info& out) override;                                     // STATE
  std::vector<fs_client> clients() override;                                              // UNSUPPORTED

  const std::shared_ptr<ServoOutput> output;

 private:
  // All of these want the lock.
  bool find(std::string_view name, Known& out) const;         // as an open group has it
  Known require(const char* name, std::string* key) const;    // NOT_FOUND
  void put(const std::string& name, Known& wanted, bool is_more_than_moved);
  void admit(const ParsedObject& parsed, uint32_t parts);
  void move_in_group(const char* name, const Pose& pose, const Twist* twist, double time);
  void remove_one(const char* name);
  void commit_one(const std::string& name, Known& wanted);
  void sort_group();
  template <class F>
  void for_each(F&& f) const;
  fs_frame present_frame() const;
  std::vector<Vec3> present_tool() const;
  void change_view(ViewChange change);
  Ref<const Snapshot> newest();
  void changed();
  void settle(bool is_urgent);
  void build_shapes();
  struct InDraft;
  struct Retimed;
  Retimed retimed(double shift) const;
  void take(Retimed& retimed, double shift) noexcept;

  // Runs f, which changes the scene, and makes it known.
  template <class F>
  void mutate(F&& f) {
    const std::lock_guard lock(mutex_);
    settle(false);
    if (!spare_) spare_ = make_ref<Snapshot>();  // so that nothing can fail after the change
    try {
      f();
    } catch (const std::bad_alloc&) {  // a part may be done
      changed();
      throw;
    }
    if (!group_) changed();
  }

  mutable std::mutex mutex_;
  Objects objects_;  // what is evaluated
  ViewRows views_;
  std::unique_ptr<OpenGroup> group_;
  Events events_;
  Clock clock_;

  uint64_t sequence_ = 0;
  Ref<const Snapshot> posted_;  // the newest; null: something has changed since
  Ref<Snapshot> spare_;         // for the next
  double settled_at_ = -never;

  const ServoLink* servo_ = nullptr;
  ServoReader* servo_reader_ = nullptr;
  std::atomic<bool> has_servo_{false};

  bool is_held_ = false;
  std::atomic<bool> builds_shapes_{true};
  std::mutex building_mutex_;
  bool is_built_ = true;  // what was left unbuilt; under building_mutex_
};

class LocalScene::Draft {
  friend LocalScene;
  std::unique_ptr<OpenGroup> group_;
};

}  // namespace fs
