// Frame, clutch and tool of a scene: where its tool stands. A new view puts the tool elsewhere, so what was felt through
// the old one fades out while the new fades in.
#include <algorithm>

#include "base/error.h"
#include "scene/local_scene.h"

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
fs_frame LocalScene::present_frame() const {
  if (group_ && group_->view.frame) return *group_->view.frame;
  fs_frame frame;
  views_.view->get_frame(frame);
  return frame;
}

const std::vector<Vec3>& LocalScene::present_tool() const {
  return group_ && group_->view.points ? *group_->view.points : views_.view->points;
}

// Takes a wish, all checked: into the group, or at once.
void LocalScene::change_view(ViewChange change) {
  if (!group_) return transit_view(change);
  if (change.frame) group_->view.frame = change.frame;
  if (change.points) group_->view.points = std::move(change.points);
  if (change.held) group_->view.held = change.held;
}

// How the present view becomes the one that is wanted: without a step.
void LocalScene::transit_view(const ViewChange& change) {
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

void LocalScene::replace_view(Ref<const View> view, bool in) {
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

void LocalScene::set_frame(const fs_frame& frame) {
  const fs_frame parsed = parse_frame(frame);
  mutate([&] { change_view({parsed, {}, {}}); });
}

void LocalScene::set_tool(const Vec3* points, size_t count) {
  check_tool(points, count);
  mutate([&] { change_view({{}, std::vector<Vec3>(points, points + count), {}}); });
}

void LocalScene::set_clutch(bool held) {
  mutate([&] { change_view({{}, {}, held}); });
}

void fs::require_no_client(const char* client) {
  if (!client) return;
  fail(FS_ERROR_NOT_FOUND, "client is '%.80s': a scene in this process has no clients; null means its own", client);
}

fs_frame LocalScene::get_frame(const char* client) {
  require_no_client(client);
  const std::lock_guard lock(mutex_);
  return present_frame();
}

fs_view LocalScene::view(const char* client) {
  require_no_client(client);
  return view(true);
}

// The tool stands where the last tick had it; what holds it has told where, also for one let go that no tick has seen.
fs_view LocalScene::view(bool with_group) const {
  const std::lock_guard lock(mutex_);
  const ViewChange wanted = with_group && group_ ? group_->view : ViewChange{};
  const View& now = *views_.view;
  fs_view out{};
  const bool is_resolved = now.get_frame(out.frame);
  if (wanted.frame) out.frame = *wanted.frame;
  const std::vector<Vec3>& points = wanted.points ? *wanted.points : now.points;
  std::copy(points.begin(), points.end(), out.points);
  out.point_count = static_cast<uint32_t>(points.size());
  out.held = wanted.held.value_or(now.kind == View::Kind::held);

  HandSample hand;
  out.tool = servo_ && output->hand.read(hand) ? hand.state.pose : identity_pose();
  const View* const holder = now.kind == View::Kind::held ? &now : is_resolved ? nullptr : now.anchor.get();
  if (holder) holder->found.read(out.tool);
  return out;
}

void fs::check_accuracy(double newtons) {
  if (!(newtons >= 0 && std::isfinite(newtons))) {
    fail(FS_ERROR_INVALID, "newtons is %g, must be finite and >= 0", newtons);
  }
}

void fs::check_max_stiffness(double stiffness) {
  if (!(stiffness >= 0 && std::isfinite(stiffness))) {
    fail(FS_ERROR_INVALID, "stiffness is %g, must be finite and >= 0 N/m", stiffness);
  }
  if (stiffness > 0) {
    fail(FS_ERROR_UNSUPPORTED, "stiffness is %g: slope caps are not in version %s of this library, only 0", stiffness,
         fs_version());
  }
}

// Evaluation is exact, which is within any error that is allowed.
void LocalScene::set_accuracy(double newtons) { check_accuracy(newtons); }

void LocalScene::set_max_stiffness(double stiffness) { check_max_stiffness(stiffness); }

std::vector<Vec3> LocalScene::get_tool() {
  const std::lock_guard lock(mutex_);
  return present_tool();
}
