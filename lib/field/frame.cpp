#include "field/frame.h"

namespace fs {

Vec3 to_scene(const fs_frame& frame, Vec3 at_device) noexcept { return frame.scale * to_local(frame.pose, at_device); }

Pose to_scene(const fs_frame& frame, const Pose& hand) noexcept {
  return {to_scene(frame, hand.position), conjugate(frame.pose.orientation) * hand.orientation};
}

fs_state to_scene(const fs_frame& frame, const fs_state& hand) noexcept {
  const Quat back = conjugate(frame.pose.orientation);
  fs_state out = hand;
  out.pose = to_scene(frame, hand.pose);
  out.twist.linear = frame.scale * rotate(back, hand.twist.linear);
  out.twist.angular = rotate(back, hand.twist.angular);
  return out;
}

Vec3 to_device(const fs_frame& frame, Vec3 in_scene) noexcept { return frame.pose * ((1 / frame.scale) * in_scene); }

Pose to_device(const fs_frame& frame, const Pose& pose) noexcept {
  return {to_device(frame, pose.position), frame.pose.orientation * pose.orientation};
}

Wrench to_device(const fs_frame& frame, const Wrench& wrench) noexcept {
  const Quat q = frame.pose.orientation;
  return {frame.force_scale * rotate(q, wrench.force), (frame.force_scale / frame.scale) * rotate(q, wrench.torque)};
}

fs_response to_device(const fs_frame& frame, const fs_response& response) noexcept {
  const Mat3 r = to_matrix(frame.pose.orientation);
  fs_response out = response;
  out.wrench = to_device(frame, response.wrench);
  out.stiffness = (frame.force_scale * frame.scale) * (r * response.stiffness * transposed(r));
  out.proxy = to_device(frame, response.proxy);
  out.error_bound = frame.force_scale * response.error_bound;
  return out;
}

void turn(fs_response& response, Quat q) noexcept {
  const Mat3 r = to_matrix(q);
  response.wrench = {rotate(q, response.wrench.force), rotate(q, response.wrench.torque)};
  response.stiffness = r * response.stiffness * transposed(r);
}

void scale(fs_response& response, double factor) noexcept {
  response.wrench = {factor * response.wrench.force, factor * response.wrench.torque};
  response.stiffness = factor * response.stiffness;
  response.error_bound *= factor;
}

void add(fs_response& sum, const fs_response& other) noexcept {
  sum.wrench.force += other.wrench.force;
  sum.wrench.torque += other.wrench.torque;
  sum.stiffness += other.stiffness;
  sum.felt_count += other.felt_count;
  sum.flags |= other.flags;
  sum.error_bound += other.error_bound;
}

}  // namespace fs
