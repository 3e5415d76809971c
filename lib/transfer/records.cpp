#include "transfer/records.h"

#include <algorithm>
#include <cmath>

#include "base/enum.h"
#include "base/error.h"

namespace fs {
namespace {

wire::Profile to_record(const fs_profile& p) {
  return {raw_value(p.kind), raw_value(p.sense), p.gain, p.offset, p.width, p.limit, p.reach, 0};
}

template <class Enum>
Enum to_enum(int32_t value) {  // it may be any number: it is checked where it is used
  Enum out;
  std::memcpy(&out, &value, sizeof out);
  return out;
}

fs_profile from_record(const wire::Profile& p) {
  fs_profile out{};
  out.kind = to_enum<fs_profile_kind>(p.kind);
  out.sense = to_enum<fs_sense>(p.sense);
  out.gain = p.gain;
  out.offset = p.offset;
  out.width = p.width;
  out.limit = p.limit;
  out.reach = p.reach;
  return out;
}

}  // namespace

wire::Object to_record(const fs_object& o) {
  wire::Object out{};
  std::memcpy(out.name, o.name, sizeof out.name);
  out.primitive = raw_value(o.primitive);
  out.tool_points = o.tool_points;
  out.pose = o.pose;
  out.twist = o.twist;
  out.time = o.time;
  out.start = o.start;
  out.lifetime = o.lifetime;
  out.front = to_record(o.front);
  out.back = to_record(o.back);
  out.damping = o.damping;
  out.keep = raw_value(o.contact.keep);
  out.is_enabled = o.enabled;
  out.contact_stiffness = o.contact.stiffness;
  out.contact_limit = o.contact.limit;
  out.contact_damping = o.contact.damping;
  out.contact_friction = o.contact.friction;
  return out;
}

fs_object from_record(const wire::Object& r) {
  fs_object out = fs_object_init(nullptr, FS_PRIMITIVE_POINT);
  std::memcpy(out.name, r.name, sizeof out.name);
  out.primitive = to_enum<fs_primitive>(r.primitive);
  out.tool_points = r.tool_points;
  out.pose = r.pose;
  out.twist = r.twist;
  out.time = r.time;
  out.start = r.start;
  out.lifetime = r.lifetime;
  out.front = from_record(r.front);
  out.back = from_record(r.back);
  out.damping = r.damping;
  out.contact.keep = to_enum<fs_keep>(r.keep);
  out.enabled = r.is_enabled != 0;
  out.contact.stiffness = r.contact_stiffness;
  out.contact.limit = r.contact_limit;
  out.contact.damping = r.contact_damping;
  out.contact.friction = r.contact_friction;
  return out;
}

std::optional<size_t> record_size(uint32_t type) noexcept {
  using namespace wire;
  switch (type) {
    case type_shape: return sizeof(wire::Shape);
    case type_curve: return sizeof(wire::Curve);
    case type_forget: return sizeof(Forget);
    case type_set:
    case type_change: return sizeof(Set);
    case type_place: return sizeof(Place);
    case type_remove: return sizeof(Remove);
    case type_frame: return sizeof(Frame);
    case type_clutch: return sizeof(Clutch);
    case type_tool: return sizeof(wire::Tool);
    case type_bind: return sizeof(Bind);
    case type_clear:
    case type_wake:
    case type_sync:
    case type_reports:
    case type_clients:
    case type_stats:
    case type_device: return 0;
    case type_get:
    case type_pull:
    case type_report:
    case type_view:
    case type_motions:
    case type_remove_other: return sizeof(Target);
    case type_fetch: return sizeof(Fetch);
    case type_edit: return sizeof(Edit);
    case type_move_other: return sizeof(MoveOther);
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
  if (!make_unit_pose(out.pose) || !is_in_range(r.twist.linear) || !is_in_range(r.twist.angular)) return false;
  if (!std::isfinite(r.time) || !(r.horizon >= 0 && r.horizon <= extrapolation_limit)) return false;
  motion = out;
  return true;
}

Motion from_record(const wire::Motion& r) {
  Motion out;
  if (from_record(r, out)) return out;
  parse_pose(r.pose, "pose");
  parse_twist(r.twist, "twist");
  parse_finite(r.time, "time");
  fail(FS_ERROR_INVALID, "horizon is %g, must be within 0..%g s", r.horizon, extrapolation_limit);
}

}  // namespace fs
