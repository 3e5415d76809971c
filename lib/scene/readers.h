// Who evaluates a scene: tools of the application, and the servo, which also has the scene's clock and device. They come
// and go here, and here the shapes are built that nobody needed before. Any thread; each call that is
// not [rt] takes the scene's lock for as long as it needs it.
#pragma once

#include <functional>
#include <mutex>

#include "scene/edits.h"
#include "scene/thread_groups.h"

namespace fs {

class Readers {
 public:
  Readers(std::mutex& mutex, EvaluatedScene& evaluated, ThreadGroups<OpenGroup>& groups)
      : mutex_(mutex), evaluated_(evaluated), groups_(groups) {}

  // The newest snapshot is in the mailbox when attach returns; detach when the reader reads no more.
  void attach(Reader& reader);
  void detach(Reader& reader) noexcept;
  // Calls f(snapshot, row of name; no_row: name is null) outside of the lock. NOT_FOUND.
  void with_snapshot(const char* name, const std::function<void(const Snapshot&, uint32_t)>& f);

  // A scene that nobody evaluates leaves meshes unbuilt, until it has a reader.
  void leave_unbuilt() noexcept { builds_shapes_ = is_built_ = false; }
  bool builds_shapes() const noexcept { return builds_shapes_; }

  // The servo. Attaching and detaching change the clock: stored times shift along, so ages stay; fades end.
  // starts_in: what is there is felt in full from the first tick on; else it fades in.
  void attach_servo(ServoLink& servo, ServoReader& reader, bool starts_in);  // STATE
  void detach_servo(ServoReader& reader) noexcept;
  bool has_servo() const noexcept { return has_servo_.load(std::memory_order_acquire); }                // [rt]
  fs_status get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept;  // [rt]
  void get_servo_stats(fs_servo_stats& out);                                                   // STATE
  void get_device_info(fs_device_info& out);                                                   // STATE
  std::vector<fs_recorded_tick> record(uint64_t after);                                        // STATE
  void set_enabled(bool enabled);                                                              // STATE

 private:
  void build_shapes();
  // Calls f(servo) under the lock. STATE, with the sentence if there is none; or it is a parent process's.
  template <class F>
  void with_servo(const char* sentence, F&& f);

  std::mutex& mutex_;  // the scene's
  EvaluatedScene& evaluated_;
  ThreadGroups<OpenGroup>& groups_;

  std::atomic<bool> has_servo_{false};
  std::atomic<uint32_t> servo_process_{0};  // this_process() where the servo was started

  std::atomic<bool> builds_shapes_{true};
  std::mutex building_mutex_;
  bool is_built_ = true;  // what was left unbuilt; under building_mutex_
};

}  // namespace fs
