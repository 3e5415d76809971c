// A scene whose objects are evaluated in this process. Every change takes one way, wherever it comes from: check, table,
// snapshot, mailbox. All functions but those marked [rt] may allocate and take the scene's lock; none waits on a reader.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.h"
#include "base/name_map.h"
#include "ipc/servo_output.h"
#include "scene/scene.h"
#include "scene/snapshot.h"

namespace fs {

// The servo of a scene, as far as the scene needs it.
class ServoLink {
 public:
  virtual void get_stats(fs_servo_stats& out) const = 0;        // all but struct_size
  virtual void get_device_info(fs_device_info& out) const = 0;  // all but struct_size
  virtual bool take_event(fs_event& out) = 0;                   // of the device; false: none
  const double fade;  // s; 0: no fades
  const ClockKind clock;
  const double since;  // s, of its newest tick when the scene came to it
  Reader reader;

 protected:
  ServoLink(double the_fade, ClockKind the_clock, double the_time, unsigned reader_id)
      : fade(the_fade), clock(the_clock), since(the_time), reader{reader_id, {}} {}
  ~ServoLink() = default;
};

// [rt] What fs_scene_get_hand gives. Null: not asked.
fs_status read_hand(const ServoOutput& output, fs_state* state, fs_response* response, fs_wrench* sent) noexcept;

void prepare_curves(const Object& object, unsigned reader);

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

  // An object's motion as it is (as an open group has it), and set as another process has worked it out: good numbers.
  Movement movement(const char* name) const;
  void set_movement(const char* name, const Movement& movement);
  void set_motion(const char* name, const Motion& motion);  // a move whose twist has been worked out

  // Groups.
  void begin() override;
  void commit() override;
  // The same by steps of at most `most` objects; true: done. Between them nothing else changes or posts the scene.
  bool commit(size_t most);
  void cancel() override;
  void sync(double timeout) override;

  // Changes of objects that are there, by somebody else, kept apart until they are taken all at once; beside an open group,
  // which is the application's. What another change has brought meanwhile stays, but for the parts that are changed.
  class Draft;
  Draft draft();
  void change(Draft& draft, const fs_object& object, uint32_t parts);  // its shape is built
  void move(Draft& draft, const char* name, const fs_pose& pose, const fs_twist* twist, double time);
  void remove(Draft& draft, const char* name);
  Ref<const Object> get(const Draft& draft, const char* name, fs_object& out);
  void take(Draft& draft);
  void discard(Draft& draft) noexcept;  // in any case at the end

  // How many objects it holds at most, those still fading out included.
  void set_capacity(uint32_t capacity);

  // Held, changes are collected, and reach the readers only with post().
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
  double now() const noexcept { return now(clock_.load(std::memory_order_relaxed)); }  // [rt]
  double now(ClockKind clock) const noexcept;                                          // [rt]
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
  // Calls f(snapshot, slot of name; -1: name is null) outside of the lock.
  void with_snapshot(const char* name, const std::function<void(const Snapshot&, int64_t)>& f);
  // A scene that nobody evaluates leaves meshes unbuilt, until it has a reader.
  void leave_unbuilt() noexcept { builds_shapes_ = is_built_ = false; }

  // The servo. Attaching and detaching change the clock: stored times shift along, so ages stay; fades end.
  void attach_servo(ServoLink& servo);  // STATE
  void detach_servo(ServoLink& servo) noexcept;
  bool has_servo() const noexcept { return has_servo_.load(std::memory_order_acquire); }  // [rt]
  fs_status get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept override;  // [rt]
  void get_servo_stats(fs_servo_stats& out) override;                                     // STATE
  void get_device_info(fs_device_info& out) override;                                     // STATE
  std::vector<fs_client> clients() override;                                              // UNSUPPORTED

  const std::shared_ptr<ServoOutput> output;

 private:
  // A wish for the view: what is not given stays.
  struct ViewChange {
    std::optional<fs_frame> frame;
    std::optional<std::vector<Vec3>> points;
    std::optional<bool> held;
  };
  // An open group works on a table of its own, which at first is the scene's. What fades, and from where, is decided when
  // it is committed: until then evaluation goes on with the scene's table, and its fades with it.
  struct Group {
    Table<Entry> table;
    std::map<uint32_t, bool> touched;  // slots; true: more than moved
    std::optional<uint32_t> committed;  // up to this one
    ViewChange view;
  };

  struct InDraft;

  // All of these want the lock.
  const Table<Entry>& working() const { return group_ ? group_->table : table_; }
  const Entry* find(std::string_view name, uint32_t& slot) const;  // also what is fading out
  const Entry& require(const char* name, uint32_t& slot) const;    // NOT_FOUND
  uint32_t free_slot() const;                                          // FULL
  void admit(const ParsedObject& parsed, uint32_t parts);
  void move_entry(uint32_t slot, const Entry& old, const fs_pose& pose, const fs_twist* twist, double time);
  void remove_entry(uint32_t slot, const Entry& old);
  void put(uint32_t slot, Ref<Entry> entry, bool is_more_than_moved);
  Ref<const Entry> transit(const Entry* felt, const Entry& wanted);
  void store(uint32_t slot, Ref<const Entry> entry);
  fs_frame present_frame() const;
  const std::vector<Vec3>& present_tool() const;
  void change_view(ViewChange change);
  void transit_view(const ViewChange& change);
  void replace_view(Ref<const View> view, bool in);
  Fade turned(const Fade& fade, bool in, double expiry);
  Ref<const Snapshot> newest();
  void changed();
  void settle(bool is_urgent);
  bool tidy(double time);
  void announce_expired(double time);
  void prepare_all_curves(unsigned reader) const;
  void build_shapes();
  void retime(double shift);
  void switch_clock(ClockKind clock);
  fs_object to_c(const Entry& entry) const;
  // What a report needs of the scene.
  struct ReportBasis {
    double time;     // s
    double fade;     // s, the servo's; negative: there is no servo
    uint64_t tick;   // the last
    fs_frame frame;
  };
  ReportBasis report_basis() const;
  // evaluated: the entry as it is felt; null: it is not yet. Needs no lock.
  static fs_report make_report(const Entry& entry, const Entry* evaluated, const ReportBasis& basis);
  void push_event(const fs_event& event);
  void limit_events();
  void collect_events(ServoLink& servo);
  void forget_new_names();

  // Runs f, which changes the scene, and makes it known.
  template <class F>
  void mutate(F&& f) {
    const std::lock_guard lock(mutex_);
    settle(false);
    if (!spare_) spare_ = make_ref<Snapshot>();  // so that nothing can fail after the change
    try {
      f();
    } catch (...) {
      if (!posted_) changed();  // what was taken back goes out again
      throw;
    }
    if (!group_) changed();
  }

  mutable std::mutex mutex_;
  Table<Entry> table_;  // what is evaluated
  NameMap<uint32_t> slots_;         // of names, also of those fading out
  std::set<uint32_t> free_slots_;
  uint32_t slots_end_ = 0, capacity_ = Table<Entry>::capacity;
  std::set<std::pair<double, uint32_t>> tidies_;    // when to look at slots where something fades out
  std::set<std::pair<double, uint32_t>> expiries_;  // to be announced
  ViewFade views_{make_ref<View>(), nullptr};
  std::unique_ptr<Group> group_;

  uint64_t sequence_ = 0;
  Ref<const Snapshot> posted_;      // the newest; null: something has changed since
  Ref<Snapshot> spare_;             // for the next
  Ref<const Epoch> pending_epoch_;  // of the fades since the last snapshot
  Ref<const Epoch> open_epoch_;     // of a snapshot that the servo has not fetched, as far as is known
  std::vector<Reader*> readers_;
  double settled_at_ = -never;

  ServoLink* servo_ = nullptr;
  std::atomic<bool> has_servo_{false};
  std::atomic<ClockKind> clock_{ClockKind::caller};
  std::atomic<double> told_time_{std::numeric_limits<double>::quiet_NaN()};

  bool is_held_ = false;
  std::atomic<bool> builds_shapes_{true};
  std::mutex building_mutex_;
  bool is_built_ = true;  // what was left unbuilt; under building_mutex_

  std::deque<fs_event> events_;
  uint64_t lost_events_ = 0;
};

class LocalScene::Draft {
  friend LocalScene;
  std::unique_ptr<Group> group_;
  std::map<uint32_t, uint32_t> parts_;  // that are changed, by slot
};

}  // namespace fs
