#include "servo/channel.h"

#include "field/proxies.h"
#include "servo/guard.h"

namespace fs {
namespace {

// Visits of one search: more than for a hand that slides over a mesh of millions of triangles; about 25 us.
constexpr uint32_t most_visits = 640;
// A visit takes about 40 ns, so the searches of a tick take a quarter of its period at most; all of it in a tick in which solids
// that fade are first felt, as these may be evaluated four times (Proxies::feel).
constexpr double visits_a_second = 0.25 / 40e-9;
// Tests of ways among solids are not approximated, so they may take longer: two periods at most.
constexpr uint32_t ways_per_visit = 8;

}  // namespace

std::optional<std::string_view> Channel::Owner::site() const noexcept {
  const size_t at = name.rfind('@');
  return at == name.npos ? std::nullopt : std::optional(std::string_view(name).substr(at + 1));
}

Channel::Channel(ServoLink& servo, const Spread& spread, double period, Ref<LocalScene> scene, const Limits& limits,
                 bool starts_in, Owner owner)
    : scene_(std::move(scene)), limits_(limits), fade_(spread.fade), visits_(static_cast<uint32_t>(visits_a_second * period)),
      owner_(std::move(owner)), reader_(make_ref<Memory>(spread)) {
  hand_.state.pose = hand_.response.proxy = identity_pose();
  reader_.budget = budget_.get();
  scene_->readers.attach_servo(servo, reader_, starts_in);
}

void Channel::detach() noexcept {
  if (std::exchange(is_attached_, false)) scene_->readers.detach_servo(reader_);
}

void Channel::count_lost(const std::vector<Ref<Channel>>& present) {
  for (const Ref<Channel>& other : present) {
    const bool is_alike = other->owner_.user == owner_.user || other->owner_.name == owner_.name;
    const bool is_left = other->leaves_at_.load(std::memory_order_acquire) < never && !other->is_gone();
    if (is_left && is_alike && other->limits_.force < never) counted_.push_back(other->push_);
  }
}

Wrench Channel::wrench() const noexcept {
  Wrench out{};
  wrench_.read(out);
  return out;
}

void Channel::fetch(double now) noexcept {
  scene_->output->time.store(now, std::memory_order_release);
  reader_.mailbox.fetch();
  const Snapshot& snapshot = *reader_.mailbox.front().snapshot;
  reader_.memory->absorb(snapshot, now);
  reader_.memory->advance(snapshot, now);
  const double left = now - leaves_at_.load(std::memory_order_acquire);
  if (left > 0) {
    weight_ = Weight::moved(weight_, false, Weight::part_of_fade(std::fmin(left, now - newest_time_), fade_));
  }
  newest_time_ = now;
}

// state: of the hand, or where the clutch holds the tool; scene frame.
fs_response Channel::evaluate_view(const Snapshot& snapshot, uint32_t view, fs_state state, double weight, double now,
                                   Effort& effort, ImpactBudget& impacts) noexcept {
  fs_response sum{};
  sum.proxy = state.pose;
  if (!(weight > 0) || !make_unit_pose(state.pose)) return sum;
  const View& seen = snapshot.views->rows[view];
  ToolState tool = ToolState::at(state, *seen.tool, now, reader_.memory->spread.blend);
  tool.impacts = &impacts;
  tool.scale = seen.frame.scale;
  tool.force_scale = seen.frame.force_scale;
  sum = evaluate_near(reader_.mailbox.front().scratches, *reader_.memory, view, seen.version, *seen.tool, tool, &effort);
  scale(sum, weight);
  if (weight < 1 && sum.felt_count > 0) sum.flags |= FS_RESPONSE_FADING;
  return sum;
}

// A tool that the clutch takes comes to rest within 20 ms, and moves again as slowly: damping makes no step.
double Channel::part_that_moves(uint32_t view, uint64_t version, bool is_held, double now) noexcept {
  constexpr double stops_in = 0.02;  // s
  Moving& m = moving_[view];
  if (m.version != version) m = {version, is_held ? 0.0 : 1.0, now};
  m.part = Weight::moved(m.part, !is_held, (now - m.time) / stops_in);
  m.time = now;
  return m.part;
}

fs_response Channel::evaluate_views(const fs_state& hand, double now, ImpactBudget& impacts) noexcept {
  const Snapshot& snapshot = *reader_.mailbox.front().snapshot;
  const Views& views = *snapshot.views;
  fs_response here{}, device{};
  reader_.memory->begin_tick(now);
  Effort effort{.visits = visits_, .ways = ways_per_visit * visits_, .most = most_visits};
  // The newest view first: fs_scene_get_hand reports the hand in its frame; forces of older views are rotated into its axes.
  for (uint32_t k = 0; k < Views::size; ++k) {
    const uint32_t i = k == 0 ? views.newest : k - (k <= views.newest);
    const View& view = views.rows[i];
    if (view.version == 0) continue;
    const FoundView& found = reader_.memory->views.find(*snapshot.views, i, hand.pose);
    const double weight = reader_.memory->views.weight_at(i, view.version);
    if (k > 0 && !(weight > 0)) continue;
    fs_frame frame = view.frame;
    if (found.is_moved) frame.pose = found.frame;
    fs_state state = to_scene(frame, hand);
    if (k == 0) {
      hand_.state = state;
      if (view.is_held) hand_.state.flags |= FS_STATE_CLUTCHED;
      axes_ = frame.pose.orientation;
    }
    const double part = part_that_moves(i, view.version, found.is_held, now);
    if (found.is_held) state.pose = found.tool;
    state.twist = {part * state.twist.linear, part * state.twist.angular};
    fs_response response = evaluate_view(snapshot, i, state, weight, now, effort, impacts);
    if (k == 0) {
      here = response;
      device = to_device(frame, here);
      tick_ = {0, now, weight, view.version, state.pose, state.twist};
    } else {
      add(device, to_device(frame, response));
      turn(response, conjugate(axes_) * frame.pose.orientation);
      add(here, response);
    }
  }
  hand_.response = here;
  return device;
}

double clamp(fs_response& device, const Channel::Limits& most) noexcept {
  const double force = norm(device.wrench.force), torque = norm(device.wrench.torque);
  const double factor = std::fmin(force > most.force ? most.force / force : 1, torque > most.torque ? most.torque / torque : 1);
  if (!(factor < 1)) return 1;
  const Mat3 stiffness = device.stiffness;
  const Vec3 whole = device.wrench.force;
  scale(device, factor);
  if (force > most.force) device.stiffness = shortened(stiffness, whole, factor * force);
  return factor;
}

// Clamps to the limit of the client; a force that is not finite disables only this client.
void Channel::limit(fs_response& device) noexcept {
  const Wrench& w = device.wrench;
  if (!is_finite(w)) {
    is_bad_.store(true, std::memory_order_release);
    return;
  }
  Wrench lost{};
  for (const Ref<Push>& push : counted_) {
    if (push->is_over.load(std::memory_order_acquire)) continue;
    lost.force += push->wrench.force;
    lost.torque += push->wrench.torque;
  }
  const Limits most{std::fmax(0, limits_.force - norm(lost.force)), std::fmax(0, limits_.torque - norm(lost.torque))};
  is_limited_ = clamp(device, most) < 1;
}

fs_response Channel::evaluate(const fs_state& hand, double now, ImpactBudget& impacts) noexcept {
  fs_response device{};
  is_limited_ = false;
  if (!is_bad()) device = evaluate_views(hand, now, impacts);
  if (limits_.force < never) limit(device);
  if (weight_ < 1) {
    scale(device, weight_);
    scale(hand_.response, weight_);
    tick_.weight *= weight_;
  }
  if (is_bad()) {
    device = hand_.response = {};
    device.proxy = hand.pose;
    hand_.response.proxy = hand_.state.pose;
    tick_.weight = 0;
  }
  push_->wrench = device.wrench;
  return device;
}

void Channel::note_added(double part) noexcept {
  const Wrench& whole = push_->wrench;
  wrench_.write({part * whole.force, part * whole.torque});
  const bool pushes = !(whole.force == Vec3{} && whole.torque == Vec3{});
  if (!is_limited_ && !(part < 1 && pushes)) return;
  limited_.store(limited_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

void Channel::charge(double cost, double period) noexcept {
  constexpr int most = 10;  // ticks; the guard waits for twice as many
  slow_in_a_row_ = cost > period ? slow_in_a_row_ + 1 : 0;
  if (slow_in_a_row_ >= most) is_bad_.store(true, std::memory_order_release);
}

void Channel::forget_touches() noexcept {
  if (Proxies* const proxies = reader_.memory->proxies()) proxies->forget();
}

void Channel::lose_hand(double now, uint32_t flags) noexcept {
  push_->wrench = {};
  is_limited_ = false;
  note_added(1);  // the pose stays the last that is known
  hand_.state.flags = (hand_.state.flags & FS_STATE_CLUTCHED) | (flags & ~uint32_t{FS_STATE_READY});
  hand_.state.buttons = 0;
  hand_.state.twist = {};
  hand_.response = {};
  hand_.response.proxy = hand_.state.pose;
  tick_.time = now;
  tick_.weight = 0;
}

void Channel::publish(const Wrench& sent, uint32_t response_flags, uint64_t tick) noexcept {
  const Quat back = conjugate(axes_);
  hand_.sent = {rotate(back, sent.force), rotate(back, sent.torque)};
  hand_.response.flags |= response_flags;
  tick_.tick = tick;
  reader_.newest.write(tick_);
  ServoOutput& out = *scene_->output;
  out.hand.write(hand_);
  out.tick.store(tick, std::memory_order_release);
  out.used.store(reader_.mailbox.front().snapshot->sequence, std::memory_order_release);
  if (weight_ == 0) leave_at_once();
}

}  // namespace fs
