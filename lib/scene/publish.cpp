// How changes reach the readers: fades that begin when a tick first uses them, snapshots, mailboxes; and what has faded out
// is let go.
#include <chrono>
#include <thread>

#include "base/error.h"
#include "scene/local_scene.h"

using namespace fs;

// The parsers of expressions: made for a reader before it can come by the curve.
void fs::prepare_curves(const Object& object, unsigned reader) {
  if (object.front.curve) object.front.curve->prepare(reader);
  if (object.back.curve) object.back.curve->prepare(reader);
}

void LocalScene::prepare_all_curves(unsigned reader) const {
  const auto prepare = [&](uint32_t, const Entry& entry) {
    prepare_curves(*entry.object, reader);
    if (entry.previous) prepare_curves(*entry.previous->object, reader);
  };
  table_.for_each(prepare);
  if (group_) group_->table.for_each(prepare);
}

// All fades between two ticks begin at the same epoch. It is a new one once the servo has fetched the last: whether it has
// is made sure by taking the snapshot back, so that nothing begins before the servo can know of it. Not of a scene that is
// held: who changes it without a pause would keep the servo from all of it. There a change may begin a tick early.
Fade LocalScene::turned(const Fade& fade, bool in, double expiry) {
  if (!servo_) return Fade::steady(in, expiry);
  if (!pending_epoch_) {
    const Ref<const Epoch> fresh = make_ref<Epoch>();
    Mailbox<Ref<const Snapshot>>& mailbox = servo_->reader.mailbox;
    const bool is_open = is_held_ ? mailbox.is_unread() && !(open_epoch_ && open_epoch_->is_stamped())
                                  : mailbox.take_back();
    if (!is_held_) posted_ = nullptr;
    if (!is_open) open_epoch_ = nullptr;
    pending_epoch_ = open_epoch_ ? open_epoch_ : fresh;
  }
  return fade.turned(in, expiry, pending_epoch_, servo_->fade);
}

void LocalScene::changed() {
  posted_ = nullptr;
  if (!is_held_) newest();
}

// The newest snapshot; the readers have it, too. Of an open group it has nothing.
Ref<const Snapshot> LocalScene::newest() {
  if (posted_) return posted_;
  const Ref<Snapshot> made = spare_ ? std::move(spare_) : make_ref<Snapshot>();
  made->sequence = sequence_ + 1;
  made->objects = table_;
  made->views = views_;
  made->clock = clock_.load(std::memory_order_relaxed);
  made->epoch = pending_epoch_ ? pending_epoch_ : open_epoch_;
  for (Reader* reader : readers_) {
    const bool was_unread = reader->mailbox.post(made);
    if (!servo_ || reader != &servo_->reader) continue;
    if (pending_epoch_) {
      open_epoch_ = std::move(pending_epoch_);
    } else if (!was_unread) {
      open_epoch_ = nullptr;  // fetched with the snapshot before
    }
  }
  ++sequence_;
  return posted_ = made;
}

void LocalScene::attach(Reader& reader) {
  build_shapes();
  const std::lock_guard lock(mutex_);
  prepare_all_curves(reader.id);
  const Ref<const Snapshot> snapshot = newest();
  readers_.push_back(&reader);
  reader.mailbox.prime(snapshot);
}

void LocalScene::detach(Reader& reader) noexcept {
  const std::lock_guard lock(mutex_);
  std::erase(readers_, &reader);
  reader.mailbox.clear();
}

// Makes good what leave_unbuilt has left out. Whoever comes meanwhile waits until all is there.
void LocalScene::build_shapes() {
  const std::lock_guard building(building_mutex_);
  if (is_built_) return;
  builds_shapes_ = true;  // first: what is set from now on is built where it is set
  std::vector<Ref<const Object>> objects;
  {
    const std::lock_guard lock(mutex_);
    const auto collect = [&](uint32_t, const Entry& entry) { objects.push_back(entry.object); };
    table_.for_each(collect);
    if (group_) group_->table.for_each(collect);
  }
  for (const Ref<const Object>& object : objects) {
    if (object->shape) object->shape->build();
  }
  is_built_ = true;
}

void LocalScene::with_snapshot(const char* name, const std::function<void(const Snapshot&, int64_t)>& f) {
  build_shapes();
  Ref<const Snapshot> held;
  int64_t slot = -1;
  {
    const std::lock_guard lock(mutex_);
    if (name) {  // as it is evaluated, whatever an open group has done to it
      const auto found = slots_.find(std::string_view(name));
      const Entry* entry = found == slots_.end() ? nullptr : table_.get(found->second);
      if (!entry || entry->is_removed) {
        fail(FS_ERROR_NOT_FOUND, "name is '%.80s': there is no such object to evaluate", name);
      }
      slot = found->second;
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
  f(*held, slot);
}

// Lets go of what has faded out, and announces what has expired. Every call that changes something comes by here; that is
// often enough, for what has weight 0 costs a tick next to nothing.
void LocalScene::settle(bool is_urgent) {
  const double time = now();
  if (!is_urgent && std::fabs(time - settled_at_) < 5e-3) return;
  settled_at_ = time;
  announce_expired(time);
  if (servo_ && tidy(time)) changed();
}

void LocalScene::announce_expired(double time) {
  while (!expiries_.empty() && expiries_.begin()->first <= time) {
    const Entry& entry = *table_.get(expiries_.begin()->second);
    fs_event event{};
    event.kind = FS_EVENT_EXPIRED;
    event.time = expiries_.begin()->first;
    entry.object->name.copy(event.name, FS_NAME_SIZE - 1);
    push_event(event);
    expiries_.erase(expiries_.begin());
  }
}

// True when it changed something. Only what is due, and not too much at once: no call waits for the tidying of thousands.
bool LocalScene::tidy(double time) {
  constexpr int most = 256;
  const double duration = servo_->fade;
  bool is_changed = false;
  for (int i = 0; i < most && !tidies_.empty() && tidies_.begin()->first <= time; ++i) {
    const uint32_t slot = tidies_.begin()->second;
    const Entry& old = *table_.get(slot);
    const bool is_alone = !old.previous || !(old.previous->fade.weight(time, duration) > 0);
    const bool is_gone = old.is_removed && is_alone && !(old.fade.weight(time, duration) > 0);
    const bool is_in_group = group_ && group_->touched.contains(slot);
    Ref<Entry> entry;
    if (!is_gone || is_in_group) {
      entry = make_ref<Entry>(old);
      if (is_alone) entry->previous = nullptr;
      entry->tidy_at = entry->previous || old.is_removed ? time + duration + 1e-3 : never;  // else look again then
    }
    if (group_ && !is_in_group) group_->table.set(slot, entry);
    is_changed |= !entry || !(entry->previous == old.previous);
    store(slot, entry);
  }
  if (views_.previous && !(views_.previous_fade.weight(time, duration) > 0)) {
    views_.previous = nullptr;
    is_changed = true;
  }
  return is_changed;
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
