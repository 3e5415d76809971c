// Objects, groups, snapshots and the clock. Frame, clutch and tool: view.cpp; reports and events: report.cpp.
#include "scene/scene.h"

#include <cstring>
#include <ctime>
#include <thread>

#include "base/error.h"

using namespace fs;

namespace {

constexpr uint32_t all_parts = FS_PART_POSE | FS_PART_PROFILES | FS_PART_CONTACT | FS_PART_SHAPE | FS_PART_OTHER;

constexpr size_t open_epochs = 16;

double expiry_of(const Object& object, double now) { return object.lifetime > 0 ? now + object.lifetime : never; }

void prepare_curves(const Object& object, unsigned reader) {
  if (object.front.curve) object.front.curve->prepare(reader);
  if (object.back.curve) object.back.curve->prepare(reader);
}

Ref<Entry> copy(const Entry& entry) { return make_ref<Entry>(entry); }

}  // namespace

double fs::steady_now() noexcept {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// ---------------------------------------------------------------------------------------------------------- objects

const Entry* fs_scene::find(std::string_view name, uint32_t& slot) const {
  const auto found = slots_.find(name);
  if (found == slots_.end()) return nullptr;
  slot = found->second;
  return table_.get(slot);
}

const Entry& fs_scene::require(const char* name, uint32_t& slot) const {
  const size_t size = strnlen(name, 2 * FS_NAME_SIZE);
  const Entry* entry = find({name, size}, slot);
  if (!entry || entry->is_removed) {
    fail(FS_ERROR_NOT_FOUND, "name is '%.*s': there is no such object in the scene", static_cast<int>(size), name);
  }
  return *entry;
}

uint32_t fs_scene::take_slot() {
  if (!free_slots_.empty()) return *free_slots_.begin();
  if (slots_end_ == Table<Entry>::capacity) {
    fail(FS_ERROR_FULL, "the scene holds %u objects, its maximum", Table<Entry>::capacity);
  }
  return slots_end_++;
}

// The one place where the table changes; keeps the indexes beside it true, and the group's undo list.
void fs_scene::put(uint32_t slot, Ref<const Entry> entry) {
  const Ref<const Entry> before = Ref<const Entry>::share(table_.get(slot));
  if (group_) group_->undo.emplace_back(slot, before);
  if (before) {
    if (before->fade.expiry() < never) expiries_.erase({before->fade.expiry(), slot});
    if (before->previous || before->is_removed) fading_.erase(slot);
    if (!entry) {
      slots_.erase(before->object->name);
      free_slots_.insert(slot);
    }
  } else if (entry) {
    slots_[entry->object->name] = slot;
    free_slots_.erase(slot);
  }
  if (entry) {
    const double expiry = entry->fade.expiry();
    if (expiry < never && !entry->is_removed && expiry > now()) expiries_.insert({expiry, slot});
    if (entry->previous || entry->is_removed) fading_.insert(slot);
  }
  table_.set(slot, std::move(entry));
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

// Puts a checked object in, or the parts of it that are named, into the object of its name.
void fs_scene::admit(const ParsedObject& parsed, uint32_t parts) {
  const Object& object = *parsed.object;
  const double time = now();
  for (const Reader* reader : readers_) prepare_curves(object, reader->id.get());

  uint32_t slot;
  const Entry* old = find(object.name, slot);
  const bool is_known = old && !old->is_removed;  // else the name is new, also where its last bearer still fades out
  if (!old) slot = take_slot();

  Ref<Entry> entry = old ? copy(*old) : make_ref<Entry>();
  entry->object = parsed.object;
  entry->is_removed = false;
  entry->revision = ++revision_;
  if (!is_known || !entry->felt) entry->felt = make_ref<Felt>();
  if (!is_known || (parsed.start != 0 && parsed.start != old->start)) {
    entry->start_is_given = parsed.start != 0;
    entry->start = parsed.start != 0 ? parsed.start : time;
  }
  if (parts & FS_PART_POSE) {
    entry->track = {};
    entry->motion = entry->track.take(parsed.pose, &parsed.twist, parsed.time != 0 ? parsed.time : time);
  }

  const double expiry = expiry_of(object, time);
  if (!servo_) {
    entry->fade = Fade::steady(object.is_enabled, expiry);
  } else if (!old) {
    entry->fade = turned(Fade::steady(false), object.is_enabled, expiry);
  } else if (old->object->is_same_version(object)) {
    entry->fade = turned(old->fade, object.is_enabled, expiry);
  } else if (old->previous && old->previous->fade.weight(time, servo_->fade) > 0) {
    // At most one old version is kept: this one takes the place, and the weight, of the one that is fading in.
    entry->fade = turned(old->fade, object.is_enabled, expiry);
  } else {
    const Ref<Entry> previous = copy(*old);
    previous->fade = turned(old->fade, false, never);
    previous->previous = nullptr;
    previous->felt = nullptr;
    entry->previous = previous;
    entry->fade = turned(Fade::steady(false), object.is_enabled, expiry);
  }
  put(slot, entry);
}

void fs_scene::set(const fs_object& object) {
  const ParsedObject parsed = parse_object(object);
  const std::lock_guard lock(mutex_);
  settle(false);
  admit(parsed, all_parts);
  changed();
}

void fs_scene::change(const fs_object& change, uint32_t parts) {
  if (parts & ~all_parts) fail(FS_ERROR_INVALID, "parts is 0x%x, must be of the fs_part bits 0x%x", parts, all_parts);
  check_struct_size(change.struct_size, sizeof(fs_object), "fs_object");
  const std::string name = parse_name(change.name, "name");
  for (;;) {
    fs_object current;
    const Ref<const Object> object = get(name.c_str(), current);
    if (parts == 0) return;
    const ParsedObject parsed = parse_object(merge_parts(current, change, parts));  // may build a tree: not under the lock
    const std::lock_guard lock(mutex_);
    settle(false);
    uint32_t slot;
    if (!(require(name.c_str(), slot).object == object)) continue;  // another thread came between: once more
    admit(parsed, parts);
    changed();
    return;
  }
}

void fs_scene::move(const char* name, const fs_pose& pose, const fs_twist* twist, double time) {
  const Pose parsed = parse_pose(pose, "pose");
  if (twist) parse_twist(*twist, "twist");
  parse_finite(time, "time");
  const std::lock_guard lock(mutex_);
  settle(false);
  uint32_t slot;
  const Entry& old = require(name, slot);
  const Ref<Entry> entry = copy(old);
  const double present = now();
  entry->motion = entry->track.take(parsed, twist, time != 0 ? time : present);
  if (old.object->lifetime > 0) {
    entry->fade = turned(old.fade, old.object->is_enabled, expiry_of(*old.object, present));
  }
  put(slot, entry);
  changed();
}

void fs_scene::remove_slot(uint32_t slot) {
  const Entry& old = *table_.get(slot);
  if (old.is_removed) return;
  if (!servo_) return put(slot, nullptr);
  const Ref<Entry> entry = copy(old);
  entry->is_removed = true;
  entry->fade = turned(old.fade, false, never);
  put(slot, entry);
}

void fs_scene::remove(const char* name) {
  const std::lock_guard lock(mutex_);
  settle(false);
  uint32_t slot;
  require(name, slot);
  remove_slot(slot);
  changed();
}

void fs_scene::clear() {
  const std::lock_guard lock(mutex_);
  settle(false);
  std::vector<uint32_t> slots;
  table_.for_each([&](uint32_t slot, const Entry&) { slots.push_back(slot); });
  for (const uint32_t slot : slots) remove_slot(slot);
  changed();
}

fs_object fs_scene::to_c(const Entry& entry) const {
  fs_object out = fs::to_c(*entry.object);
  out.pose = entry.motion.pose;
  out.twist = entry.motion.twist;
  out.time = entry.motion.time;
  out.start = entry.start;
  return out;
}

Ref<const Object> fs_scene::get(const char* name, fs_object& out) const {
  const std::lock_guard lock(mutex_);
  uint32_t slot;
  const Entry& entry = require(name, slot);
  out = to_c(entry);
  return entry.object;
}

fs_scene::Contents fs_scene::contents() const {
  const std::lock_guard lock(mutex_);
  Contents out;
  table_.for_each([&](uint32_t, const Entry& entry) {
    if (entry.is_removed) return;
    fs_object object = to_c(entry);
    object.time = 0;
    if (!entry.start_is_given) object.start = 0;
    out.objects.push_back(object);
    out.owners.push_back(entry.object);
  });
  views_.view->get_frame(out.frame);
  out.tool = views_.view->points;
  return out;
}

void fs_scene::set_contents(const std::vector<fs_object>& objects, const fs_frame& frame,
                            const std::vector<Vec3>& tool) {
  std::vector<ParsedObject> parsed;
  for (const fs_object& object : objects) parsed.push_back(parse_object(object));
  const fs_frame parsed_frame = parse_frame(frame);
  check_tool(tool.data(), tool.size());
  const std::lock_guard lock(mutex_);
  settle(false);
  size_t added = 0;
  for (const ParsedObject& object : parsed) added += !slots_.contains(object.object->name);
  if (added > Table<Entry>::capacity - slots_end_ + free_slots_.size()) {
    fail(FS_ERROR_FULL, "the scene would hold more than %u objects, its maximum", Table<Entry>::capacity);
  }
  for (const ParsedObject& object : parsed) admit(object, all_parts);
  apply_view(&parsed_frame, tool.data(), tool.size());
  changed();
}

// ----------------------------------------------------------------------------------------------------------- groups

void fs_scene::begin() {
  const std::lock_guard lock(mutex_);
  if (group_) fail(FS_ERROR_STATE, "fs_scene_begin: a group is open already; commit or cancel it first");
  settle(true);
  group_ = std::make_unique<Group>();
  group_->views = views_;
}

void fs_scene::commit() {
  const std::lock_guard lock(mutex_);
  if (!group_) fail(FS_ERROR_STATE, "fs_scene_commit: no group is open; fs_scene_begin opens one");
  group_ = nullptr;
  changed();
}

void fs_scene::cancel() {
  const std::lock_guard lock(mutex_);
  if (!group_) fail(FS_ERROR_STATE, "fs_scene_cancel: no group is open; fs_scene_begin opens one");
  const std::unique_ptr<Group> group = std::move(group_);
  for (auto undo = group->undo.rbegin(); undo != group->undo.rend(); ++undo) put(undo->first, undo->second);
  views_ = group->views;
  pending_epoch_ = nullptr;
  changed();
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

// -------------------------------------------------------------------------------------------- snapshots and readers

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
      const Ref<Entry> entry = copy(old);
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

// ------------------------------------------------------------------------------------------------- servo and clock

double fs_scene::now(ClockKind clock) const noexcept {
  if (clock == ClockKind::virtual_time) return output.time.load(std::memory_order_acquire);
  if (clock == ClockKind::caller) {
    const double told = told_time_.load(std::memory_order_acquire);
    if (!std::isnan(told)) return told;
  }
  return steady_now();
}

fs_status fs_scene::set_time(double time) noexcept {
  if (!(time > 0) || !(time <= 1e15)) {
    return set_last_error_literal(FS_ERROR_INVALID, "time must be > 0 s and at most 1e15 s");
  }
  if (has_servo()) return set_last_error_literal(FS_ERROR_STATE, "fs_scene_set_time: the scene's servo has the clock");
  told_time_.store(time, std::memory_order_release);
  return FS_OK;
}

// Shifts every stored time and brings what fades to its end.
void fs_scene::retime(double shift) {
  const auto retimed = [&](const Entry& old) {
    const Ref<Entry> entry = copy(old);
    entry->motion.time += shift;
    entry->track.shift(shift);
    entry->start += shift;
    entry->fade = old.fade.settled(shift);
    entry->previous = nullptr;
    return entry;
  };
  std::vector<std::pair<uint32_t, Ref<const Entry>>> entries;
  table_.for_each([&](uint32_t slot, const Entry& old) {
    entries.emplace_back(slot, old.is_removed ? nullptr : Ref<const Entry>(retimed(old)));
  });
  std::unique_ptr<Group> group = std::move(group_);  // an open group stays open, and its undo list is retimed too
  expiries_.clear();
  for (auto& [slot, entry] : entries) put(slot, entry);
  settled_at_ = -never;
  pending_epoch_ = nullptr;
  epochs_.clear();

  const auto settle_views = [](ViewFade& views) {
    const Ref<View> view = make_ref<View>();
    views.view->get_frame(view->frame);
    view->points = views.view->points;
    view->kind = views.view->kind == View::Kind::held ? View::Kind::held : View::Kind::free;
    views = {view, nullptr, Fade::steady(view->kind == View::Kind::free), Fade::steady(false)};
  };
  settle_views(views_);
  if (group) {
    for (auto& [slot, before] : group->undo) {
      if (before) before = before->is_removed ? nullptr : Ref<const Entry>(retimed(*before));
    }
    settle_views(group->views);
  }
  posted_ = nullptr;
  group_ = std::move(group);
}

void fs_scene::switch_clock(ClockKind clock) {
  const double before = now();
  const bool was_told = !std::isnan(told_time_.exchange(std::numeric_limits<double>::quiet_NaN()));
  const ClockKind old = clock_.exchange(clock);
  const bool same = (old == ClockKind::virtual_time) == (clock == ClockKind::virtual_time) && !was_told;
  retime(same ? 0 : now() - before);
}

void fs_scene::attach_servo(ServoLink& servo) {
  const std::lock_guard lock(mutex_);
  if (servo_) fail(FS_ERROR_STATE, "scene has a servo already; stop it first");
  settle(true);
  output.time.store(0);
  output.tick.store(0);
  output.used.store(0);
  HandSample hand{};
  hand.state.pose = hand.response.proxy = identity_pose();
  output.hand.write(hand);
  has_servo_.store(true);
  servo_ = &servo;
  switch_clock(servo.clock);
  table_.for_each([&](uint32_t, const Entry& entry) { prepare_curves(*entry.object, servo.reader.id.get()); });
  readers_.push_back(&servo.reader);
  const Ref<const Snapshot> newest = snapshot();
  for (Reader* reader : readers_) reader->mailbox.post(newest);
}

void fs_scene::detach_servo(ServoLink& servo) {
  const std::lock_guard lock(mutex_);
  std::erase(readers_, &servo.reader);
  servo.reader.mailbox.clear();
  for (fs_event event; servo.take_event(event);) push_event(event);
  servo_ = nullptr;
  has_servo_.store(false);
  switch_clock(ClockKind::caller);
  const Ref<const Snapshot> newest = snapshot();
  for (Reader* reader : readers_) reader->mailbox.post(newest);
}

void fs_scene::get_servo_stats(fs_servo_stats& out) const {
  const std::lock_guard lock(mutex_);
  if (!servo_) fail(FS_ERROR_STATE, "the scene has no servo; fs_servo_start gives it one");
  servo_->get_stats(out);
}

void fs_scene::get_device_info(fs_device_info& out) const {
  const std::lock_guard lock(mutex_);
  if (!servo_) fail(FS_ERROR_STATE, "the scene has no servo, so no device; fs_servo_start gives it one");
  servo_->get_device_info(out);
}
