#include "transfer/records.h"

#include <algorithm>

namespace fs {

void foresee(fs_view& view, const Change& change) {
  if (change.type == wire::type_frame) view.frame = change.as<wire::Frame>().frame;
  if (change.type == wire::type_clutch) view.held = change.as<wire::Clutch>().is_held != 0;
  if (change.type == wire::type_tool_radius) view.point_radius = change.as<wire::ToolRadius>().radius;
  if (change.type != wire::type_tool) return;
  const auto& tool = change.as<wire::Tool>();
  if (tool.count < 1 || tool.count > FS_TOOL_POINTS_MAX) return;
  std::fill(std::begin(view.points), std::end(view.points), Vec3{});
  std::copy_n(tool.points, tool.count, view.points);
  view.point_count = static_cast<uint32_t>(tool.count);
}

wire::Motion to_record(const Motion& m) { return {m.pose, m.twist, m.time, m.horizon}; }

bool from_record(const wire::Motion& r, Motion& motion) noexcept {
  Motion out{r.pose, r.twist, r.time, r.horizon};
  if (!check_motion(out)) return false;
  motion = out;
  return true;
}

Motion from_record(const wire::Motion& r) { return parse_motion({r.pose, r.twist, r.time, r.horizon}, ""); }

}  // namespace fs
