// A scene whose objects are evaluated in this process: a lock around what is evaluated (EvaluatedScene), what is wanted of it
// (Edits) and who evaluates it (Readers). Every change takes the same way: check, edit, rows, snapshot, mailbox. Functions
// that are not marked [rt] may allocate and take the lock; none waits for a reader.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "scene/evaluated_scene.h"
#include "scene/readers.h"
#include "scene/scene.h"

namespace fs {

// How an object moves, with what the next worked-out twist needs.
struct Movement {
  Motion motion;
  Track track;
};

struct LocalScene final : Scene {
  // output: where the servo publishes its results; null: memory of the scene's own. clock: for a replica, whose servo is
  // in another process.
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
  Ref<const Object> get(const char* name, fs_object& out, bool with_group);
  Contents contents() override;
  void set_contents(const std::vector<fs_object>& objects, const fs_frame& frame, const std::vector<Vec3>& tool,
                    double tool_radius) override;

  // The motion of an object, as the thread's group has it; and the motion that another process has worked out, to be set
  // without a check.
  Movement movement(const char* name);
  void set_movement(const char* name, const Movement& movement);  // at once, past the thread's group. NOT_FOUND
  void set_motion(const std::string& name, const Motion& motion);  // NOT_FOUND
  // Sets several motions at once, past the thread's group. Returns how many of the objects exist.
  struct Move {
    const std::string* name;
    NameId* id;  // of the name, as far as it is known; it is known then
    Motion motion;
  };
  size_t set_motions(const std::vector<Move>& moves);

  // Groups. Changes and getters see the group of the calling thread, if it has one open.
  void begin() override;
  void commit() override;
  void check_commit();  // whether others have changed what the thread's group cannot be together with. UNSUPPORTED
  void cancel() override;
  void sync(double timeout) override;

  // The most objects that the scene can hold, including those that fade out.
  void set_capacity(uint32_t capacity);

  // After hold() changes reach the readers only with post().
  void hold();
  void post();
  uint64_t sequence() const;  // of the newest snapshot that was posted

  // Frame, clutch, tool, accuracy, slope.
  void set_frame(const fs_frame& frame) override;
  fs_frame get_frame(const char* client) override;
  void set_clutch(bool held) override;
  void set_tool(const Vec3* points, size_t count) override;
  std::vector<Vec3> get_tool() override;
  void set_tool_radius(double radius) override;
  double get_tool_radius() override;
  fs_view view(const char* client) override;
  fs_view view(bool with_group);  // as the thread's group has it, or as it is evaluated
  void set_accuracy(double newtons) override;
  void set_max_stiffness(double stiffness) override;

  // Clock, s.
  double now() const noexcept { return evaluated_.clock.now(); }                      // [rt]
  double now(ClockKind clock) const noexcept { return evaluated_.clock.now(clock); }  // [rt]
  fs_status get_time(double& out) const noexcept override;                             // [rt]
  fs_status set_time(double time) noexcept override;                                   // [rt]

  // Reports and events.
  std::vector<fs_report> reports() override;
  fs_report report(const char* name) override;
  fs_report report(const char* name, bool with_group);
  std::vector<fs_motion> motions(const char* client) override;
  std::vector<fs_motion> motions_since(const char* client, uint64_t since) override;
  fs_event next_event(double timeout) override;
  bool take_event(fs_event& out);  // one that is there; false: none
  void note(fs_event event) noexcept;  // what the server tells its own scene, now; left out where there is no memory
  size_t object_count();
  bool is_empty() const;  // nothing is there, nor fading out

  // The servo.
  fs_status get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept override;  // [rt]
  void get_servo_stats(fs_servo_stats& out) override;                                     // STATE
  void get_device_info(fs_device_info& out) override;                                     // STATE
  std::vector<fs_recorded_tick> record(uint64_t after) override;                          // STATE
  void stop_force() override;                                                             // STATE
  void resume_force() override;                                                           // STATE
  std::vector<fs_client> clients() override;                                              // UNSUPPORTED
  std::vector<fs_client_view> views() override;                                           // UNSUPPORTED

 private:
  friend class SceneGroup;
  friend class Moment;
  friend class SceneBudget;

  // Called with the lock held.
  Edits edits() { return {evaluated_, groups_.mine()}; }
  void require_group(const char* function) const;  // of the calling thread. STATE
  void put(Edits edits, const ParsedObject& object, uint32_t parts, bool is_change);
  // Runs f(edits), which changes the scene, and makes the change known.
  template <class F>
  void mutate(F&& f, bool joins_group = true) {
    const std::lock_guard lock(mutex_);
    evaluated_.prepare();
    try {
      f(Edits(evaluated_, joins_group ? groups_.mine() : nullptr));
    } catch (...) {  // a part may be done
      evaluated_.changed();
      throw;
    }
    if (!joins_group || !groups_.mine()) evaluated_.changed();  // f may have closed the group
  }

  mutable std::mutex mutex_;
  EvaluatedScene evaluated_;
  ThreadGroups<OpenGroup> groups_;
  double max_stiffness_ = 0;  // N/m at the device, what the scene allows itself; 0: no such bound

 public:
  Readers readers{mutex_, evaluated_, groups_};
  const std::shared_ptr<ServoOutput>& output = evaluated_.output;
};

}  // namespace fs
