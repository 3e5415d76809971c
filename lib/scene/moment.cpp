#include "scene/moment.h"

#include <algorithm>

#include "base/serial.h"

namespace fs {

Moment::Moment(Ref<LocalScene> scene, bool with_group, const char* only) : scene_(std::move(scene)) {
  const std::lock_guard lock(scene_->mutex_);
  last_revision_ = last_serial();
  EvaluatedScene& evaluated = scene_->evaluated_;
  const Edits edits = scene_->edits();
  const OpenGroup* const group = with_group ? edits.group() : nullptr;
  most_ = evaluated.objects.count();
  if (only) {
    is_only_one_ = true;
    added_.push_back(with_group ? edits.require(only) : evaluated.objects.require(only));
    only_row_ = evaluated.objects.row_of(added_.front().object->name);
  } else if (group) {
    for (const OpenGroup::Change* change : group->order) {
      const auto& [name, wanted] = *change;
      if (evaluated.objects.has(name)) {
        changes_.emplace(name, wanted);
      } else if (!wanted.is_removed) {
        added_.push_back(wanted);
        ++most_;
      }
    }
  }
  chunks_ = evaluated.objects.rows.chunks();  // counted without atomics, so under the lock; from here on nothing can fail
  time_ = scene_->now();
  frame_ = with_group ? edits.frame() : evaluated.views.frame();
  const ServoReader* const servo = evaluated.servo_reader();
  if (!servo) return;
  memory_ = servo->memory;
  impacts_ = evaluated.servo()->impact_limit();
  used_ = evaluated.objects.rows.used();
  if (servo->budget) sharing_ = servo->budget->sharing();
  if (!servo->newest.read(tick_)) return;
  time_ = tick_.time;
  FeltSolids solids;
  const Proxies* const proxies = memory_->proxies();
  if (proxies && proxies->read(solids)) solids_ = solids;
  const Views& views = *evaluated.views.views();
  const View* view = &views.now();
  for (const View& other : views.rows) {
    if (other.version != 0 && other.version == tick_.view) view = &other;  // 0: no tick has known where the hand is
  }
  fs_state state{};
  state.pose = tick_.tool;
  state.twist = tick_.twist;
  tool_ = ToolState::at(state, *view->tool, tick_.time, memory_->spread.blend);
}

Moment::~Moment() {
  const std::lock_guard lock(scene_->mutex_);
  chunks_ = {};
}

Entry Moment::entry(uint32_t number) const {
  const Chunk& chunk = *find_chunk(chunks_, number);
  const Row& from = row(number);
  return {from.object,   chunk.motion(number % chunk_size),         from.start, from.expiry,
          from.revision, chunk.motion_revision(number % chunk_size)};
}

fs_motion Moment::to_motion(const Entry& entry, const std::string& prefix) noexcept {
  fs_motion out{};
  const size_t size = prefix.copy(out.name, FS_NAME_SIZE - 1);
  entry.object->name.copy(out.name + size, FS_NAME_SIZE - 1 - size);
  out.primitive = entry.object->primitive;
  out.revision = entry.revision;
  out.motion_revision = entry.motion_revision;
  out.pose = entry.motion.pose;
  out.twist = entry.motion.twist;
  out.time = entry.motion.time;
  out.horizon = entry.motion.horizon;
  return out;
}

void sort_by_revision(std::vector<fs_motion>& motions) {
  std::sort(motions.begin(), motions.end(),
            [](const fs_motion& a, const fs_motion& b) { return a.motion_revision < b.motion_revision; });
}

// What a row gives where the tool was, in full.
bool Moment::feel(uint32_t number, ObjectForce& out) const {
  const Row& it = row(number);
  const Motion& motion = find_chunk(chunks_, number)->motion(number % chunk_size);
  if (const FeltSolids::Felt* const felt = it.object->is_solid() ? solids_.find(it.version) : nullptr) {
    out.wrench = felt->wrench;
    out.point = felt->point;
    out.distance = felt->distance;
    return true;
  }
  const Object& object = it.as_felt(true);
  if (!evaluate_object(object, motion, it.start, tool_, nullptr, out, nullptr, nullptr, object.bounds.slope)) return false;
  if (object.law.has_curves()) {
    const Law::Parsers parsers = it.object->law.make_parsers();
    evaluate_object(object, motion, it.start, tool_, &parsers, out, nullptr, nullptr, object.bounds.slope);
  }
  // Its proxies gave nothing; without them it would push a hand that is on the wrong side.
  const bool has_proxies = memory_ && it.object->is_solid() && solids_.count < FeltSolids::size;
  if (has_proxies) out.wrench = {};
  return true;
}

// The weight of the newest version and what it has still to take over from older ones: a changed profile does not report FADING.
double Moment::weight_of(uint32_t newest) const {
  double weight = 0;
  for (uint32_t number = newest; number != no_row; number = row(number).previous) {
    weight += memory_->weight_at(number, row(number).version, time_);
    const uint32_t previous = row(number).previous;
    const bool takes_over = previous != no_row && row(number).takes_over == row(previous).version;
    if (!takes_over || !(memory_->weight_at(number, row(number).version, time_) < 1)) break;
  }
  constexpr double rounding = 1e-9;
  return weight > 1 - rounding ? 1 : weight;
}

fs_report Moment::report(const Entry& entry, uint32_t number) const {
  const Object& object = *entry.object;
  fs_report out{};
  object.name.copy(out.name, FS_NAME_SIZE - 1);
  out.primitive = object.primitive;
  out.revision = entry.revision;
  const bool is_evaluated = number != no_row;
  if (is_evaluated) {
    out.weight = memory_ ? weight_of(number) : row(number).is_felt(time_);
  }
  const bool is_pending = !is_evaluated || (memory_ && row(number).sequence > used_);
  if (is_pending && out.weight == 0 && object.is_enabled) {
    out.state = FS_OBJECT_PENDING;
  } else if (!object.is_enabled && out.weight == 0) {
    out.state = FS_OBJECT_DISABLED;
  } else {
    out.state = out.weight < 1 ? FS_OBJECT_FADING : FS_OBJECT_FELT;
  }
  const double slope_scale = frame_.scale * frame_.force_scale;
  out.stiffness_wanted = slope_scale > 0 ? slope_scale * object.steepest_slope : 0;
  out.stiffness_applied = out.stiffness_wanted;
  if (is_evaluated && memory_ && slope_scale > 0) {
    const Object& felt = row(number).as_felt(true);
    if (object.is_solid() && object.contact.stiffness == 0) {  // it wants what it gets
      out.stiffness_wanted = slope_scale * std::fmax(object.law_slope, felt.contact_slope);
    }
    out.texture_lost = 1 - felt.texture_part;
    out.impact_lost = impact_lost(felt, impacts_, frame_);
    out.stiffness_applied = std::fmin(out.stiffness_wanted, slope_scale * felt.steepest_slope);
  }
  if (sharing_ && slope_scale > 0) {
    const auto shared = sharing_->find(object.name);
    constexpr size_t room = sizeof out.shares_with - 1;
    if (shared != sharing_->end()) shared->second.text(room).copy(out.shares_with, room);
  }
  out.distance = never;
  if (!is_evaluated || !memory_ || !(tick_.weight > 0)) return out;
  // The versions that fade out have their part of it.
  for (uint32_t version = number; version != no_row; version = row(version).previous) {
    const double weight = tick_.weight * memory_->weight_at(version, row(version).version, time_);
    ObjectForce one;
    if (!(weight > 0) || !feel(version, one)) continue;
    if (out.distance == never) {
      out.distance = one.distance;
      out.point = one.point;
    }
    out.wrench.force += weight * one.wrench.force;
    out.wrench.torque += weight * one.wrench.torque;
  }
  return out;
}

}  // namespace fs
