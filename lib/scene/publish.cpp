// How changes reach the readers: fades that begin when a tick first uses them, snapshots, mailboxes; and what has faded out
// is let go.
#include <chrono>
#include <thread>

#include "base/error.h"
#include "scene/scene.h"

using namespace fs;

namespace {
constexpr size_t open_epochs = 16;
}

// The parsers of expressions: made for a reader before it can come by the curve.
void fs::prepare_curves(const Object& object, unsigned reader) {
  if (object.front.curve) object.front.curve->prepare(reader);
  if (object.back.curve) object.back.curve->prepare(reader);
}

Fade fs_scene::turned(const Fade& fade, bool in, double expiry) {
  if (!servo_) return Fade::steady(in, expiry);
  if (!pending_epoch_) {
    // A servo that does not tick meanwhile must not make the list of open epochs grow: from some number on they share one.
    const bool is_shared = epochs_.size() >= open_epochs && !epochs_.back()->is_stamped();
    pending_epoch_ = is_shared ? epochs_.back() : Ref<const Epoch>(make_ref<Epoch>());
  }
  return fade.turned(in, expiry, pending_epoch_, servo_->fade);
}

void fs_scene::changed() {
  if (group_) return;
  posted_ = nullptr;
  if (readers_.empty()) return;
  const Ref<const Snapshot> newest = snapshot();
  for (Reader* reader : readers_) reader->mailbox.post(newest);
}

// The newest snapshot; of an open group it has nothing.
Ref<const Snapshot> fs_scene::snapshot() {
  if (posted_) return posted_;
  const Ref<Snapshot> made = make_ref<Snapshot>();
  made->sequence = ++sequence_;
  made->objects = table_;
  made->views = views_;
  std::erase_if(epochs_, [](const Ref<const Epoch>& epoch) { return epoch->is_stamped(); });
  if (group_) {
    for (auto undo = group_->undo.rbegin(); undo != group_->undo.rend(); ++undo) {
      made->objects.set(undo->first, undo->second);
    }
    made->views = group_->views;
  } else if (pending_epoch_) {
    if (epochs_.empty() || !(epochs_.back() == pending_epoch_)) epochs_.push_back(pending_epoch_);
    pending_epoch_ = nullptr;
  }
  made->clock = clock_.load(std::memory_order_relaxed);
  made->epochs = epochs_;
  return posted_ = made;
}

void fs_scene::attach(Reader& reader) {
  const std::lock_guard lock(mutex_);
  table_.for_each([&](uint32_t, const Entry& entry) { prepare_curves(*entry.object, reader.id.get()); });
  readers_.push_back(&reader);
  reader.mailbox.post(snapshot());
}

void fs_scene::detach(Reader& reader) noexcept {
  const std::lock_guard lock(mutex_);
  std::erase(readers_, &reader);
  reader.mailbox.clear();
}

void fs_scene::with_snapshot(const char* name, const std::function<void(const Snapshot&, int64_t)>& f) {
  Ref<const Snapshot> held;
  int64_t slot = -1;
  {
    const std::lock_guard lock(mutex_);
    uint32_t found;
    if (name) {
      require(name, found);
      slot = found;
    }
    held = snapshot();
  }
  struct Release {  // under the lock again, also when f throws
    fs_scene& scene;
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
void fs_scene::settle(bool now_or_never) {
  const double time = now();
  if (group_ || (!now_or_never && std::fabs(time - settled_at_) < 5e-3)) return;
  settled_at_ = time;
  while (!expiries_.empty() && expiries_.begin()->first <= time) {
    const Entry& entry = *table_.get(expiries_.begin()->second);
    fs_event event{};
    event.kind = FS_EVENT_EXPIRED;
    event.time = expiries_.begin()->first;
    entry.object->name.copy(event.name, FS_NAME_SIZE - 1);
    push_event(event);
    expiries_.erase(expiries_.begin());
  }
  if (!servo_) return;
  const double duration = servo_->fade;
  const std::vector<uint32_t> fading(fading_.begin(), fading_.end());
  bool is_changed = false;
  for (const uint32_t slot : fading) {
    const Entry& old = *table_.get(slot);
    const bool previous_is_gone = !old.previous || !(old.previous->fade.weight(time, duration) > 0);
    if (old.is_removed && previous_is_gone && !(old.fade.weight(time, duration) > 0)) {
      put(slot, nullptr);
    } else if (old.previous && previous_is_gone) {
      const Ref<Entry> entry = make_ref<Entry>(old);
      entry->previous = nullptr;
      put(slot, entry);
    } else {
      continue;
    }
    is_changed = true;
  }
  if (views_.previous && !(views_.previous_fade.weight(time, duration) > 0)) {
    views_.previous = nullptr;
    is_changed = true;
  }
  if (is_changed) changed();
}

void fs::check_timeout(double timeout) {
  if (!(timeout >= 0 && std::isfinite(timeout))) {
    fail(FS_ERROR_INVALID, "timeout is %g, must be finite and >= 0 s", timeout);
  }
}

void fs_scene::sync(double timeout) const {
  check_timeout(timeout);
  uint64_t wanted;
  {
    const std::lock_guard lock(mutex_);
    wanted = sequence_;
  }
  const double start = steady_now();
  while (has_servo() && output.used.load(std::memory_order_acquire) < wanted) {
    if (steady_now() - start >= timeout) {
      fail(FS_ERROR_TIMEOUT, "no tick has used the changes within timeout %g s", timeout);
    }
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
}
