// The force-objects of one application. It is the fs_scene of the C contract itself. Every change takes one way, wherever it
// comes from: check, table, snapshot, mailbox. All functions but those marked [rt] may allocate and take the scene's lock;
// none waits on a reader. They throw Error.
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
#include <unordered_map>
#include <vector>

#include <forceserver/servo.h>

#include "scene/snapshot.h"

namespace fs {

// The hand as the scene's servo last saw it, in the scene's frame.
struct HandSample {
  fs_state state;
  fs_response response;
  fs_wrench sent;
};

// What a servo tells the scene that it evaluates: written by its tick alone.
struct ServoOutput {
  std::atomic<double> time{0};    // s, of the newest tick: the clock of a virtual servo
  std::atomic<uint64_t> tick{0};  // the newest finished
  std::atomic<uint64_t> used{0};  // sequence of the snapshot it evaluated
  Latest<HandSample> hand;
};

// The servo of a scene, as far as the scene needs it.
class ServoLink {
 public:
  virtual void get_stats(fs_servo_stats& out) const = 0;        // all but struct_size
  virtual void get_device_info(fs_device_info& out) const = 0;  // all but struct_size
  virtual bool take_event(fs_event& out) = 0;                   // of the device; false: none
  double fade = 0;                                              // s; 0: no fades
  ClockKind clock = ClockKind::steady;
  Reader reader;

 protected:
  ~ServoLink() = default;
};

double steady_now() noexcept;  // [rt] s, the monotonic clock

void prepare_curves(const Object& object, unsigned reader);

// Throw INVALID: unless they are 1..32 points within bounds; for a field out of its range.
void check_tool(const Vec3* points, size_t count);
fs_frame parse_frame(const fs_frame& frame);
void check_timeout(double timeout);

}  // namespace fs

struct fs_scene : fs::Counted<fs_scene> {
  // Objects.
  void set(const fs_object& object);
  void change(const fs_object& object, uint32_t parts);
  void move(const char* name, const fs_pose& pose, const fs_twist* twist, double time);
  void remove(const char* name);
  void clear();
  // Fills out; its handles live as long as what is returned.
  fs::Ref<const fs::Object> get(const char* name, fs_object& out) const;

  // The whole of it, and all of it set at once.
  struct Contents {
    std::vector<fs_object> objects;
    fs_frame frame;
    std::vector<fs::Vec3> tool;
    std::vector<fs::Ref<const fs::Object>> owners;  // of the handles in objects
  };
  Contents contents() const;
  void set_contents(const std::vector<fs_object>& objects, const fs_frame& frame, const std::vector<fs::Vec3>& tool);

  // Groups.
  void begin();
  void commit();
  void cancel();
  void sync(double timeout) const;

  // Frame, clutch, tool.
  void set_frame(const fs_frame& frame);
  fs_frame get_frame() const;
  void set_clutch(bool held);
  void set_tool(const fs::Vec3* points, size_t count);
  std::vector<fs::Vec3> get_tool() const;

  // Clock, s.
  double now() const noexcept { return now(clock_.load(std::memory_order_relaxed)); }  // [rt]
  double now(fs::ClockKind clock) const noexcept;                                      // [rt]
  fs_status set_time(double time) noexcept;                                            // [rt]

  // Reports and events.
  std::vector<fs_report> reports() const;
  fs_report report(const char* name) const;
  fs_event next_event(double timeout);

  // Readers. The newest snapshot is in the mailbox when attach returns; detach when the reader reads no more.
  void attach(fs::Reader& reader);
  void detach(fs::Reader& reader) noexcept;
  // Calls f(snapshot, slot of name; -1: name is null) outside of the lock.
  void with_snapshot(const char* name, const std::function<void(const fs::Snapshot&, int64_t)>& f);

  // The servo. Attaching and detaching change the clock: stored times shift along, so ages stay; fades end.
  void attach_servo(fs::ServoLink& servo);  // STATE
  void detach_servo(fs::ServoLink& servo) noexcept;
  bool has_servo() const noexcept { return has_servo_.load(std::memory_order_acquire); }  // [rt]
  void get_servo_stats(fs_servo_stats& out) const;                                        // STATE
  void get_device_info(fs_device_info& out) const;                                        // STATE
  fs::ServoOutput output;

 private:
  struct NameHash {
    using is_transparent = void;
    size_t operator()(std::string_view name) const noexcept { return std::hash<std::string_view>()(name); }
  };
  // A wish for the view: what is not given stays.
  struct ViewChange {
    std::optional<fs_frame> frame;
    std::optional<std::vector<fs::Vec3>> points;
    std::optional<bool> held;
  };
  // An open group works on a table of its own, which at first is the scene's. What fades, and from where, is decided when
  // it is committed: until then evaluation goes on with the scene's table, and its fades with it.
  struct Group {
    fs::Table<fs::Entry> table;
    std::map<uint32_t, bool> touched;  // slots; true: more than moved
    ViewChange view;
  };

  // All of these want the lock.
  const fs::Table<fs::Entry>& working() const { return group_ ? group_->table : table_; }
  const fs::Entry* find(std::string_view name, uint32_t& slot) const;  // also what is fading out
  const fs::Entry& require(const char* name, uint32_t& slot) const;    // NOT_FOUND
  uint32_t free_slot() const;                                          // FULL
  void admit(const fs::ParsedObject& parsed, uint32_t parts);
  void move_entry(uint32_t slot, const fs::Entry& old, const fs_pose& pose, const fs_twist* twist, double time);
  void remove_entry(uint32_t slot, const fs::Entry& old);
  void put(uint32_t slot, fs::Ref<fs::Entry> entry, bool is_more_than_moved);
  fs::Ref<const fs::Entry> transit(const fs::Entry* felt, const fs::Entry& wanted);
  void store(uint32_t slot, fs::Ref<const fs::Entry> entry);
  fs_frame present_frame() const;
  const std::vector<fs::Vec3>& present_tool() const;
  void change_view(ViewChange change);
  void transit_view(const ViewChange& change);
  void replace_view(fs::Ref<const fs::View> view, bool in);
  fs::Fade turned(const fs::Fade& fade, bool in, double expiry);
  fs::Ref<const fs::Snapshot> newest();
  void changed();
  void settle(bool is_urgent);
  bool tidy(double time);
  void announce_expired(double time);
  void prepare_all_curves(unsigned reader) const;
  void retime(double shift);
  void switch_clock(fs::ClockKind clock);
  fs_object to_c(const fs::Entry& entry) const;
  fs_report make_report(uint32_t slot, const fs::Entry& entry, double now) const;
  void push_event(const fs_event& event);
  void limit_events();
  void collect_events(fs::ServoLink& servo);
  void forget_new_names();

  // Runs f, which changes the scene, and makes it known.
  template <class F>
  void mutate(F&& f) {
    const std::lock_guard lock(mutex_);
    settle(false);
    if (!spare_) spare_ = fs::make_ref<fs::Snapshot>();  // so that nothing can fail after the change
    try {
      f();
    } catch (...) {
      if (!posted_) changed();  // what was taken back goes out again
      throw;
    }
    if (!group_) changed();
  }

  mutable std::mutex mutex_;
  fs::Table<fs::Entry> table_;  // what is evaluated
  std::unordered_map<std::string, uint32_t, NameHash, std::equal_to<>> slots_;  // of names, also of those fading out
  std::set<uint32_t> free_slots_;
  uint32_t slots_end_ = 0;
  std::set<std::pair<double, uint32_t>> tidies_;    // when to look at slots where something fades out
  std::set<std::pair<double, uint32_t>> expiries_;  // to be announced
  uint64_t revision_ = 0;
  fs::ViewFade views_{fs::make_ref<fs::View>(), nullptr};
  std::unique_ptr<Group> group_;

  uint64_t sequence_ = 0;
  fs::Ref<const fs::Snapshot> posted_;      // the newest; null: something has changed since
  fs::Ref<fs::Snapshot> spare_;             // for the next
  fs::Ref<const fs::Epoch> pending_epoch_;  // of the fades since the last snapshot
  fs::Ref<const fs::Epoch> open_epoch_;     // of a snapshot that the servo has not fetched, as far as is known
  std::vector<fs::Reader*> readers_;
  double settled_at_ = -fs::never;

  fs::ServoLink* servo_ = nullptr;
  std::atomic<bool> has_servo_{false};
  std::atomic<fs::ClockKind> clock_{fs::ClockKind::caller};
  std::atomic<double> told_time_{std::numeric_limits<double>::quiet_NaN()};

  std::deque<fs_event> events_;
  uint64_t lost_events_ = 0;
};

namespace fs {
using Scene = fs_scene;
}
