#include "scene/scene.h"

#include <cmath>

#include "base/error.h"
#include "base/grown.h"
#include "base/text.h"
#include "field/servo_output.h"

namespace fs {

fs_frame parse_frame(const fs_frame& frame) {
  fs_frame out = frame;
  out.pose = parse_pose(frame.pose, "frame.pose");
  if (!(frame.scale >= 1e-9 && frame.scale <= 1e9)) {
    fail(FS_ERROR_INVALID, "frame.scale is %.9g, must be within 1e-9..1e9", frame.scale);
  }
  if (!(frame.force_scale >= 0 && frame.force_scale <= 1e9)) {
    fail(FS_ERROR_INVALID, "frame.force_scale is %.9g, must be within 0..1e9", frame.force_scale);
  }
  check_reserved(frame.reserved, "frame");
  return out;
}

void check_tool(const Vec3* points, size_t count) {
  if (count < 1 || count > FS_TOOL_POINTS_MAX) {
    fail(FS_ERROR_INVALID, "count is %zu points, must be 1..%d", count, FS_TOOL_POINTS_MAX);
  }
  if (!points) fail(FS_ERROR_INVALID, "points is null, must be %zu points", count);
  for (size_t i = 0; i < count; ++i) parse_position(points[i], ("points[" + std::to_string(i) + "]").c_str());
}

void check_tool_radius(double radius) {
  if (!(radius >= 0 && radius <= coordinate_limit)) {
    fail(FS_ERROR_INVALID, "radius is %.9g m, must be within 0..1e15", radius);
  }
}

void check_timeout(double timeout) {
  if (!(timeout >= 0 && std::isfinite(timeout))) {
    fail(FS_ERROR_INVALID, "timeout is %.9g, must be finite and >= 0 s", timeout);
  }
}

void check_accuracy(double newtons) {
  if (!(newtons >= 0 && std::isfinite(newtons))) {
    fail(FS_ERROR_INVALID, "newtons is %.9g, must be finite and >= 0", newtons);
  }
}

void check_max_stiffness(double stiffness) {
  if (!(stiffness >= 0 && std::isfinite(stiffness))) {
    fail(FS_ERROR_INVALID, "stiffness is %.9g, must be finite and >= 0 N/m", stiffness);
  }
}

void require_no_client(const char* client) {
  if (!client) return;
  fail(FS_ERROR_NOT_FOUND, "client is '%s': a scene in this process has no clients; null means its own",
       shortened(client).c_str());
}

fs_status read_hand(const ServoOutput& output, fs_state* state, fs_response* response, fs_wrench* sent) noexcept {
  HandSample hand;
  if (!output.hand.read(hand)) return set_last_error_literal(FS_ERROR_INTERNAL, "the hand could not be read");
  if (state) *state = hand.state;
  if (response) *response = hand.response;
  if (sent) *sent = hand.sent;
  return FS_OK;
}

}  // namespace fs
