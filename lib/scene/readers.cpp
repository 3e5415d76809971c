#include "scene/readers.h"

#include "base/error.h"
#include "base/process.h"
#include "base/text.h"
#include "scene/scene.h"

namespace fs {

static constexpr char servo_of_parent[] = "the servo was started by the parent of this process";

// Builds what leave_unbuilt has left out. Whoever comes meanwhile waits until all is built.
void Readers::build_shapes() {
  const std::lock_guard building(building_mutex_);
  if (is_built_) return;
  builds_shapes_ = true;  // first: what is set from now on is built where it is set
  std::vector<Ref<const Object>> objects;
  {
    const std::lock_guard lock(mutex_);
    evaluated_.objects.for_each([&](const std::string&, const Known& known) { objects.push_back(known.object); });
    if (OpenGroup* const group = edits_.group()) {
      for (const OpenGroup::Change* change : group->order) objects.push_back(change->second.object);
    }
  }
  for (const Ref<const Object>& object : objects) {
    if (object->shape) object->shape->build();
  }
  is_built_ = true;
}

void Readers::attach(Reader& reader) {
  build_shapes();
  const std::lock_guard lock(mutex_);
  evaluated_.attach(reader);
}

void Readers::detach(Reader& reader) noexcept {
  const std::lock_guard lock(mutex_);
  evaluated_.detach(reader);
}

void Readers::with_snapshot(const char* name, const std::function<void(const Snapshot&, uint32_t)>& f) {
  build_shapes();
  Ref<const Snapshot> kept;
  uint32_t row = no_row;
  {
    const std::lock_guard lock(mutex_);
    // As it is evaluated, whatever an open group has done to it.
    if (name) row = evaluated_.objects.row_of(name);
    if (name && row == no_row) {
      fail(FS_ERROR_NOT_FOUND, "name is '%s': there is no such object to evaluate", shortened(name).c_str());
    }
    kept = evaluated_.post_newest();
  }
  struct Release {  // under the lock again, also when f throws
    std::mutex& mutex;
    Ref<const Snapshot>& kept;
    ~Release() {
      const std::lock_guard lock(mutex);
      kept = nullptr;
    }
  } const release{mutex_, kept};
  f(*kept, row);
}

// -------------------------------------------------------------------------------------------------------------- servo

void Readers::attach_servo(ServoLink& servo, ServoReader& reader, bool starts_in) {
  const std::lock_guard lock(mutex_);
  edits_.shift(evaluated_.attach_servo(servo, reader, starts_in));
  servo_process_.store(this_process());
  admitted_ = 0;
  has_servo_.store(true);
}

void Readers::detach_servo(ServoReader& reader) noexcept {
  const std::lock_guard lock(mutex_);
  has_servo_.store(false);
  edits_.shift(evaluated_.detach_servo(reader));
}

static bool operator==(const LoopShare& a, const LoopShare& b) noexcept {
  return a.stiffness == b.stiffness && a.damping == b.damping && a.lever == b.lever && a.radius == b.radius && a.height == b.height;
}

// At most one event a second, about a bound that has changed by more than a tenth.
void Readers::note_capped(const Admitted& row, double before, const SceneShare& share) {
  const Row& now = evaluated_.objects.rows.row(row.row);
  const double after = now.as_felt(true).steepest_slope, time = evaluated_.clock.now();
  const bool has_changed = after < 0.9 * before || after > 1.1 * before;  // before may be infinite
  if (!now.is_named || !has_changed || std::fabs(time - last_capped_) < 1) return;
  last_capped_ = time;
  fs_event event{};
  event.kind = FS_EVENT_CAPPED;
  event.time = time;
  event.value = share.to_device * after;
  now.object->name.copy(event.name, sizeof event.name - 1);
  std::snprintf(event.text, sizeof event.text, "its slope is bounded to %.4g N/m at the device, of %.4g", event.value,
                share.to_device * now.object->steepest_slope);
  evaluated_.events.push(event);
}

void Readers::admit(const LoopShare& loop) {
  const double most = max_stiffness_.load();
  Ref<const Snapshot> snapshot;
  double time;
  {
    const std::lock_guard lock(mutex_);
    if (!evaluated_.servo()) return;
    const bool is_same = loop == admitted_share_ && most == admitted_most_ && !is_any_moving_;
    if (admitted_ != 0 && is_same && evaluated_.sequence() == admitted_) return;
    if (evaluated_.is_held()) {  // what its holder has not posted yet comes the next time
      snapshot = evaluated_.newest();
      if (!snapshot) return;
    } else {
      snapshot = evaluated_.post_newest();
    }
    time = evaluated_.clock.now();
  }
  struct Release {  // under the lock again, also when something throws
    std::mutex& mutex;
    Ref<const Snapshot>& kept;
    ~Release() {
      const std::lock_guard lock(mutex);
      kept = nullptr;
    }
  } const release{mutex_, snapshot};
  const SceneShare share = share_of(*snapshot->views, loop, most);
  const std::vector<Admitted> all = fs::admit(*snapshot, share, time);

  const std::lock_guard lock(mutex_);
  if (!evaluated_.servo()) return;
  const bool is_newest = evaluated_.newest() && evaluated_.sequence() == snapshot->sequence;  // else it is done again
  evaluated_.prepare();
  ObjectRows& rows = evaluated_.objects.rows;
  rows.set_bounds(bounds_alone(share));
  bool has_changed = false, wants = false, is_moving = false;
  for (const Admitted& row : all) {
    wants |= row.object->steepest_slope > 0 || row.object->damping > 0;
    const Chunk* const chunk = find_chunk(rows.chunks(), row.row);
    if (!chunk || !(chunk->used >> row.row % chunk_size & 1)) continue;
    is_moving |= is_under_way(chunk->motion(row.row % chunk_size), time);
    const double before = rows.row(row.row).as_felt(true).steepest_slope;
    if (!rows.bound(row.row, row.version, *row.object, row.bounds)) continue;
    has_changed = true;
    note_capped(row, before, share);
  }
  if (has_changed) evaluated_.changed();
  wants_stiffness_.store(wants, std::memory_order_relaxed);
  admitted_ = is_newest ? evaluated_.sequence() : 0;
  admitted_share_ = loop;
  admitted_most_ = most;
  is_any_moving_ = is_moving;
}

fs_status Readers::get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept {
  if (!has_servo()) return set_last_error_literal(FS_ERROR_STATE, "the scene has no servo, so no hand");
  if (servo_process_.load(std::memory_order_relaxed) != this_process()) {
    return set_last_error_literal(FS_ERROR_STATE, servo_of_parent);
  }
  return read_hand(*evaluated_.output, state, response, sent);
}

ServoLink& Readers::require_servo(const char* sentence) const {
  if (!evaluated_.servo()) fail(FS_ERROR_STATE, "%s", sentence);
  if (servo_process_ != this_process()) fail(FS_ERROR_STATE, "%s", servo_of_parent);
  return *evaluated_.servo();
}

void Readers::get_servo_stats(fs_servo_stats& out) {
  const std::lock_guard lock(mutex_);
  require_servo("the scene has no servo; fs_servo_start gives it one").get_stats(out);
}

void Readers::get_device_info(fs_device_info& out) {
  const std::lock_guard lock(mutex_);
  require_servo("the scene has no servo, so no device; fs_servo_start gives it one").get_device_info(out);
}

void Readers::stop_force() {
  const std::lock_guard lock(mutex_);
  require_servo("the scene has no servo, so no force to stop").set_enabled(false);
}

}  // namespace fs
