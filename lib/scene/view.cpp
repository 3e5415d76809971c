// Frame, clutch and tool of a scene: where its tool stands. A new view puts the tool elsewhere, so what was felt through
// the old one fades out while the new fades in.
#include "base/error.h"
#include "scene/scene.h"

using namespace fs;

fs_frame fs::parse_frame(const fs_frame& frame) {
  fs_frame out = frame;
  out.pose = parse_pose(frame.pose, "frame.pose");
  if (!(frame.scale >= 1e-9 && frame.scale <= 1e9)) {
    fail(FS_ERROR_INVALID, "frame.scale is %g, must be within 1e-9..1e9", frame.scale);
  }
  if (!(frame.force_scale >= 0 && frame.force_scale <= 1e9)) {
    fail(FS_ERROR_INVALID, "frame.force_scale is %g, must be within 0..1e9", frame.force_scale);
  }
  return out;
}

void fs::check_tool(const Vec3* points, size_t count) {
  if (count < 1 || count > FS_TOOL_POINTS_MAX) {
    fail(FS_ERROR_INVALID, "count is %zu points, must be 1..%d", count, FS_TOOL_POINTS_MAX);
  }
  if (!points) fail(FS_ERROR_INVALID, "points is null, must be %zu points", count);
  for (size_t i = 0; i < count; ++i) parse_position(points[i], ("points[" + std::to_string(i) + "]").c_str());
}

// A view to be changed, which stands where the present one does.
Ref<View> fs_scene::copy_view() const {
  const View& old = *views_.view;
  const Ref<View> view = make_ref<View>();
  view->points = old.points;
  if (old.get_frame(view->frame)) {
    view->kind = old.kind == View::Kind::held ? View::Kind::held : View::Kind::free;
    Pose tool;
    if (old.kind == View::Kind::held && old.found.read(tool)) view->found.write(tool);
  } else {  // let go, but no tick has come by yet
    view->kind = View::Kind::rebased;
    view->anchor = old.anchor;
  }
  return view;
}

void fs_scene::replace_view(Ref<const View> view, bool in) {
  if (!servo_) {
    views_ = {std::move(view), nullptr, Fade::steady(in), Fade::steady(false)};
    return;
  }
  if (views_.previous && views_.previous_fade.weight(now(), servo_->fade) > 0) {
    views_.fade = turned(views_.fade, in, never);  // at most one old view is kept
  } else {
    views_.previous = views_.view;
    views_.previous_fade = turned(views_.fade, false, never);
    views_.fade = turned(Fade::steady(false), in, never);
  }
  views_.view = std::move(view);
}

void fs_scene::apply_view(const fs_frame* frame, const Vec3* points, size_t count) {
  const Ref<View> view = copy_view();
  if (frame) {
    view->frame = *frame;
    if (view->kind == View::Kind::rebased) view->kind = View::Kind::free;
  }
  if (points) view->points.assign(points, points + count);
  replace_view(view, view->kind != View::Kind::held);
}

void fs_scene::set_frame(const fs_frame& frame) {
  const fs_frame parsed = parse_frame(frame);
  const std::lock_guard lock(mutex_);
  settle(false);
  apply_view(&parsed, nullptr, 0);
  changed();
}

fs_frame fs_scene::get_frame() const {
  const std::lock_guard lock(mutex_);
  fs_frame frame;
  views_.view->get_frame(frame);
  return frame;
}

void fs_scene::set_tool(const Vec3* points, size_t count) {
  check_tool(points, count);
  const std::lock_guard lock(mutex_);
  settle(false);
  apply_view(nullptr, points, count);
  changed();
}

std::vector<Vec3> fs_scene::get_tool() const {
  const std::lock_guard lock(mutex_);
  return views_.view->points;
}

void fs_scene::set_clutch(bool held) {
  const std::lock_guard lock(mutex_);
  const Ref<const View> old = views_.view;
  if (held == (old->kind == View::Kind::held)) return;
  settle(false);
  Pose tool;
  if (held && old->kind == View::Kind::rebased && !old->found.read(tool)) {
    views_.view = old->anchor;  // let go and held again between two ticks
    views_.fade = turned(views_.fade, false, never);
  } else if (held) {
    // The same view, standing still: its force fades from the weight it has. No second version is needed.
    const Ref<View> view = copy_view();
    view->kind = View::Kind::held;
    views_.view = view;
    views_.fade = turned(views_.fade, false, never);
  } else {
    const Ref<View> view = make_ref<View>();
    view->frame = old->frame;
    view->points = old->points;
    if (servo_ && old->found.read(tool)) {
      view->kind = View::Kind::rebased;
      view->anchor = old;
      replace_view(view, true);
    } else {  // no servo, or no tick since it was held
      views_.view = view;
      views_.fade = turned(views_.fade, true, never);
    }
  }
  changed();
}
