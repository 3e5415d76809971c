#include "field/frame.h"

namespace fs {

Pose to_scene(const fs_frame& frame, const Pose& hand) noexcept {
  const Quat back = conjugate(frame.pose.orientation);
  return {frame.scale * rotate(back, hand.position - frame.pose.position), back * hand.orientation};
}

fs_state to_scene(const fs_frame& frame, const fs_state& hand) noexcept {
  const Quat back = conjugate(frame.pose.orientation);
  fs_state out = hand;
  out.pose = to_scene(frame, hand.pose);
  out.twist.linear = frame.scale * rotate(back, hand.twist.linear);
  out.twist.angular = rotate(back, hand.twist.angular);
  return out;
}

fs_response to_device(const fs_frame& frame, const fs_response& response) noexcept {
  const Quat q = frame.pose.orientation;
  const Mat3 r = to_matrix(q);
  fs_response out = response;
  out.wrench.force = frame.force_scale * rotate(q, response.wrench.force);
  out.wrench.torque = (frame.force_scale / frame.scale) * rotate(q, response.wrench.torque);
  out.stiffness = (frame.force_scale * frame.scale) * (r * response.stiffness * transposed(r));
  out.proxy = frame.pose * Pose{(1 / frame.scale) * response.proxy.position, response.proxy.orientation};
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
