#include "scene/view_rows.h"

#include <algorithm>

#include "base/error.h"

namespace fs {

void ViewChange::add(ViewChange later) {
  if (later.frame) frame = later.frame;
  if (later.points) points = std::move(later.points);
  if (later.held) held = later.held;
  if (later.point_radius) point_radius = later.point_radius;
}

Ref<Views> ViewRows::first() {
  Ref<Views> views = make_ref<Views>();
  views->rows[0].version = 1;
  views->rows[0].is_in = true;
  views->rows[0].tool = make_ref<ToolPoints>();
  return views;
}

void ViewRows::own(uint32_t) {
  if (!views_->is_unique()) views_ = make_ref<Views>(*views_);
}

void ViewRows::drop(uint32_t i) noexcept {
  views_->rows[i] = {};
  free_at_[i] = sequence_;
}

std::vector<uint32_t> ViewRows::free_rows() const {
  std::vector<uint32_t> out;
  for (uint32_t i = 0; i < Views::size; ++i) {
    if (views_->rows[i].version == 0 && (!servo_ || free_at_[i] <= used())) out.push_back(i);
  }
  return out;
}

void ViewRows::change(const ViewChange& change) {
  const auto wanted = [&](const View& from, bool is_another) {
    View view = from;
    if (change.frame) {
      view.frame = *change.frame;
      view.has_own_frame = true;
    } else if (is_another) {
      view.has_own_frame = false;
    }
    if (change.points || change.point_radius) {
      view.tool =
          make_ref<ToolPoints>(change.points.value_or(from.tool->points), change.point_radius.value_or(from.tool->point_radius));
    }
    view.is_held = change.held.value_or(from.is_held);
    view.was_held = view.is_held || (from.was_held && !change.frame);
    view.is_in = !view.is_held;
    view.sequence = sequence_;
    view.next = no_row;
    return view;
  };
  const auto hold_older = [&] {  // older views are held too, so that the whole scene stops
    for (uint32_t i = now().previous; i != no_row; i = views_->rows[i].previous) {
      View& view = views_->rows[i];
      if (view.is_in) view.sequence = sequence_;
      view.is_held = view.was_held = true;
      view.is_in = false;
    }
  };
  const bool is_elsewhere = change.frame || change.points || change.point_radius;
  if (!is_elsewhere && change.held.value_or(now().is_held) == now().is_held) return;
  for (;;) {
    if (servo_) tidy_older(views_->newest);
    own(views_->newest);
    const uint32_t newest = views_->newest;
    const std::vector<uint32_t> free = free_rows();
    // A view may be replaced as long as no tick can know it. One that was posted belongs to a group that is felt as a
    // whole, so the new one comes after it. When rows become few, because many come between two ticks, what was posted is
    // taken back if no tick has it yet.
    const bool is_replaced =
        servo_ && (now().created == sequence_ || (free.size() <= reserve && servo_->take_back(now().created)));
    if (!is_elsewhere || !servo_ || is_replaced) {
      View view = wanted(now(), false);
      if (is_elsewhere) {
        view.version = ++last_version_;
        view.created = sequence_;
        Weight* const weight = this->weight(newest);
        if (weight && has_begun(newest)) weight->set_up(view.version, false, 0);
        else if (weight && !weight->replace_waiting(now().version, view.version)) continue;
      }
      views_->rows[newest] = view;
    } else {
      if (free.empty()) fail(FS_ERROR_INTERNAL, "no row is free for another view");
      const uint32_t i = free.front();
      const bool waits = now().is_in || now().previous != no_row;
      View view = wanted(now(), true);
      view.version = ++last_version_;
      view.created = sequence_;
      view.previous = newest;
      servo_->memory->views.weight(i).set_up(view.version, waits, 0);
      if (waits) views_->rows[newest].next = i;
      views_->rows[newest].newer = i;
      views_->rows[i] = view;
      views_->newest = i;
    }
    if (now().is_held) hold_older();
    return;
  }
}

// What the tick has found out about a view, or about the one that it goes on from.
bool ViewRows::find(uint32_t i, FoundView& out) const noexcept {
  if (!servo_) return false;
  const View& view = views_->rows[i];
  if (servo_->memory->views.get_found(i, view.version, out)) return true;
  if (view.previous == no_row || !find(view.previous, out)) return false;
  if (view.has_own_frame) out.is_moved = 0;
  return true;
}

fs_frame ViewRows::frame() const noexcept {
  fs_frame frame = now().frame;
  FoundView found;
  if (find(views_->newest, found) && found.is_moved) frame.pose = found.frame;
  return frame;
}

bool ViewRows::get_held(Pose& tool) const noexcept {
  FoundView found;
  if (!find(views_->newest, found) || !found.is_held) return false;
  tool = found.tool;
  return true;
}

void ViewRows::attach_servo(Reader& reader) noexcept {
  servo_ = &reader;
  std::fill(std::begin(free_at_), std::end(free_at_), 0);  // what it says is of a servo that is no more
  reader.memory->views.weight(views_->newest).set_up(now().version, false, now().is_in ? 1 : 0);
}

Ref<Views> ViewRows::settled() const {
  Ref<Views> out = make_ref<Views>();
  out->rows[0] = now();
  View& view = out->rows[0];
  view.frame = frame();
  view.was_held = view.is_held;
  view.has_own_frame = true;
  view.previous = view.newer = view.next = no_row;
  return out;
}

}  // namespace fs
