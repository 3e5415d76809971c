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

// The frame as it is, or as an open group wants it.
fs_frame fs_scene::present_frame() const {
  if (group_ && group_->view.frame) return *group_->view.frame;
  fs_frame frame;
  views_.view->get_frame(frame);
  return frame;
}

const std::vector<Vec3>& fs_scene::present_tool() const {
  return group_ && group_->view.points ? *group_->view.points : views_.view->points;
}

// Takes a wish, all checked: into the group, or at once.
void fs_scene::change_view(ViewChange change) {
  if (!group_) return transit_view(change);
  if (change.frame) group_->view.frame = change.frame;
  if (change.points) group_->view.points = std::move(change.points);
  if (change.held) group_->view.held = change.held;
}

// How the present view becomes the one that is wanted: without a step.
void fs_scene::transit_view(const ViewChange& change) {
  const Ref<const View> old = views_.view;
  const bool was_held = old->kind == View::Kind::held;
  const bool is_held = change.held.value_or(was_held);
  const bool is_elsewhere = change.frame || change.points;
  if (is_held == was_held && !is_elsewhere) return;

  Pose tool;
  const bool is_found = servo_ && old->found.read(tool);
  const Ref<View> view = make_ref<View>();
  const bool is_resolved = old->get_frame(view->frame);
  view->points = change.points ? *change.points : old->points;
  if (change.frame) view->frame = *change.frame;

  if (is_held) {
    view->kind = View::Kind::held;
    if (was_held && is_found) view->found.write(tool);
    if (is_elsewhere) return replace_view(view, false);
    // The same view, standing still: its force fades from the weight it has. No second version is needed. One that was let
    // go, without a tick since, goes back to where it was held.
    views_.view = is_resolved ? Ref<const View>(view) : old->anchor;
    views_.fade = turned(views_.fade, false, never);
    return;
  }
  if (!change.frame && was_held && is_found) {  // let go: the frame follows the hand
    view->kind = View::Kind::rebased;
    view->anchor = old;
  } else if (!change.frame && !is_resolved) {  // let go, and no tick has come by yet
    view->kind = View::Kind::rebased;
    view->anchor = old->anchor;
  }
  if (was_held && !is_found && !is_elsewhere) {  // no servo, or no tick since it was held
    views_.view = view;
    views_.fade = turned(views_.fade, true, never);
    return;
  }
  replace_view(view, true);
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

void fs_scene::set_frame(const fs_frame& frame) {
  const fs_frame parsed = parse_frame(frame);
  mutate([&] { change_view({parsed, {}, {}}); });
}

void fs_scene::set_tool(const Vec3* points, size_t count) {
  check_tool(points, count);
  mutate([&] { change_view({{}, std::vector<Vec3>(points, points + count), {}}); });
}

void fs_scene::set_clutch(bool held) {
  mutate([&] { change_view({{}, {}, held}); });
}

fs_frame fs_scene::get_frame() const {
  const std::lock_guard lock(mutex_);
  return present_frame();
}

std::vector<Vec3> fs_scene::get_tool() const {
  const std::lock_guard lock(mutex_);
  return present_tool();
}
