// Where an object is: its pose at a time, and its twist from then on. The application gives both at 25 Hz or so; in
// between the servo extrapolates, never backwards and for a limited time.
//
// A new motion says something else than the one before, of the place and of the velocity. A tool feels the difference at
// once. A servo spreads it over `blend` seconds: whoever posts the new motion stores with it how far, and how fast, the
// object was felt from where it says. This offset decays as a cubic in time, so that neither the place nor the velocity (of
// which damping makes a force) jumps, however fast motions come; and no older motion needs to be kept.
#pragma once

#include <algorithm>
#include <initializer_list>
#include <limits>

#include "math/pose.h"

namespace fs {

inline constexpr double extrapolation_limit = 0.1;   // s: a dead application must not go on driving a wall into the hand
inline constexpr double twist_memory = 0.2;          // s, most between two poses that a twist is worked out from
inline constexpr double same_instant = 1e-3;         // s: two poses closer in time count as one, the later

struct Motion {
  Pose pose = identity_pose();
  Twist twist{};
  double time = 0;     // s, when pose held
  double horizon = 0;  // s, how long the twist is used; 0: the object stands

  // What is left of the motion before.
  struct Offset {
    Vec3 way{}, drift{};  // m, at the beginning; and its velocity there times the blend
    Vec3 turn{}, spin{};  // rad, the same of the rotation: vectors along the parent's axes
    double begun = -std::numeric_limits<double>::infinity();  // s
  };
  Offset offset{};

  // blend: s, of who asks; 0: nothing is blended.
  bool has_offset(double t, double blend) const noexcept { return blend > 0 && t < offset.begun + blend; }  // [rt]

  Pose at(double t, double blend) const noexcept {  // [rt]
    const double dt = used(t, blend);
    Pose out = dt > 0 ? advanced(pose, twist, dt) : pose;
    if (has_offset(t, blend)) add_offset(t, blend, out);
    return out;
  }
  Vec3 position_at(double t, double blend) const noexcept {  // [rt] the position of at(), which costs less
    const Vec3 out = pose.position + used(t, blend) * twist.linear;
    return has_offset(t, blend) ? out + way_at(t, blend) : out;
  }
  // [rt] m: how far an offset can take the object from where its motion says.
  double most_offset() const noexcept { return norm(offset.way) + most_drift * norm(offset.drift); }
  double most_turn() const noexcept { return norm(offset.turn) + most_drift * norm(offset.spin); }  // [rt] rad

  Twist twist_at(double t, double blend) const noexcept;  // [rt]
  // [rt] Velocity at time t of the point of the object that is at x, both in the parent's frame.
  Vec3 velocity(Vec3 x, const Pose& pose_now, double t, double blend) const noexcept {
    if (!is_moving(t, blend)) return {};
    const Twist now = twist_at(t, blend);
    return now.linear + cross(now.angular, x - pose_now.position);
  }

  // For whoever posts. The offset from here to where `before` is felt at time t.
  void go_on_from(const Motion& before, double t, double blend) noexcept;
  // Begins at t, when the motion is posted; it was worked out for the time of the call. Until then the object has gone on as
  // before. That is made up for up to a third of a blend; where a group's commit takes longer, a small step remains.
  void begin_offset(double t, double blend) noexcept;
  // m: how far a point of the object, `lever` m from its origin, would jump if this motion replaced `before` at time t at once.
  double jump_from(const Motion& before, double t, double blend, double lever) const noexcept;
  bool says_the_same(const Motion& other) const noexcept;  // but for offsets

 private:
  static constexpr double most_drift = 4.0 / 27;  // of a drift, within a blend

  bool is_moving(double t, double blend) const noexcept {
    return has_offset(t, blend) || (t >= time && t < time + horizon + rounding(blend));
  }
  // The end of the twist is rounded off from so long before the horizon until so long after it, s.
  double rounding(double blend) const noexcept { return 0.5 * std::min(blend, horizon); }
  double used(double t, double blend) const noexcept {  // s, of the twist
    const double dt = t - time, round = rounding(blend), over = dt - horizon + round;
    if (!(over > 0 && over < 2 * round)) return std::clamp(dt, 0.0, horizon);
    return std::clamp(dt - over * over / (4 * round), 0.0, horizon);
  }
  Vec3 way_at(double t, double blend) const noexcept;
  void add_offset(double t, double blend, Pose& out) const noexcept;
};

// Checks a motion that comes from outside, but for its offset. [rt] In place and without a sentence; false: it is none.
bool check_motion(Motion& motion) noexcept;
// The same with a sentence, where `of`, such as "motion.", goes before the name of the field. Throws INVALID.
Motion parse_motion(Motion motion, const char* of);

// The last poses that the application gave; twists are worked out from them.
struct Track {
  struct Sample {
    Pose pose = identity_pose();
    double time = 0;
    bool is_known = false;
  };
  Sample last;           // the newest of an instant
  Sample before, older;  // the newest of the two instants before it
  double instant = 0;    // s, when the present instant began

  // That of an object which has been set and not been moved since.
  static Track of(const Motion& motion) noexcept {
    Track track;
    track.last = {motion.pose, motion.time, true};
    track.instant = motion.time;
    return track;
  }

  // Takes a pose given at `time`. Without a twist one is worked out from the pose before. A pose older than the last one
  // has no twist.
  Motion take(const Pose& pose, const Twist* twist, double time) noexcept {
    const double since_last = last.is_known ? time - last.time : 0;
    if (since_last < 0) before = older = {};
    if (!last.is_known || since_last < 0) instant = time;
    if (time - instant >= same_instant) {
      older = before;
      before = last;
      instant = time;
    }
    last.pose = pose;
    last.time = time;
    last.is_known = true;

    if (since_last < 0) return {pose, {}, time, 0};
    if (twist) return {pose, *twist, time, is_zero(*twist) ? 0 : extrapolation_limit};
    const Sample& from = time - before.time >= same_instant ? before : older;  // in a stream above 1 kHz
    const double dt = time - from.time;
    if (!from.is_known || !(dt >= same_instant && dt <= twist_memory)) return {pose, {}, time, 0};
    const Twist worked_out{(1 / dt) * (pose.position - from.pose.position),
                           (1 / dt) * log_rotation(pose.orientation * conjugate(from.pose.orientation))};
    if (!is_in_range(worked_out.linear)) return {pose, {}, time, 0};  // a jump, and no motion
    return {pose, worked_out, time, is_zero(worked_out) ? 0 : std::min(extrapolation_limit, 2 * dt)};
  }

  void shift(double by) noexcept {
    for (double* time : {&last.time, &before.time, &older.time, &instant}) *time += by;
  }

  static bool is_zero(const Twist& t) noexcept { return t.linear == Vec3{} && t.angular == Vec3{}; }
};

}  // namespace fs
