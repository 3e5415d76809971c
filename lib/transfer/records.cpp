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
Enum to_enum(int32_t value) {  // any number: whoever looks at it next checks it
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

wire::Shape to_record(const Shape& shape, Descriptor& data) {
  data = make_blob({bytes_of(shape.points.data(), shape.points.size()),
                    bytes_of(shape.triangles.data(), shape.triangles.size())});
  return {shape.serial, static_cast<uint32_t>(shape.primitive),
          shape.primitive == FS_PRIMITIVE_POLYLINE && shape.closed, shape.points.size(), shape.triangles.size() / 3};
}

wire::Curve to_record(const Curve& curve, Descriptor& data) {
  wire::Curve out{};
  out.id = curve.serial;
  if (const std::vector<double>* table = curve.table()) {
    data = make_blob({bytes_of(table->data(), table->size())});
    out.count = table->size();
    out.step = curve.step();
  } else {
    put_text(out.expression, *curve.expression());
  }
  return out;
}

uint64_t data_size(const wire::Shape& r) {
  const bool is_mesh = r.primitive == FS_PRIMITIVE_MESH;
  if (!is_mesh && r.primitive != FS_PRIMITIVE_POLYLINE) {
    fail(FS_ERROR_INVALID, "the shape's primitive is %u, must be POLYLINE (1) or MESH (3)", r.primitive);
  }
  if (r.point_count > 4'000'000'000 || r.triangle_count > 500'000'000 || (!is_mesh && r.triangle_count != 0)) {
    fail(FS_ERROR_INVALID, "the shape has %llu points and %llu triangles: too many",
         static_cast<unsigned long long>(r.point_count), static_cast<unsigned long long>(r.triangle_count));
  }
  return r.point_count * sizeof(Vec3) + r.triangle_count * 3 * sizeof(uint32_t);
}

uint64_t data_size(const wire::Curve& r) {
  if (r.count > uint64_t{1} << 40) {
    fail(FS_ERROR_INVALID, "the table has %llu entries: too many", static_cast<unsigned long long>(r.count));
  }
  return r.count * sizeof(double);
}

Ref<const Shape> from_record(const wire::Shape& r, Descriptor data, Wanted& wanted) {
  check_blob(data, data_size(r));
  std::vector<Vec3> points(r.point_count);
  std::vector<uint32_t> triangles(3 * r.triangle_count);
  read_blob(data, 0, std::as_writable_bytes(std::span(points)));
  read_blob(data, points.size() * sizeof(Vec3), std::as_writable_bytes(std::span(triangles)));
  data.reset();
  if (r.primitive == FS_PRIMITIVE_POLYLINE) return make_polyline(points.data(), points.size(), r.is_closed != 0, wanted);
  return make_mesh(points.data(), points.size(), triangles.data(), r.triangle_count, wanted);
}

Ref<const Curve> from_record(const wire::Curve& r, Descriptor data) {
  if (r.count == 0) return make_expression_curve(text_of(r.expression).c_str());
  check_blob(data, data_size(r));
  std::vector<double> table(r.count);
  read_blob(data, 0, std::as_writable_bytes(std::span(table)));
  data.reset();
  return make_table_curve(table.data(), table.size(), r.step);
}

void foresee(fs_view& view, wire::Type type, std::span<const std::byte> record) {
  const auto as = [record]<class T>(T out) {
    std::memcpy(&out, record.data(), std::min(record.size(), sizeof out));
    return out;
  };
  if (type == wire::type_frame) view.frame = as(wire::Frame{}).frame;
  if (type == wire::type_clutch) view.held = as(wire::Clutch{}).is_held != 0;
  if (type != wire::type_tool) return;
  const auto tool = as(wire::Tool{});
  if (tool.count < 1 || tool.count > FS_TOOL_POINTS_MAX) return;
  std::fill(std::begin(view.points), std::end(view.points), Vec3{});
  std::copy_n(tool.points, tool.count, view.points);
  view.point_count = static_cast<uint32_t>(tool.count);
}

wire::Movement to_record(const Motion& m) { return {m.pose, m.twist, m.time, m.horizon}; }

bool from_record(const wire::Movement& r, Motion& motion) noexcept {
  Motion out{r.pose, r.twist, r.time, r.horizon};
  if (!make_unit_pose(out.pose) || !is_in_range(r.twist.linear) || !is_in_range(r.twist.angular)) return false;
  if (!std::isfinite(r.time) || !(r.horizon >= 0 && r.horizon <= extrapolation_limit)) return false;
  motion = out;
  return true;
}

Motion from_record(const wire::Movement& r) {
  Motion out;
  if (from_record(r, out)) return out;
  parse_pose(r.pose, "pose");
  parse_twist(r.twist, "twist");
  parse_finite(r.time, "time");
  fail(FS_ERROR_INVALID, "horizon is %g, must be within 0..%g s", r.horizon, extrapolation_limit);
}

}  // namespace fs
