// How changes reach the readers: snapshots, mailboxes; what has faded out is let go; the scene's servo, and its clock.
#include <chrono>
#include <new>
#include <thread>

#include "base/error.h"
#include "scene/local_scene.h"

using namespace fs;

// The newest snapshot; the readers have it, too. Of an open group it has nothing.
Ref<const Snapshot> LocalScene::newest() {
  if (posted_) return posted_;
  const Ref<Snapshot> made = spare_ ? std::move(spare_) : make_ref<Snapshot>();
  made->sequence = ++sequence_;
  made->chunks = objects_.rows.chunks();
  made->views = views_.views();
  made->clock = clock_.kind();
  objects_.rows.set_next_sequence(sequence_ + 1);
  views_.set_next_sequence(sequence_ + 1);
  for (Reader* const reader : objects_.rows.readers()) reader->mailbox.post({made, reader->scratches});
  return posted_ = made;
}

void LocalScene::changed() {
  posted_ = nullptr;
  if (!is_held_) newest();
}

void LocalScene::post() {
  const std::lock_guard lock(mutex_);
  newest();
  for (Reader* const reader : objects_.rows.readers()) reader->mailbox.tidy();
}

void LocalScene::attach(Reader& reader) {
  build_shapes();
  const std::lock_guard lock(mutex_);
  const Ref<const Snapshot> snapshot = newest();
  objects_.rows.attach(reader);
  reader.mailbox.prime({snapshot, reader.scratches});
}

void LocalScene::detach(Reader& reader) noexcept {
  const std::lock_guard lock(mutex_);
  objects_.rows.detach(reader);
}

// Makes good what leave_unbuilt has left out. Whoever comes meanwhile waits until all is there.
void LocalScene::build_shapes() {
  const std::lock_guard building(building_mutex_);
  if (is_built_) return;
  builds_shapes_ = true;  // first: what is set from now on is built where it is set
  std::vector<Ref<const Object>> objects;
  {
    const std::lock_guard lock(mutex_);
    objects_.for_each([&](const std::string&, const Known& known) { objects.push_back(known.object); });
    for (const std::string* name : group_ ? group_->order : std::vector<const std::string*>()) {
      objects.push_back(group_->find(*name)->object);
    }
  }
  for (const Ref<const Object>& object : objects) {
    if (object->shape) object->shape->build();
  }
  is_built_ = true;
}

void LocalScene::with_snapshot(const char* name, const std::function<void(const Snapshot&, uint32_t)>& f) {
  build_shapes();
  Ref<const Snapshot> held;
  uint32_t row = no_row;
  {
    const std::lock_guard lock(mutex_);
    // As it is evaluated, whatever an open group has done to it.
    if (name && !objects_.find_row(std::string_view(name), &row)) {
      fail(FS_ERROR_NOT_FOUND, "name is '%.80s': there is no such object to evaluate", name);
    }
    held = newest();
  }
  struct Release {  // under the lock again, also when f throws
    LocalScene& scene;
    Ref<const Snapshot>& held;
    ~Release() {
      const std::lock_guard lock(scene.mutex_);
      held = nullptr;
    }
  } const release{*this, held};
  f(*held, row);
}

// Lets go of what has faded out, and announces what has expired. Every call that changes something comes by here; that is
// often enough, for what has weight 0 costs a tick nothing.
void LocalScene::settle(bool is_urgent) {
  const double time = now();
  if (!is_urgent && std::fabs(time - settled_at_) < 5e-3) return;
  settled_at_ = time;
  double expiry;
  while (const std::string* const name = objects_.next_expired(time, expiry)) events_.push(FS_EVENT_EXPIRED, expiry, *name);
  if (servo_ && objects_.tidy()) changed();
}

void fs::check_timeout(double timeout) {
  if (!(timeout >= 0 && std::isfinite(timeout))) {
    fail(FS_ERROR_INVALID, "timeout is %g, must be finite and >= 0 s", timeout);
  }
}

void LocalScene::sync(double timeout) {
  check_timeout(timeout);
  uint64_t wanted;
  {
    const std::lock_guard lock(mutex_);
    wanted = sequence_;
  }
  const double start = steady_now();
  while (has_servo() && output->used.load(std::memory_order_acquire) < wanted) {
    if (steady_now() - start >= timeout) {
      fail(FS_ERROR_TIMEOUT, "no tick has used the changes within timeout %g s", timeout);
    }
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
}

// ---------------------------------------------------------------------------------------------------- servo and clock

fs_status LocalScene::get_time(double& out) const noexcept {
  out = now();
  return FS_OK;
}

fs_status LocalScene::set_time(double time) noexcept {
  if (!(time > 0) || !(time <= 1e15)) {
    return set_last_error_literal(FS_ERROR_INVALID, "time must be > 0 s and at most 1e15 s");
  }
  if (has_servo()) return set_last_error_literal(FS_ERROR_STATE, "fs_scene_set_time: the scene's servo has the clock");
  clock_.tell(time);
  return FS_OK;
}

// The scene with every stored time shifted, and nothing fading.
struct LocalScene::Retimed {
  Objects::Shifted objects;
  Ref<Views> views;
};

LocalScene::Retimed LocalScene::retimed(double shift) const { return {objects_.shifted(shift), views_.settled()}; }

void LocalScene::take(Retimed& retimed, double shift) noexcept {
  objects_.take(retimed.objects, shift);
  views_.take(retimed.views);
  if (group_) {
    for (auto& [name, known] : group_->changes) {
      known.motion.time += shift;
      if (shift != 0) known.motion_revision = next_serial();
      known.track.shift(shift);
      known.start += shift;
      known.expiry += shift;
    }
  }
  events_.shift(shift);
  settled_at_ = -never;
  posted_ = nullptr;
}

void LocalScene::attach_servo(const ServoLink& servo, ServoReader& reader, bool starts_in) {
  const std::lock_guard lock(mutex_);
  if (servo_) fail(FS_ERROR_STATE, "scene has a servo already; stop it first");
  settle(true);
  output->time.store(servo.time());
  output->tick.store(0);
  output->used.store(0);
  HandSample hand{};
  hand.state.pose = hand.response.proxy = identity_pose();
  output->hand.write(hand);
  Clock::Before before;
  const double shift = clock_.switch_to(servo.clock(), before);
  try {
    Retimed all = retimed(shift);
    if (!spare_) spare_ = make_ref<Snapshot>();
    take(all, shift);
    objects_.rows.attach_servo(reader, starts_in, now());
  } catch (...) {
    objects_.rows.detach(reader);
    clock_.switch_back(before);
    throw;
  }
  views_.attach_servo(reader);
  events_.attach(servo);
  servo_ = &servo;
  servo_reader_ = &reader;
  reader.mailbox.prime({newest(), reader.scratches});
  has_servo_.store(true);
}

void LocalScene::detach_servo(ServoReader& reader) noexcept {
  const std::lock_guard lock(mutex_);
  has_servo_.store(false);
  const ServoLink& servo = *std::exchange(servo_, nullptr);
  servo_reader_ = nullptr;
  Clock::Before before{ClockKind::caller, now()};
  try {
    events_.collect(servo);
    const double shift = clock_.switch_to(ClockKind::caller, before);
    before = {ClockKind::caller, now() - shift};  // should memory run out
    Retimed all = retimed(shift);  // also where the clutch has moved the frame
    objects_.rows.detach(reader);
    views_.detach_servo();
    take(all, shift);
    newest();
  } catch (const std::bad_alloc&) {  // then the clock stands where it is, so that ages stay
    objects_.rows.detach(reader);
    views_.detach_servo();
    clock_.switch_back(before);
  }
}

fs_status LocalScene::get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept {
  if (!has_servo()) return set_last_error_literal(FS_ERROR_STATE, "the scene has no servo, so no hand");
  return read_hand(*output, state, response, sent);
}

fs_status fs::read_hand(const ServoOutput& output, fs_state* state, fs_response* response, fs_wrench* sent) noexcept {
  HandSample hand;
  if (!output.hand.read(hand)) return set_last_error_literal(FS_ERROR_INTERNAL, "the hand could not be read");
  if (state) *state = hand.state;
  if (response) *response = hand.response;
  if (sent) *sent = hand.sent;
  return FS_OK;
}

std::vector<fs_client> LocalScene::clients() {
  fail(FS_ERROR_UNSUPPORTED, "the scene is in this process: only one that is connected to a server can tell its clients");
}

void LocalScene::get_servo_stats(fs_servo_stats& out) {
  const std::lock_guard lock(mutex_);
  if (!servo_) fail(FS_ERROR_STATE, "the scene has no servo; fs_servo_start gives it one");
  servo_->get_stats(out);
}

void LocalScene::get_device_info(fs_device_info& out) {
  const std::lock_guard lock(mutex_);
  if (!servo_) fail(FS_ERROR_STATE, "the scene has no servo, so no device; fs_servo_start gives it one");
  servo_->get_device_info(out);
}
