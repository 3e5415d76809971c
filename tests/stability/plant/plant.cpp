#include "plant/plant.h"

#include <algorithm>
#include <cmath>

namespace stability {

using namespace scenes;

namespace {

constexpr int steps_per_period = 8;
constexpr double stick_speed = 0.2e-3;  // m/s

struct Matrix {
  double at[3][3];
};
Matrix product(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) c.at[i][j] += a.at[i][k] * b.at[k][j];
    }
  }
  return c;
}

// e^m: the Taylor series of m / 2^n, squared n times.
Matrix exponential(Matrix m) {
  double size = 0;
  for (const auto& row : m.at) size += std::fabs(row[0]) + std::fabs(row[1]) + std::fabs(row[2]);
  int halvings = 0;
  while (std::ldexp(size, -halvings) > 0.1) ++halvings;
  for (auto& row : m.at) {
    for (double& value : row) value = std::ldexp(value, -halvings);
  }
  Matrix sum{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, term = sum;
  for (int n = 1; n <= 12; ++n) {
    term = product(term, m);
    for (auto& row : term.at) {
      for (double& value : row) value /= n;
    }
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) sum.at[i][j] += term.at[i][j];
    }
  }
  for (int i = 0; i < halvings; ++i) sum = product(sum, sum);
  return sum;
}

void advance_axis(const Transition& t, double& x, double& v, double u) {
  const double old = x;
  x = t.xx * old + t.xv * v + t.xu * u;
  v = t.vx * old + t.vv * v + t.vu * u;
}

fs_vec3 shortened(fs_vec3 v, double most) {
  const double length = norm(v);
  return length > most ? (most / length) * v : v;
}

fs_vec3 rounded(fs_vec3 v, double to) {
  if (to == 0) return v;
  return {to * std::round(v.x / to), to * std::round(v.y / to), to * std::round(v.z / to)};
}

}  // namespace

Transition transition(double m, double b, double k, double t) {
  const Matrix e = exponential({{{0, t, 0}, {-k / m * t, -b / m * t, t / m}, {0, 0, 0}}});
  return {e.at[0][0], e.at[0][1], e.at[0][2], e.at[1][0], e.at[1][1], e.at[1][2]};
}

Plant::Plant(const DeviceModel& device, const HandModel& hand, double rate)
    : device_(device),
      step_length_(1 / (steps_per_period * rate)),
      stiffness_(hand.stiffness),
      grip_stiffness_(hand.grip_stiffness),
      delay_steps_(std::llround(device.delay / step_length_)),
      waiting_(static_cast<size_t>(delay_steps_) + 4) {
  move_ = transition(device.mass + hand.mass, device.damping + hand.damping, stiffness_, step_length_);
  turn_ = transition(device.wrist_inertia, device.wrist_damping + hand.grip_damping, grip_stiffness_, step_length_);
}

fs_vec3 Plant::measured() const { return rounded(x_, device_.encoder); }
fs_vec3 Plant::measured_rotation() const { return rounded(r_, device_.encoder > 0 ? device_.wrist_encoder : 0); }

void Plant::command(fs_vec3 force, fs_vec3 torque) {
  commanded_ = shortened(force, device_.force_max);
  const Command command{step_ + delay_steps_, commanded_, shortened(torque, device_.torque_max)};
  waiting_[(first_ + count_) % waiting_.size()] = command;
  if (count_ < waiting_.size()) {
    ++count_;
  } else {
    first_ = (first_ + 1) % waiting_.size();
  }
}

void Plant::advance(double time) {
  for (const int64_t end = std::llround(time / step_length_); step_ < end; ++step_) step();
}

void Plant::step() {
  while (count_ > 0 && waiting_[first_].step <= step_) {
    force_ = waiting_[first_].force;
    torque_ = waiting_[first_].torque;
    first_ = (first_ + 1) % waiting_.size();
    --count_;
  }
  move();
  if (device_.torque_max > 0) {
    advance_axis(turn_, r_.x, w_.x, torque_.x);
    advance_axis(turn_, r_.y, w_.y, torque_.y);
    advance_axis(turn_, r_.z, w_.z, torque_.z);
  }
}

void Plant::move() {
  if (is_held_by_stage) {
    v_ = (1 / step_length_) * (target - x_);
    x_ = target;
    return;
  }
  fs_vec3 load = force_ + push + stiffness_ * target;
  bool can_hold = false;
  if (device_.friction > 0) {
    const fs_vec3 to_balance = load - stiffness_ * x_;
    const double size = norm(to_balance), speed = norm(v_);
    can_hold = size <= device_.friction;
    if (speed >= stick_speed) {
      load = load - (device_.friction / speed) * v_;
    } else if (can_hold) {
      v_ = {};
      return;
    } else {
      load = load - (device_.friction / size) * to_balance;
    }
  }
  const fs_vec3 x = x_, v = v_;
  advance_axis(move_, x_.x, v_.x, load.x);
  advance_axis(move_, x_.y, v_.y, load.y);
  advance_axis(move_, x_.z, v_.z, load.z);
  if (can_hold && dot(v, v_) < 0) v_ = {};  // friction has stopped it within this step
  work_ += dot(force_, x_ - x);
}

}  // namespace stability
