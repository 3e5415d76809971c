#include "servo/channel.h"

#include "servo/servo.h"

namespace fs {

Channel::Channel(fs_servo& servo, Ref<LocalScene> scene, const Limits& limits)
    : ServoLink(servo.fade(), servo.clock(), servo.time(), servo.reader_id()),
      servo_(servo),
      scene_(std::move(scene)),
      limits_(limits),
      events_read_(std::max<uint64_t>(servo.event_count(), 1) - 1) {  // the last one tells how the device is
  hand_.state.pose = hand_.response.proxy = identity_pose();
  scene_->attach_servo(*this);
}

void Channel::detach() noexcept {
  if (std::exchange(is_attached_, false)) scene_->detach_servo(*this);
}

Wrench Channel::wrench() const noexcept {
  Wrench out{};
  wrench_.read(out);
  return out;
}

void Channel::get_stats(fs_servo_stats& out) const { servo_.get_stats(out); }
void Channel::get_device_info(fs_device_info& out) const { servo_.get_device_info(out); }
bool Channel::take_event(fs_event& out) { return servo_.take_event(events_read_, out); }

fs_state to_scene(const fs_frame& frame, const fs_state& hand) noexcept {
  const Quat back = conjugate(frame.pose.orientation);
  fs_state out = hand;
  out.pose.position = frame.scale * rotate(back, hand.pose.position - frame.pose.position);
  out.pose.orientation = back * hand.pose.orientation;
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

void add(fs_response& sum, const fs_response& other) noexcept {
  sum.wrench.force += other.wrench.force;
  sum.wrench.torque += other.wrench.torque;
  sum.stiffness += other.stiffness;
  sum.felt_count += other.felt_count;
  sum.flags |= other.flags;
  sum.error_bound += other.error_bound;
}

namespace {

// [rt] What a view needs from its first tick: where the tool is held, or where the frame goes so that it does not jump.
void use_first_time(const View& view, const fs_state& hand) noexcept {
  Pose found;
  if (view.kind == View::Kind::free || view.found.read(found)) return;
  if (view.kind == View::Kind::held) {
    view.found.write(to_scene(view.frame, hand).pose);
  } else if (view.anchor->found.read(found)) {
    const Quat q = view.frame.pose.orientation;
    view.found.write({hand.pose.position - rotate(q, (1 / view.frame.scale) * found.position), q});
  }
}

void scale(fs_response& response, double factor) noexcept {
  response.wrench = {factor * response.wrench.force, factor * response.wrench.torque};
  response.stiffness = factor * response.stiffness;
  response.error_bound *= factor;
}

}  // namespace

void Channel::fetch(double now) noexcept {
  scene_->output->time.store(now, std::memory_order_release);
  if (!reader.mailbox.fetch()) return;
  const Ref<const Epoch>& epoch = reader.mailbox.front()->epoch;
  if (epoch) epoch->stamp(now);
}

fs_response Channel::evaluate_view(const Snapshot& snapshot, const View& view, double weight, bool is_current,
                                   const fs_state& hand, double now, uint64_t tick) noexcept {
  fs_response sum{};
  use_first_time(view, hand);
  fs_frame frame;
  if (!view.get_frame(frame)) return sum;
  fs_state state = to_scene(frame, hand);
  if (is_current) {
    hand_.state = state;
    if (view.kind == View::Kind::held) hand_.state.flags |= FS_STATE_CLUTCHED;
    axes_ = frame.pose.orientation;
  }
  if (view.kind == View::Kind::held) {
    view.found.read(state.pose);
    state.twist = {};
  }
  sum.proxy = state.pose;
  if (!(weight > 0) || !make_unit_pose(state.pose)) return sum;

  const ToolState tool =
      ToolState::at(state, view.points.data(), view.points.size(), now, reader.id);
  Share share;
  snapshot.objects.for_each([&](uint32_t, const Entry& entry) {
    const double own = weight * entry.fade.weight(now, fade);
    if (own > 0 && evaluate_object(*entry.object, entry.motion, entry.start, tool, share)) {
      add_share(sum, share, own);
      if (is_current) {
        entry.felt->sample.write({tick, share.distance, share.point,
                                  {own * share.wrench.force, own * share.wrench.torque}});
      }
    }
    if (!entry.previous) return;
    const Entry& previous = *entry.previous;
    const double rest = weight * previous.fade.weight(now, fade);
    if (rest > 0 && evaluate_object(*previous.object, previous.motion, previous.start, tool, share)) {
      add_share(sum, share, rest);
    }
  });
  return sum;
}

fs_response Channel::evaluate_views(const fs_state& hand, double now, uint64_t tick) noexcept {
  const Snapshot& snapshot = *reader.mailbox.front();
  const ViewFade& views = snapshot.views;
  fs_frame frame;

  fs_response here = evaluate_view(snapshot, *views.view, views.fade.weight(now, fade), true, hand, now, tick);
  views.view->get_frame(frame);
  fs_response device = to_device(frame, here);

  const double rest = views.previous ? views.previous_fade.weight(now, fade) : 0;
  if (rest > 0) {
    const fs_response before = evaluate_view(snapshot, *views.previous, rest, false, hand, now, tick);
    views.previous->get_frame(frame);
    add(device, to_device(frame, before));
    fs_response turned = before;  // along the present view's axes
    const Quat q = conjugate(axes_) * frame.pose.orientation;
    const Mat3 r = to_matrix(q);
    turned.wrench = {rotate(q, before.wrench.force), rotate(q, before.wrench.torque)};
    turned.stiffness = r * before.stiffness * transposed(r);
    add(here, turned);
  }
  hand_.response = here;
  return device;
}

// One client can neither push harder than it may nor, by a number that is none, take the others' forces with it.
void Channel::limit(fs_response& device) noexcept {
  const Wrench& w = device.wrench;
  if (!is_finite(w)) {
    is_bad_.store(true, std::memory_order_release);
    return;
  }
  const double force = norm(w.force), torque = norm(w.torque);
  const double share = std::fmin(force > limits_.force ? limits_.force / force : 1,
                                 torque > limits_.torque ? limits_.torque / torque : 1);
  if (!(share < 1)) return;
  scale(device, share);
  limited_.store(limited_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

fs_response Channel::evaluate(const fs_state& hand, double now, uint64_t tick) noexcept {
  fs_response device{};
  if (!is_bad()) device = evaluate_views(hand, now, tick);
  if (limits_.force < never) limit(device);
  const double left = now - leaves_at_.load(std::memory_order_acquire);
  if (left > 0) {
    const double weight = fade > 0 ? std::fmax(0, 1 - left / fade) : 0;
    scale(device, weight);
    scale(hand_.response, weight);
  }
  if (is_bad()) {
    device = hand_.response = {};
    device.proxy = hand.pose;
    hand_.response.proxy = hand_.state.pose;
  }
  wrench_.write(device.wrench);
  return device;
}

void Channel::charge(double cost, double period) noexcept {
  constexpr int most = 10;  // ticks; the guard waits for twice as many
  slow_in_a_row_ = cost > period ? slow_in_a_row_ + 1 : 0;
  if (slow_in_a_row_ >= most) is_bad_.store(true, std::memory_order_release);
}

void Channel::lose_hand() noexcept {
  wrench_.write({});
  hand_.state.flags &= FS_STATE_CLUTCHED;  // the pose stays the last that is known
  hand_.state.buttons = 0;
  hand_.state.twist = {};
  hand_.response = {};
  hand_.response.proxy = hand_.state.pose;
}

void Channel::publish(const Wrench& sent, uint32_t response_flags, uint64_t tick) noexcept {
  const Quat back = conjugate(axes_);
  hand_.sent = {rotate(back, sent.force), rotate(back, sent.torque)};
  hand_.response.flags |= response_flags;
  ServoOutput& out = *scene_->output;
  out.hand.write(hand_);
  out.tick.store(tick, std::memory_order_release);
  out.used.store(reader.mailbox.front()->sequence, std::memory_order_release);
}

}  // namespace fs
