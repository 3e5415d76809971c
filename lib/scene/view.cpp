// Frame, clutch and tool of a scene: where its tool stands.
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
fs_frame LocalScene::present_frame() const { return group_ && group_->view.frame ? *group_->view.frame : views_.frame(); }

std::vector<Vec3> LocalScene::present_tool() const {
  return group_ && group_->view.points ? *group_->view.points : views_.now().tool->points;
}

// Takes a wish, all checked: into the group, or at once.
void LocalScene::change_view(ViewChange change) {
  if (group_) {
    group_->view.add(std::move(change));
  } else {
    views_.change(change);
  }
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

// The tool stands where the last tick had it, or where the clutch holds it.
fs_view LocalScene::view(bool with_group) const {
  const std::lock_guard lock(mutex_);
  const ViewChange wanted = with_group && group_ ? group_->view : ViewChange{};
  fs_view out{};
  out.frame = wanted.frame ? *wanted.frame : views_.frame();
  const std::vector<Vec3>& points = wanted.points ? *wanted.points : views_.now().tool->points;
  std::copy(points.begin(), points.end(), out.points);
  out.point_count = static_cast<uint32_t>(points.size());
  out.held = wanted.held.value_or(views_.now().is_held);
  HandSample hand;
  out.tool = servo_ && output->hand.read(hand) ? hand.state.pose : identity_pose();
  views_.get_held(out.tool);
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
    fail(FS_ERROR_UNSUPPORTED, "stiffness is %g: version %s of this library has no slope caps, must be 0", stiffness,
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
