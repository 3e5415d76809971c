#include "field/object.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/enum.h"
#include "base/error.h"
#include "base/grown.h"
#include "base/names.h"

namespace fs {
namespace {

double parse_range(double value, double low, double high, const char* field) {
  if (!(value >= low && value <= high)) {
    fail(FS_ERROR_INVALID, "%s is %.9g, must be within %.9g..%.9g", field, value, low, high);
  }
  return value;
}

// Length of the UTF-8 sequence at text, 0 when it is not one (RFC 3629: no overlong forms, surrogates, above U+10FFFF).
size_t utf8_length(const unsigned char* text) {
  const auto is_tail = [](unsigned char c) { return (c & 0xc0) == 0x80; };
  if (text[0] < 0x80) return 1;
  if (text[0] >= 0xc2 && text[0] <= 0xdf) return is_tail(text[1]) ? 2 : 0;
  if (text[0] >= 0xe0 && text[0] <= 0xef) {
    if (!is_tail(text[1]) || !is_tail(text[2])) return 0;
    if (text[0] == 0xe0 && text[1] < 0xa0) return 0;
    if (text[0] == 0xed && text[1] > 0x9f) return 0;
    return 3;
  }
  if (text[0] >= 0xf0 && text[0] <= 0xf4) {
    if (!is_tail(text[1]) || !is_tail(text[2]) || !is_tail(text[3])) return 0;
    if (text[0] == 0xf0 && text[1] < 0x90) return 0;
    if (text[0] == 0xf4 && text[1] > 0x8f) return 0;
    return 4;
  }
  return 0;
}

bool has_surface(fs_primitive primitive) { return primitive == FS_PRIMITIVE_PLANE || primitive == FS_PRIMITIVE_MESH; }
bool has_shape(fs_primitive primitive) { return primitive == FS_PRIMITIVE_POLYLINE || primitive == FS_PRIMITIVE_MESH; }

const char* primitive_name(fs_primitive primitive) { return without_prefix(primitive_names[primitive]); }

void check_contact(const fs_contact& contact, fs_primitive primitive) {
  const int32_t keep = raw_value(contact.keep);
  if (keep < FS_KEEP_NONE || keep > FS_KEEP_EITHER) {
    fail(FS_ERROR_INVALID, "contact.keep is %d, must be an fs_keep (0..3)", keep);
  }
  if (contact.reserved_32) fail(FS_ERROR_INVALID, "contact.reserved_32 is %u, must be 0", contact.reserved_32);
  check_reserved(contact.reserved, "contact");
  parse_range(contact.stiffness, 0, 1e9, "contact.stiffness");
  parse_range(contact.limit, 0, 1e9, "contact.limit");
  parse_range(contact.damping, 0, 1e9, "contact.damping");
  parse_range(contact.friction, 0, 2, "contact.friction");
  if (contact.keep == FS_KEEP_NONE) return;  // the rest waits for the next time it is made solid
  if (!has_surface(primitive)) {
    fail(FS_ERROR_INVALID, "contact.keep is %d, must be NONE (0) for a %s", keep, primitive_name(primitive));
  }
  if (!(contact.limit > 0)) fail(FS_ERROR_INVALID, "contact.limit is %.9g, must be > 0 N", contact.limit);
}

void check_surface(const fs_object& in) {
  if (!in.surface) return;
  if (!has_surface(in.primitive)) {
    fail(FS_ERROR_INVALID, "surface is given, must be null for a %s", primitive_name(in.primitive));
  }
  if (in.surface->settings.static_friction > 0 && in.contact.friction > 0) {
    fail(FS_ERROR_INVALID, "contact.friction is %.9g, must be 0 where the surface has a static_friction (it has %.9g)",
         in.contact.friction, in.surface->settings.static_friction);
  }
}

// N/m, of a contact of this stiffness with this part of the texture's heights: see object.h, Surfaces.
double contact_slope(const Object& object, double stiffness, double part) {
  const Texture* const texture = object.texture();
  if (!texture) return stiffness;
  const double steepest = part * texture->steepest();
  const double along = stiffness * steepest * steepest + part * object.contact.limit * texture->most_curved();
  return 0.5 * (stiffness + along + std::hypot(stiffness - along, 2 * stiffness * steepest));
}

// Gives the contact a stiffness and its texture a part of its heights, so that its slope is at most `most`, N/m.
void bound_contact(Object& object, double most) {
  double& stiffness = object.contact.stiffness;
  stiffness = stiffness > 0 ? std::fmin(stiffness, most) : most;
  const Texture* const texture = object.texture();
  if (!texture || contact_slope(object, stiffness, 1) <= most) return;
  // contact_slope() = most is linear in the stiffness, and quadratic in the part.
  const double square = texture->steepest() * texture->steepest(), linear = object.contact.limit * texture->most_curved();
  const double fits_whole = most > linear ? most * (most - linear) / (most * (1 + square) - linear) : 0;
  stiffness = std::fmin(stiffness, std::fmax(least_stiffness_part * most, fits_whole));
  const double left = most - stiffness, b = linear * left, c = most * left;
  object.texture_part = std::fmin(1, 2 * c / (b + std::sqrt(b * b + 4 * stiffness * square * most * c)));
}

// The steepest slope of the force, infinite where it jumps: fs_report has the list.
double object_slope(const Object& object) {
  // A polyline that is not straight is no convex set, so some places have two closest points (Motzkin 1935). These
  // places hang together, from its bends to any distance: if it is felt at all, then at some of them.
  const bool is_bent = object.primitive == FS_PRIMITIVE_POLYLINE && !object.shape->is_straight;
  if (is_bent && is_ever_felt(object.law.front)) return std::numeric_limits<double>::infinity();
  return std::fmax(object.contact_slope, object.law_slope);
}

double enough_slope_of(const Law& law) {
  constexpr double width = 1e-4;  // m, in which no hand can tell how steep it is
  const auto most = [](const Profile& p) { return p.kind == FS_PROFILE_NONE ? 0 : most_between(p, 0, support(p)); };
  const double force = std::fmax(most(law.front), most(law.back));
  return force > 0 ? force / width : no_bound;
}

ParsedObject parse(const fs_object& in, std::string name, const Object* like, bool builds_shape) {
  const int32_t primitive = raw_value(in.primitive);
  if (primitive < FS_PRIMITIVE_POINT || primitive > FS_PRIMITIVE_MESH) {
    fail(FS_ERROR_INVALID, "primitive is %d, must be an fs_primitive (0..3)", primitive);
  }
  for (const uint8_t byte : in.reserved) {
    if (byte) fail(FS_ERROR_INVALID, "reserved is %u, must be 0", byte);
  }
  ParsedObject out;
  const Quat& q = in.pose.orientation;
  if (primitive == FS_PRIMITIVE_PLANE && std::isnan(q.w) && is_in_range(in.pose.position)) {
    fail(FS_ERROR_INVALID,
         "the normal given to fs_wall_init is (%g, %g, %g), must be finite and longer than 0 "
         "(pose.orientation.w is nan)",
         q.x, q.y, q.z);
  }
  out.pose = parse_pose(in.pose, "pose");
  out.twist = parse_twist(in.twist, "twist");
  out.time = parse_finite(in.time, "time");

  out.start = parse_finite(in.start, "start");

  const Ref<Object> made = make_ref<Object>();
  Object& object = *made;
  object.name = std::move(name);
  object.primitive = in.primitive;
  object.lifetime = parse_range(in.lifetime, 0, 1e12, "lifetime");
  object.law.front = parse_profile(in.front, "front");
  object.law.back = parse_profile(in.back, "back");
  if (object.law.back.kind != FS_PROFILE_NONE && !has_surface(in.primitive)) {
    fail(FS_ERROR_INVALID, "back.kind is %d, must be NONE (0): a %s has one profile, front",
         static_cast<int>(object.law.back.kind), primitive_name(in.primitive));
  }
  object.damping = parse_range(in.damping, 0, 1e9, "damping");
  object.tool_points = in.tool_points;
  object.is_enabled = in.enabled;

  if (has_shape(in.primitive)) {
    if (!in.shape) fail(FS_ERROR_INVALID, "shape is null, must be a shape for a %s", primitive_name(in.primitive));
    if (in.shape->primitive != in.primitive) {
      fail(FS_ERROR_INVALID, "shape is of a %s, must be of a %s", primitive_name(in.shape->primitive),
           primitive_name(in.primitive));
    }
    object.shape = Ref<const Shape>::retain(in.shape);
  } else if (in.shape) {
    fail(FS_ERROR_INVALID, "shape is given, must be null for a %s", primitive_name(in.primitive));
  }
  check_contact(in.contact, in.primitive);
  object.contact = in.contact;
  check_surface(in);
  object.surface = Ref<const Surface>::retain(in.surface);

  if (object.shape) {
    if (builds_shape) object.shape->build();
    object.radius = object.shape->radius;
  } else if (in.primitive == FS_PRIMITIVE_PLANE) {
    object.radius = std::numeric_limits<double>::infinity();
  }
  object.law.has_edges = in.primitive == FS_PRIMITIVE_MESH;
  object.law.support = std::fmax(support(object.law.front), support(object.law.back));
  if (object.is_solid()) object.contact_slope = contact_slope(object, stiffness_of(object.contact), 1);
  const bool has_same_force = like && like->primitive == object.primitive && like->shape == object.shape &&
                              like->law.front == object.law.front && like->law.back == object.law.back &&
                              like->contact.keep == object.contact.keep && like->contact_slope == object.contact_slope;
  object.law_slope = has_same_force ? like->law_slope : slope_of(object.law);
  object.steepest_slope = has_same_force ? like->steepest_slope : object_slope(object);
  if (object.jumps()) object.enough_slope = enough_slope_of(object.law);
  out.object = made;
  return out;
}

}  // namespace

uint32_t parse_parts(uint64_t parts) {
  if (parts & ~uint64_t{all_parts}) {
    fail(FS_ERROR_INVALID, "parts is 0x%llx, must be of the fs_part bits 0x%x", static_cast<unsigned long long>(parts),
         all_parts);
  }
  return static_cast<uint32_t>(parts);
}

std::string parse_name(const char* name, const char* field) {
  const size_t size = strnlen(name, FS_NAME_SIZE);
  if (size < 1 || size > longest_name) {
    fail(FS_ERROR_INVALID, "%s is %zu bytes long%s, must be 1..%zu", field, size, size == FS_NAME_SIZE ? " or more" : "",
         longest_name);
  }
  for (size_t i = 0; i < size;) {
    const auto* text = reinterpret_cast<const unsigned char*>(name + i);
    const size_t length = utf8_length(text);
    if (length == 0) fail(FS_ERROR_INVALID, "%s is not UTF-8: byte %zu is 0x%02x", field, i, text[0]);
    if (text[0] == '/') {
      const bool is_client = std::strcmp(field, "client_name") == 0;
      fail(FS_ERROR_INVALID, "%s has a '/' at byte %zu, must be without%s", field, i,
           is_client ? "" : ": another client's object is not set, but changed (fs_object_change)");
    }
    if (text[0] < 0x20 || text[0] == 0x7f || (text[0] == 0xc2 && text[1] < 0xa0)) {
      fail(FS_ERROR_INVALID, "%s has a control character at byte %zu, must be without", field, i);
    }
    i += length;
  }
  return std::string(name, size);
}

double parse_finite(double value, const char* field) {
  if (!std::isfinite(value)) fail(FS_ERROR_INVALID, "%s is %.9g, must be finite", field, value);
  return value;
}

Pose parse_move(const Pose& pose, const Twist* twist, double time) {
  const Pose out = parse_pose(pose, "pose");
  if (twist) parse_twist(*twist, "twist");
  parse_finite(time, "time");
  return out;
}

Vec3 parse_position(Vec3 v, const char* field) {
  if (is_in_range(v)) return v;
  const double components[] = {v.x, v.y, v.z};
  for (int i = 0; i < 3; ++i) {
    if (!(std::fabs(components[i]) <= coordinate_limit)) {
      fail(FS_ERROR_INVALID, "%s.%c is %.9g, must be finite and within %.9g", field, "xyz"[i], components[i], coordinate_limit);
    }
  }
  return v;
}

Twist parse_twist(const Twist& twist, const char* field) {
  if (is_in_range(twist.linear) && is_in_range(twist.angular)) return twist;  // before any text is made
  const std::string name = field;
  return {parse_position(twist.linear, (name + ".linear").c_str()), parse_position(twist.angular, (name + ".angular").c_str())};
}

// The usual case of make_unit_pose, without a root.
static bool is_unit_pose(const Pose& pose) noexcept {
  return is_in_range(pose.position) && std::fabs(dot(pose.orientation, pose.orientation) - 1) <= 1e-15;
}

Pose parse_pose(const Pose& pose, const char* field) {
  if (is_unit_pose(pose)) return pose;  // looked at before it is copied: a copy of what was just written stalls
  Pose unit = pose;
  if (make_unit_pose(unit)) return unit;
  parse_position(pose.position, (std::string(field) + ".position").c_str());
  const Quat q = pose.orientation;
  fail(FS_ERROR_INVALID, "%s.orientation is (%g, %g, %g, %g) of length %.9g, must be within 1e-3 of 1 or all 0", field, q.w, q.x,
       q.y, q.z, norm(q));
}

bool make_unit_pose(Pose& pose) noexcept {
  if (is_unit_pose(pose)) return true;
  if (!is_in_range(pose.position)) return false;
  Quat& q = pose.orientation;
  if (q.w == 0 && q.x == 0 && q.y == 0 && q.z == 0) {
    q = identity_quat();
    return true;
  }
  const double length = norm(q);
  if (!(std::fabs(length - 1) <= 1e-3)) return false;
  if (std::fabs(length - 1) > 1e-15) q = normalized(q);  // one that is unit already keeps its bits
  return true;
}

ParsedObject parse_object(const fs_object& in, const Object* like, bool builds_shape) {
  const std::string name = parse_name(in.name, "name");
  try {
    return parse(in, name, like, builds_shape);
  } catch (Error& error) {
    error.text = "object '" + name + "': " + error.text;
    throw;
  }
}

Bounds of_use(const Bounds& bounds, const Object& object) noexcept {
  Bounds out;
  if (object.law_slope > 0 || object.jumps()) out.slope = bounds.slope;
  if (bounds.slope < no_bound && object.jumps()) out.slope = std::fmin(bounds.slope, object.enough_slope);
  if (object.is_solid()) out.stiffness = bounds.stiffness;
  if (object.damping > 0) out.damping = bounds.damping;
  if (object.is_solid() && object.contact.damping > 0) out.contact_damping = bounds.contact_damping;
  return out;
}

Ref<const Object> bounded(const Object& object, const Bounds& given) {
  const Bounds bounds = of_use(given, object);
  const bool is_solid = object.is_solid();
  // Where only the shape makes it jump, as the bend of a polyline, the law's bound is that of the bend.
  const bool is_law_bounded = bounds.slope < object.law_slope || (bounds.slope < no_bound && object.jumps());
  const bool is_contact_bounded =
      is_solid && (object.contact.stiffness == 0 || bounds.stiffness < object.contact_slope) && bounds.stiffness < no_bound;
  const bool is_damping_bounded =
      bounds.damping < object.damping || (is_solid && bounds.contact_damping < object.contact.damping);
  if (!is_law_bounded && !is_contact_bounded && !is_damping_bounded) return nullptr;
  const Ref<Object> out = make_ref<Object>(object);
  if (is_law_bounded) out->law = capped(object.law, bounds.slope);
  if (is_contact_bounded) bound_contact(*out, bounds.stiffness);
  out->damping = std::fmin(object.damping, bounds.damping);
  out->contact.damping = std::fmin(object.contact.damping, bounds.contact_damping);
  out->bounds = bounds;
  out->law_slope = std::fmin(object.law_slope, bounds.slope);
  if (is_solid) out->contact_slope = contact_slope(*out, stiffness_of(out->contact), out->texture_part);
  out->steepest_slope = std::fmax(out->contact_slope, is_law_bounded ? bounds.slope : object.law_slope);
  return out;
}

double impact_lost(const Object& object, const ImpactLimit& limit, const fs_frame& frame) noexcept {
  if (!object.has_impact() || !object.is_solid()) return 0;
  constexpr double speed = 0.3;  // m/s at the device
  const Impact asked = object.surface->impact();
  const double stiffness = stiffness_of(object.contact) * frame.scale * frame.force_scale;
  const double wanted = frame.force_scale * std::fmin(asked.gain * speed * frame.scale, object.contact.limit);
  return wanted > 0 ? 1 - std::fmin(1, limit.most(limit.bounded(asked, stiffness), speed, 0, 0) / wanted) : 0;
}

fs_object merge_parts(const fs_object& object, const fs_object& change, uint32_t parts) {
  fs_object merged = object;
  const auto take = [&](uint32_t part, auto fs_object::* field) {
    if ((parts & part) && knows(change, change.*field)) merged.*field = change.*field;
  };
  take(FS_PART_POSE, &fs_object::pose);
  take(FS_PART_POSE, &fs_object::twist);
  take(FS_PART_POSE, &fs_object::time);
  take(FS_PART_PROFILES, &fs_object::front);
  take(FS_PART_PROFILES, &fs_object::back);
  take(FS_PART_PROFILES, &fs_object::damping);
  take(FS_PART_PROFILES, &fs_object::start);
  take(FS_PART_CONTACT, &fs_object::contact);
  take(FS_PART_CONTACT, &fs_object::surface);
  if (parts & FS_PART_SHAPE) std::memcpy(&merged.primitive, &change.primitive, sizeof merged.primitive);  // checked later
  take(FS_PART_SHAPE, &fs_object::shape);
  take(FS_PART_OTHER, &fs_object::lifetime);
  take(FS_PART_OTHER, &fs_object::tool_points);
  take(FS_PART_OTHER, &fs_object::enabled);
  return merged;
}

fs_object to_c(const Object& object) {
  fs_object out = fs_object_init(object.name.c_str(), object.primitive);
  out.lifetime = object.lifetime;
  out.front = to_c(object.law.front);
  out.back = to_c(object.law.back);
  out.damping = object.damping;
  out.contact = object.contact;
  out.surface = const_cast<fs_surface*>(object.surface.get());
  out.shape = const_cast<fs_shape*>(object.shape.get());
  out.tool_points = object.tool_points;
  out.enabled = object.is_enabled;
  return out;
}

}  // namespace fs
