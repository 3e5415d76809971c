// A channel gives the forces of one scene to the servo. It evaluates the scene's objects with their weights, through
// the scene's views (frame, tool, clutch), and rotates the result into device axes. A servo has one for each scene.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "budget/scene_budget.h"
#include "field/frame.h"
#include "field/impacts.h"
#include "scene/local_scene.h"

namespace fs {

class Channel final : public Counted<Channel> {
 public:
  // The most that this scene may add to the sum of all forces.
  struct Limits {
    double force = never, torque = never;  // N, N m
    bool operator==(const Limits&) const = default;
  };

  // The client that owns the scene.
  struct Owner {
    std::string name;
    uint32_t user;
    // Where it is: of "client@site" the text after the last '@', which may be empty. None: on this machine.
    std::optional<std::string_view> site() const noexcept;
  };
  // What a scene adds at this tick, before it is limited with others of its site; for those that count it to their own limits.
  struct Push : Counted<Push> {
    Wrench wrench{};                   // the servo's thread alone
    std::atomic<bool> is_over{false};  // the scene has faded out
  };

  // Attaches the scene to the servo, which must live as long as it is attached. spread, period: the servo's (s). starts_in: see
  // attach_servo. STATE.
  Channel(ServoLink& servo, const Spread& spread, double period, Ref<LocalScene> scene, const Limits& limits, bool starts_in,
          Owner owner);
  ~Channel() { detach(); }

  // Detaches the scene, once the servo evaluates it no longer. A second call does nothing.
  void detach() noexcept;

  LocalScene& scene() const noexcept { return *scene_; }
  const Ref<SceneBudget>& budget() const noexcept { return budget_; }
  const Owner& owner() const noexcept { return owner_; }
  const Limits& limits() const noexcept { return limits_; }

  // leave: from time `when` (s, scene's clock) on the whole scene fades out, for good. leave_at_once is for a scene
  // that adds nothing any more. Any thread.
  void leave(double when) noexcept { leaves_at_.store(when, std::memory_order_release); }
  void leave_at_once() noexcept { push_->is_over.store(true, std::memory_order_release); }
  void end_lease(double now) noexcept {  // leaves now, unless the scene is leaving already
    if (const double when = leaves_at_.load(std::memory_order_relaxed); when > now) leave(now);
  }
  // Whether the scene has faded out and adds nothing any more; a tick sets this. Any thread.
  bool is_gone() const noexcept { return push_->is_over.load(std::memory_order_acquire); }  // [rt]

  // What lost clients still push is taken off the limit of each that comes by the name or for the user of one of them, so that
  // coming again gains no force. Called once, before any tick knows this channel. The servo's channels are ticked in the order
  // in which they came.
  void count_lost(const std::vector<Ref<Channel>>& present);

  // Any thread.
  // The scene's force was not finite, or took too long to evaluate; from then on its force is zero.
  bool is_bad() const noexcept { return is_bad_.load(std::memory_order_acquire); }
  uint64_t limited() const noexcept { return limited_.load(std::memory_order_relaxed); }  // ticks
  Wrench wrench() const noexcept;                                                         // as added at the last tick

  // [rt] Takes the newest snapshot, and moves the weights to `now`.
  void fetch(double now) noexcept;

  // [rt] The scene's response for the hand (device frame), in device axes, within the limits.
  fs_response evaluate(const fs_state& hand, double now, ImpactBudget& impacts) noexcept;

  // [rt] After evaluate: this part of the response was added, 0..1.
  void note_added(double part) noexcept;

  // [rt] Reports the time that evaluate took, s. A scene that makes every tick late on its own is excluded before the
  // guard would stop the force of all scenes.
  void charge(double cost, double period) noexcept;

  // [rt] The hand may be anywhere: no solid holds it any more.
  void forget_touches() noexcept;

  // [rt] Called instead of evaluate when the device gave no pose. flags: FS_STATE_ bits that say why.
  void lose_hand(double now, uint32_t flags) noexcept;

  // [rt] Gives the results of this tick to the scene. response_flags: added by the guard. tick: the tick's number.
  void publish(const Wrench& sent, uint32_t response_flags, uint64_t tick) noexcept;

 private:
  fs_response evaluate_views(const fs_state& hand, double now, ImpactBudget& impacts) noexcept;
  fs_response evaluate_view(const Snapshot& snapshot, uint32_t view, fs_state state, double weight, double now, Effort& effort,
                            ImpactBudget& impacts) noexcept;
  double part_that_moves(uint32_t view, uint64_t version, bool is_held, double now) noexcept;
  void limit(fs_response& device) noexcept;

  const Ref<LocalScene> scene_;
  const Limits limits_;
  const double fade_;     // s
  const uint32_t visits_; // that the searches of a tick may take
  bool is_attached_ = true;
  const Owner owner_;
  std::atomic<double> leaves_at_{never};
  const Ref<Push> push_ = make_ref<Push>();
  std::vector<Ref<Push>> counted_;  // those of lost clients that count to the limits

  // Only the servo's thread uses these; other threads may read the atomic ones and wrench_.
  ServoReader reader_;
  const Ref<SceneBudget> budget_ = make_ref<SceneBudget>(scene_, reader_);
  double weight_ = 1;        // of the whole scene
  double newest_time_ = -never;  // s, of the newest tick
  HandSample hand_{};
  TickSample tick_{};
  struct Moving {  // how much of the hand's velocity a view's tool has
    uint64_t version = 0;
    double part = 1, time = 0;
  };
  std::array<Moving, Views::size> moving_;
  Quat axes_ = identity_quat();  // rotation from scene to device axes in the newest view
  std::atomic<bool> is_bad_{false};
  int slow_in_a_row_ = 0;
  bool is_limited_ = false;  // at this tick
  std::atomic<uint64_t> limited_{0};
  Latest<Wrench> wrench_;
};

// [rt] Shortens a response that pushes with more than the limits, and keeps its direction. Returns by which factor; 1: it does not.
double clamp(fs_response& device, const Channel::Limits& limits) noexcept;

}  // namespace fs
