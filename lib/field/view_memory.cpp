#include "field/view_memory.h"

#include "field/frame.h"

namespace fs {

bool ViewMemory::get_found(uint32_t view, uint64_t version, FoundView& out) const noexcept {
  return all_[view].published.read(out) && out.version == version;
}

double ViewMemory::weight_at(uint32_t view, uint64_t version) const noexcept {
  const Weight& weight = all_[view].weight;
  return weight.has_begun(version) ? weight.value() : 0;
}

void ViewMemory::advance(const Views& views, double now, double fade) noexcept {
  double by = Weight::part_of_fade(now - since_, fade);
  since_ = now;
  bool is_any_beginning;
  do {
    is_any_beginning = false;  // a view that begins may stand in a row that was looked at before
    for (uint32_t i = 0; i < Views::size; ++i) {
      const View& view = views.rows[i];
      One& m = all_[i];
      if (view.version == 0 || !m.weight.has_begun(view.version)) continue;
      double value = m.weight.value();
      if (m.wanted == view.version)
        value = Weight::moved(value, m.going_in, by);  // by the old wants, before the new ones are read
      m.wanted = view.version;
      Weight* const next = view.next == no_row ? nullptr : &all_[view.next].weight;
      m.weight.set(value);
      m.going_in =
          course_of(view, m.weight, now, next, next ? &views.rows[view.next] : nullptr, !(fade > 0), is_any_beginning).in;
      if (!(fade > 0)) m.weight.set(m.going_in);
    }
    by = 0;
  } while (is_any_beginning);
}

const FoundView& ViewMemory::find(const Views& views, uint32_t i, const Pose& hand) noexcept {
  const View& view = views.rows[i];
  One& m = all_[i];
  FoundView& found = m.found;
  bool is_changed = false;
  if (found.version != view.version) {
    found = {};
    found.version = view.version;
    is_changed = true;
    if (view.previous != no_row) {
      const FoundView& before = find(views, view.previous, hand);
      if (!view.has_own_frame) {
        found.is_moved = before.is_moved;
        found.frame = before.frame;
      }
      if (before.is_held && (view.is_held || !view.has_own_frame)) {
        found.is_held = 1;
        found.tool = before.tool;
      }
    }
  }
  fs_frame frame = view.frame;
  if (found.is_moved) frame.pose = found.frame;
  if (view.is_held && !found.is_held) {
    found.is_held = 1;
    found.tool = to_scene(frame, hand);
    is_changed = true;
  } else if (!view.is_held && found.is_held) {  // let go: the frame moves so that the tool's position does not jump
    const Quat q = frame.pose.orientation;
    found.is_held = 0;
    found.is_moved = 1;
    found.frame = {hand.position - rotate(q, (1 / frame.scale) * found.tool.position), q};
    is_changed = true;
  }
  if (is_changed) m.published.write(found);
  return found;
}

}  // namespace fs
