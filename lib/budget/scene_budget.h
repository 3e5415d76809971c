// Bounds the slopes and the damping of a scene's objects, so that the loop of its servo can render their sum: works out the
// bounds of each object that the hand may feel soon (bounds.h), and has the servo evaluate the objects within them. An object
// out of reach keeps the bounds that it has. The servo's Budget (budget.h) calls this.
#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>
#include <string>

#include "base/name_map.h"
#include "budget/bounds.h"
#include "scene/local_scene.h"

namespace fs {

// The most that all objects of a scene which the hand may feel soon want together. The first values: nobody knows yet.
struct SceneWant {
  double stiffness = never;  // N/m of the loop; 0: there are none that want any
  bool has_damping = true;   // any of them has some
  bool operator==(const SceneWant&) const = default;
};

class SceneBudget final : public Counted<SceneBudget>, public BudgetLink {
 public:
  // reader: the servo's, whose link this is; it works while the scene has this reader.
  SceneBudget(Ref<LocalScene> scene, const ServoReader& reader);

  // Works the bounds out again, if they may have changed. limit: what the servo leaves to this scene. ahead: s, for which the
  // bounds must hold: until what the second call from now works out is in use. rest: s, the least time between two calculations
  // that changed or moving objects ask for, as each takes processor time. Returns false, and leaves the bounds as they are, if the hand
  // can reach nothing new within `ahead` and nothing has changed that cannot wait for `rest`. An object that is set between two
  // calls has the bounds of an object alone until the next. The bounds are worked out without the scene's lock, and entered
  // with it; those of many objects in portions, between which others have the lock. One thread at a time; not [rt].
  bool update(const DeviceLimit& limit, double ahead, double rest);

  SceneWant wanted() const noexcept {  // any thread
    return {wanted_.load(std::memory_order_relaxed), has_damping_.load(std::memory_order_relaxed)};
  }

  void take_max_stiffness() override;
  const std::shared_ptr<const Sharing>& sharing() const noexcept override { return sharing_; }

 private:
  bool is_at_work() const noexcept { return evaluated_.servo_reader() == &reader_; }
  void settle();
  Box reach_of_hand(const SceneLimit& scene, const DeviceLimit& limit, double time);
  bool is_due(const DeviceLimit& limit, double most, const Box& reach, const Box& within, double time, double rest) const;
  using Lock = std::unique_lock<std::mutex>;
  bool enter(const SceneBounds& all, const SceneLimit& limit, const Pace& pace, Lock& lock);
  bool give_way(Lock& lock);
  void note_wanted(double wanted) noexcept;
  struct Announcement;
  void note(const Object& object, double slope, double texture_part, double impact_lost, double to_device);
  static std::string text_of(const Announcement& told);
  void tell(double time);

  const Ref<LocalScene> scene_;
  const ServoReader& reader_;
  std::mutex& mutex_;  // the scene's
  EvaluatedScene& evaluated_;
  std::atomic<double> wanted_{never};
  std::atomic<bool> has_damping_{true};

  // What the last bounds were worked out for.
  struct Basis {
    uint64_t sequence = 0;  // of the snapshot; 0: there was none
    DeviceLimit limit;
    double most = 0;            // N/m, what the scene allows itself
    double time = -never;       // s
    bool is_moving = false;     // something moves by itself
    bool has_fading = false;    // something fades out that counts beside the others
    bool has_any = false;       // something is felt there
    Box within;                 // m, where the tool may be; empty: anywhere
    Box clear;                  // m, where nothing else is felt
  };
  Basis seen_;
  Pace next_pace(bool at_once);
  double exact_at_ = -never;    // s, when bounds were last entered exactly
  double rose_at_ = -never;     // s, when bounds were last allowed to become more
  bool is_rising_ = false;      // more is due than has been entered
  double hand_time_ = never;    // s, of the last tick that was read
  Vec3 hand_{};                 // m, where the tool was then
  double speed_ = 0;            // m/s, of the tool then
  // What the tool could reach in the last second: a box for each quarter of it, the newest first.
  static constexpr double been_for = 0.25;  // s
  std::array<Box, 5> been_;
  double been_since_ = -never;  // s, begin of the newest

  // What has been told of an object.
  struct Announcement {
    double slope;         // N/m at the device, what was told last; at first what it wanted
    double now;           // N/m, what is to be told
    double time;          // s, of the last event
    double wait;          // s, until another may follow
    double wanted;        // N/m
    bool takes_what_it_gets;
    double texture_part;  // of the heights of its texture
    double impact_lost;   // of its impact, what was told last,
    double impact_lost_now;  // and what is to be told
    bool is_told() const noexcept {
      return now >= 0.9 * slope && now <= 1.1 * slope && std::fabs(impact_lost_now - impact_lost) < 0.1;
    }
  };
  NameMap<Announcement> told_;
  size_t most_told_ = 1024;  // when there are more, those of objects that are gone are forgotten
  bool has_untold_ = false;
  double looked_at_ = -never;  // s, when it was last looked for what is to be told
  static constexpr int most_events = 20;  // a second
  int events_left_ = most_events;
  double events_since_ = -never;  // s
  std::shared_ptr<const Sharing> sharing_;  // those that get less than they want
};

}  // namespace fs
