// Where an object is: its pose at a time, and its twist from then on. The application gives both at 25 Hz or so; in
// between the servo extrapolates, never backwards and for a limited time.
#pragma once

#include <algorithm>
#include <initializer_list>

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

  bool is_moving(double t) const noexcept { return t >= time && t < time + horizon; }

  Pose at(double t) const noexcept {  // [rt]
    const double dt = used(t);
    return dt > 0 ? advanced(pose, twist, dt) : pose;
  }
  Vec3 position_at(double t) const noexcept {  // [rt] the position of at(t), which costs less
    return pose.position + used(t) * twist.linear;
  }

  // [rt] Velocity at time t of the point of the object that is at x, both in the parent's frame.
  Vec3 velocity(Vec3 x, const Pose& pose_now, double t) const noexcept {
    if (!is_moving(t)) return {};
    return twist.linear + cross(twist.angular, x - pose_now.position);
  }

 private:
  double used(double t) const noexcept { return std::clamp(t - time, 0.0, horizon); }  // s, of the twist
};

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
