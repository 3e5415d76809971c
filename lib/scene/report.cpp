// What became of the objects.
#include <chrono>
#include <cstring>
#include <thread>

#include "base/error.h"
#include "scene/moment.h"

using namespace fs;

LocalScene::Moment::Moment(Ref<LocalScene> scene, bool with_group, const char* only) : scene_(std::move(scene)) {
  const std::lock_guard lock(scene_->mutex_);
  chunks_ = scene_->objects_.rows.chunks();
  most_ = scene_->objects_.count();
  OpenGroup* const group = with_group ? scene_->group_.get() : nullptr;
  if (only) {
    std::string key;
    is_only_one_ = true;
    added_.push_back(scene_->require(only, &key));
    scene_->objects_.find_row(key, &only_row_);
  } else if (group) {
    for (const std::string* name : group->order) {
      const Known& wanted = *group->find(*name);
      if (scene_->objects_.has(*name)) {
        changes_.emplace(*name, wanted);
      } else if (!wanted.is_removed) {
        added_.push_back(wanted);
        ++most_;
      }
    }
  }
  time_ = scene_->now();
  frame_ = scene_->present_frame();
  const ServoReader* const servo = scene_->servo_reader_;
  if (!servo) return;
  memory_ = servo->memory;
  used_ = scene_->objects_.rows.used();
  if (!servo->newest.read(tick_)) return;
  time_ = tick_.time;
  const Views& views = *scene_->views_.views();
  const View* view = &views.now();
  for (const View& other : views.rows) {
    if (other.version == tick_.view) view = &other;
  }
  fs_state state{};
  state.pose = tick_.tool;
  state.twist = tick_.twist;
  tool_ = ToolState::at(state, *view->tool, tick_.time);
}

LocalScene::Moment::~Moment() {
  const std::lock_guard lock(scene_->mutex_);
  chunks_ = {};
}

Entry LocalScene::Moment::entry(uint32_t number) const {
  const Chunk& chunk = *find_chunk(chunks_, number);
  const Row& from = row(number);
  return {from.object, chunk.motion(number % chunk_size), from.start, from.expiry, from.revision,
          chunk.motion_revision(number % chunk_size)};
}

fs_motion LocalScene::Moment::to_motion(const Entry& entry, const std::string& prefix) noexcept {
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

// What a row gives where the tool was, in full.
bool LocalScene::Moment::feel(uint32_t number, Share& out) const {
  const Row& it = row(number);
  const Motion& motion = find_chunk(chunks_, number)->motion(number % chunk_size);
  if (!evaluate_object(*it.object, motion, it.start, tool_, nullptr, out)) return false;
  if (!it.object->law.has_curves()) return true;
  const Law::Parsers parsers = it.object->law.make_parsers();
  return evaluate_object(*it.object, motion, it.start, tool_, &parsers, out);
}

fs_report LocalScene::Moment::report(const Entry& entry, uint32_t number) const {
  const Object& object = *entry.object;
  fs_report out{};
  object.name.copy(out.name, FS_NAME_SIZE - 1);
  out.primitive = object.primitive;
  out.revision = entry.revision;
  const bool is_evaluated = number != no_row;
  if (is_evaluated) {
    out.weight = memory_ ? memory_->weight_at(number, row(number).version, time_) : row(number).is_felt(time_);
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
  out.distance = never;
  if (!is_evaluated || !memory_ || !(tick_.weight > 0)) return out;
  // The versions that fade out have their part of it.
  for (uint32_t version = number; version != no_row; version = row(version).previous) {
    const double weight = tick_.weight * memory_->weight_at(version, row(version).version, time_);
    Share share;
    if (!(weight > 0) || !feel(version, share)) continue;
    if (out.distance == never) {
      out.distance = share.distance;
      out.point = share.point;
    }
    out.wrench.force += weight * share.wrench.force;
    out.wrench.torque += weight * share.wrench.torque;
  }
  return out;
}

std::vector<fs_report> LocalScene::reports() {
  const Moment moment(Ref<LocalScene>::share(this), true);  // what an open group has changed is not felt yet
  std::vector<fs_report> out;
  moment.for_each_report([&](const fs_report& report) { out.push_back(report); });
  return out;
}

fs_report LocalScene::report(const char* name) {
  const Moment moment(Ref<LocalScene>::share(this), true, name);
  fs_report out;
  moment.for_each_report([&](const fs_report& report) { out = report; });
  return out;
}

std::vector<fs_motion> LocalScene::motions(const char* client) {
  require_no_client(client);
  const Moment moment(Ref<LocalScene>::share(this), true);
  std::vector<fs_motion> out;
  moment.for_each_motion("", [&](const fs_motion& motion) { out.push_back(motion); });
  return out;
}

bool LocalScene::take_event(fs_event& out) {
  const std::lock_guard lock(mutex_);
  settle(true);
  if (servo_) events_.collect(*servo_);
  return events_.take(now(), out);
}

void LocalScene::note_edit(const char* name, const char* editor) {
  const std::lock_guard lock(mutex_);
  events_.push(FS_EVENT_EDITED, now(), name, editor);
}

fs_event LocalScene::next_event(double timeout) {
  check_timeout(timeout);
  const double start = steady_now();
  for (;;) {
    fs_event event;
    if (take_event(event)) return event;
    const double rest = timeout - (steady_now() - start);
    if (!(rest > 0)) return {};
    // The servo makes no system call to wake anyone, so this side looks, often enough for a person.
    std::this_thread::sleep_for(std::chrono::duration<double>(std::fmin(rest, 2e-3)));
  }
}
