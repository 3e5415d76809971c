#include "scene/evaluated_scene.h"

#include <algorithm>
#include <cmath>
#include <new>

#include "base/error.h"

namespace fs {

EvaluatedScene::EvaluatedScene(std::shared_ptr<ServoOutput> the_output, ClockKind kind)
    : output(std::move(the_output)), clock(*output, kind), objects(*output, clock), views(*output) {}

void EvaluatedScene::prepare() {
  settle(false);
  const View& view = views.now();
  const bool is_elsewhere = view.is_held || view.previous != no_row;
  objects.rows.set_hand(view.frame.scale,
                        is_elsewhere ? never : norm(view.tool->centre) + view.tool->radius + view.tool->point_radius);
  if (!spare_) spare_ = make_ref<Snapshot>();
}

void EvaluatedScene::changed() {
  posted_ = nullptr;
  if (!is_held_) post_newest();
}

Ref<const Snapshot> EvaluatedScene::post_newest() {
  if (posted_) return posted_;
  const Ref<Snapshot> made = spare_ ? std::move(spare_) : make_ref<Snapshot>();
  made->sequence = ++sequence_;
  objects.rows.begin_offsets();
  made->chunks = objects.rows.chunks();
  made->views = views.views();
  made->clock = clock.kind();
  made->omitted = objects.rows.omitted();
  objects.rows.set_next_sequence(sequence_ + 1);
  views.set_next_sequence(sequence_ + 1);
  for (Reader* const reader : objects.rows.readers()) reader->post(made);
  return posted_ = made;
}

void EvaluatedScene::post() {
  post_newest();
  for (Reader* const reader : objects.rows.readers()) reader->mailbox.tidy();
}

// Every call that changes something comes by here; that is often enough, because what has weight 0 costs a tick nothing.
void EvaluatedScene::settle(bool is_urgent) {
  const double time = clock.now();
  if (!is_urgent && std::fabs(time - settled_at_) < 5e-3) return;
  settled_at_ = time;
  double expiry;
  while (const std::string* const name = objects.next_expired(time, expiry)) events.push(FS_EVENT_EXPIRED, expiry, *name);
  const bool has_gone = views.tidy();
  if (servo_ && (objects.tidy() || has_gone)) changed();
}

void EvaluatedScene::settle_all() {
  for (size_t rest = objects.fading_count(); servo_ && rest > 0; rest -= std::min(rest, Objects::tidied_at_once)) {
    if (objects.tidy()) changed();
  }
}

void EvaluatedScene::collect_events() {
  if (servo_) events.collect(*servo_);
}

void EvaluatedScene::attach(Reader& reader) {
  const Ref<const Snapshot> snapshot = post_newest();
  objects.rows.attach(reader);
  reader.mailbox.prime({snapshot, reader.scratches});
}

void EvaluatedScene::detach(Reader& reader) noexcept { objects.rows.detach(reader); }

// The scene with every stored time shifted, and nothing fading.
struct EvaluatedScene::TimeShift {
  Objects::TimeShift objects;
  Ref<Views> views;
};

EvaluatedScene::TimeShift EvaluatedScene::retimed(double shift) const { return {objects.shifted(shift), views.settled()}; }

void EvaluatedScene::take(TimeShift& retimed, double shift) noexcept {
  objects.take(retimed.objects, shift);
  views.take(retimed.views);
  events.shift(shift);
  settled_at_ = -never;
  posted_ = nullptr;
}

double EvaluatedScene::attach_servo(ServoLink& servo, ServoReader& reader, bool starts_in) {
  if (servo_) fail(FS_ERROR_STATE, "scene has a servo already; stop it first");
  settle(true);
  output->time.store(servo.time());
  output->tick.store(0);
  output->used.store(0);
  HandSample hand{};
  hand.state.pose = hand.response.proxy = identity_pose();
  output->hand.write(hand);
  Clock::Before before;
  const double shift = clock.switch_to(servo.clock(), before);
  try {
    TimeShift all = retimed(shift);
    if (!spare_) spare_ = make_ref<Snapshot>();
    objects.rows.attach(reader);
    take(all, shift);  // nothing can fail from here on
  } catch (...) {
    objects.rows.detach(reader);
    clock.switch_back(before);
    throw;
  }
  objects.rows.start_servo(reader, starts_in, clock.now());
  views.attach_servo(reader);
  events.attach(servo);
  servo_ = &servo;
  servo_reader_ = &reader;
  reader.mailbox.prime({post_newest(), reader.scratches});
  return shift;
}

double EvaluatedScene::detach_servo(ServoReader& reader) noexcept {
  const ServoLink& servo = *std::exchange(servo_, nullptr);
  servo_reader_ = nullptr;
  Clock::Before before{ClockKind::caller, clock.now()};
  try {
    events.collect(servo);
    const double shift = clock.switch_to(ClockKind::caller, before);
    before = {ClockKind::caller, clock.now() - shift};  // should memory run out
    TimeShift all = retimed(shift);  // also where the clutch has moved the frame
    if (!spare_) spare_ = make_ref<Snapshot>();
    objects.rows.detach(reader);
    views.detach_servo();
    take(all, shift);
    post_newest();
    return shift;
  } catch (const std::bad_alloc&) {  // then the clock stands where it is, so that ages stay
    objects.rows.detach(reader);
    views.detach_servo();
    clock.switch_back(before);
    return 0;
  }
}

}  // namespace fs
