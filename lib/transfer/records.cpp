#include "transfer/records.h"

#include <algorithm>

namespace fs {

std::optional<size_t> record_size(uint32_t type, const RecordSizes& common) noexcept {
  using namespace wire;
  if (const auto end = growing_end(type)) return sent_size(*end, common);
  switch (type) {
    case type_shape: return sizeof(wire::Shape);
    case type_curve: return sizeof(wire::Curve);
    case type_forget: return sizeof(Forget);
    case type_place: return sizeof(Place);
    case type_remove: return sizeof(Remove);
    case type_frame: return sizeof(Frame);
    case type_clutch: return sizeof(Clutch);
    case type_tool: return sizeof(wire::Tool);
    case type_accuracy: return sizeof(Accuracy);
    case type_max_stiffness: return sizeof(MaxStiffness);
    case type_bind: return sizeof(Bind);
    case type_clear:
    case type_wake:
    case type_sync:
    case type_reports:
    case type_clients:
    case type_views:
    case type_stats:
    case type_stop_force:
    case type_resume_force:
    case type_device: return 0;
    case type_get:
    case type_pull:
    case type_report:
    case type_view:
    case type_motions: return sizeof(Target);
    case type_fetch: return sizeof(Fetch);
    case type_record: return sizeof(After);
    default: return {};
  }
}

void foresee(fs_view& view, const Change& change) {
  if (change.type == wire::type_frame) view.frame = change.as<wire::Frame>().frame;
  if (change.type == wire::type_clutch) view.held = change.as<wire::Clutch>().is_held != 0;
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
