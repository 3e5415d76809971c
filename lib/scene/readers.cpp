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
    evaluated_.objects.for_each([&](const std::string&, const ObjectState& known) { objects.push_back(known.object); });
    groups_.for_each([&](const OpenGroup& group) {
      for (const OpenGroup::Change* change : group.order) objects.push_back(change->second.object);
    });
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
  KeptSnapshot kept(mutex_);
  uint32_t row = no_row;
  {
    const std::lock_guard lock(mutex_);
    // As it is evaluated, whatever an open group has done to it.
    if (name) row = evaluated_.objects.row_of(name);
    if (name && row == no_row) {
      fail(FS_ERROR_NOT_FOUND, "name is '%s': there is no such object to evaluate", shortened(name).c_str());
    }
    kept.snapshot = evaluated_.post_newest();
  }
  f(*kept.snapshot, row);
}

// -------------------------------------------------------------------------------------------------------------- servo

void Readers::attach_servo(ServoLink& servo, ServoReader& reader, bool starts_in) {
  const std::lock_guard lock(mutex_);
  const double by = evaluated_.attach_servo(servo, reader, starts_in);
  groups_.for_each([by](OpenGroup& group) { group.shift(by); });
  servo_process_.store(this_process());
  has_servo_.store(true);
}

void Readers::detach_servo(ServoReader& reader) noexcept {
  const std::lock_guard lock(mutex_);
  has_servo_.store(false);
  const double by = evaluated_.detach_servo(reader);
  groups_.for_each([by](OpenGroup& group) { group.shift(by); });
}

fs_status Readers::get_hand(fs_state* state, fs_response* response, fs_wrench* sent) const noexcept {
  if (!has_servo()) return set_last_error_literal(FS_ERROR_STATE, "the scene has no servo, so no hand");
  if (servo_process_.load(std::memory_order_relaxed) != this_process()) {
    return set_last_error_literal(FS_ERROR_STATE, servo_of_parent);
  }
  return read_hand(*evaluated_.output, state, response, sent);
}

template <class F>
void Readers::with_servo(const char* sentence, F&& f) {
  // A parent process may have held the lock when it was forked, and then nobody gives it back here.
  if (has_servo() && servo_process_ != this_process()) fail(FS_ERROR_STATE, "%s", servo_of_parent);
  const std::lock_guard lock(mutex_);
  if (!evaluated_.servo()) fail(FS_ERROR_STATE, "%s", sentence);
  f(*evaluated_.servo());
}

void Readers::get_servo_stats(fs_servo_stats& out) {
  with_servo("the scene has no servo; fs_servo_start gives it one", [&](const ServoLink& servo) { servo.get_stats(out); });
}

void Readers::get_device_info(fs_device_info& out) {
  with_servo("the scene has no servo, so no device; fs_servo_start gives it one",
             [&](const ServoLink& servo) { servo.get_device_info(out); });
}

// In pieces, between which other calls can go on.
std::vector<fs_recorded_tick> Readers::record(uint64_t after) {
  constexpr size_t piece = 256;
  std::vector<fs_recorded_tick> out;
  for (size_t before = 0;; before = out.size()) {
    with_servo("the scene has no servo, so no record of ticks",
               [&](const ServoLink& servo) { servo.add_record(out.empty() ? after : out.back().number, piece, out); });
    if (out.size() < before + piece) return out;
  }
}

void Readers::set_enabled(bool enabled) {
  with_servo("the scene has no servo, so no force", [&](ServoLink& servo) { servo.set_enabled(enabled); });
}

}  // namespace fs
