// A scene as it is evaluated: its objects, where its tool stands, its clock, its events, and the readers that evaluate it.
// A change reaches the readers as a snapshot, through the mailbox of each. Every call needs the scene's lock, except for
// those of the clock; none waits for a reader.
#pragma once

#include <memory>
#include <mutex>

#include "scene/clock.h"
#include "scene/events.h"
#include "scene/objects.h"
#include "scene/view_rows.h"

namespace fs {

// A snapshot that somebody looks at without the lock, and lets go of with it, as all do who post.
struct KeptSnapshot {
  std::mutex& mutex;  // the scene's
  Ref<const Snapshot> snapshot;

  explicit KeptSnapshot(std::mutex& the_mutex) : mutex(the_mutex) {}
  KeptSnapshot(const KeptSnapshot&) = delete;
  KeptSnapshot& operator=(const KeptSnapshot&) = delete;
  ~KeptSnapshot() {
    const std::lock_guard lock(mutex);
    snapshot = nullptr;
  }
};

class EvaluatedScene {
 public:
  EvaluatedScene(std::shared_ptr<ServoOutput> output, ClockKind clock);

  const std::shared_ptr<ServoOutput> output;
  Clock clock;
  Objects objects;
  ViewRows views;
  Events events;

  // A change to objects or views is made between prepare, which makes room for a snapshot, and changed, which posts one.
  void prepare();
  void changed();
  void hold() noexcept { is_held_ = true; }  // from now on changes reach the readers only with post
  void post();
  Ref<const Snapshot> post_newest();         // posts what has changed; the newest snapshot
  uint64_t sequence() const noexcept { return sequence_; }  // of the newest snapshot
  bool is_held() const noexcept { return is_held_; }
  const Ref<const Snapshot>& newest() const noexcept { return posted_; }  // null: something has changed since

  // Lets go of what has faded out, and announces what has expired. Not urgent: at most every 5 ms.
  void settle(bool is_urgent);
  void settle_all();      // all of it, where settle does some at a time
  void collect_events();  // of the device

  // The newest snapshot is in the mailbox when attach returns; detach when the reader reads no more.
  void attach(Reader& reader);
  void detach(Reader& reader) noexcept;

  // A servo brings a clock of its own: stored times are shifted, so ages stay, and fades end. Both return the shift, s.
  // starts_in: what is there is felt in full from the first tick on; else it fades in.
  double attach_servo(ServoLink& servo, ServoReader& reader, bool starts_in);  // STATE: it has one
  double detach_servo(ServoReader& reader) noexcept;
  ServoLink* servo() const noexcept { return servo_; }                // null: there is none
  const ServoReader* servo_reader() const noexcept { return servo_reader_; }  // null: there is none

 private:
  struct TimeShift;
  TimeShift retimed(double shift) const;
  void take(TimeShift& retimed, double shift) noexcept;

  uint64_t sequence_ = 0;
  Ref<const Snapshot> posted_;  // the newest; null: something has changed since
  Ref<Snapshot> spare_;         // for the next
  bool is_held_ = false;
  double settled_at_ = -never;  // s

  ServoLink* servo_ = nullptr;
  ServoReader* servo_reader_ = nullptr;
};

}  // namespace fs
