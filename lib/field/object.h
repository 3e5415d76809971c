// A force-object as the rest of the core sees it: checked once, immutable and shared. parse_object is the only
// validator; deeper code does not check again.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <forceserver/scene.h>

#include "base/counted.h"
#include "law/law.h"
#include "law/surface.h"
#include "math/pose.h"
#include "shape/shape.h"

namespace fs {

// N/m, of the spring of a contact.
inline double stiffness_of(const fs_contact& contact) noexcept {
  constexpr double unasked = 1000;
  return contact.stiffness > 0 ? contact.stiffness : unasked;
}

// Of what a contact may have, its texture leaves it this part.
inline constexpr double least_stiffness_part = 0.8;

inline constexpr double no_bound = std::numeric_limits<double>::infinity();

// What a servo lets an object have.
struct Bounds {
  double slope = no_bound;            // N/m, of its law
  double stiffness = no_bound;        // N/m, of its contact on each point of a tool
  double damping = no_bound;          // N s/m
  double contact_damping = no_bound;  // N s/m
};

struct Object : Counted<Object> {
  std::string name;
  fs_primitive primitive = FS_PRIMITIVE_POINT;
  Law law;
  double damping = 0;       // N s/m
  fs_contact contact{};
  Ref<const Surface> surface;  // null: only the friction of the contact
  Ref<const Shape> shape;   // its tree is built if anybody evaluates the object
  uint32_t tool_points = 0;  // as the contract has it: 0 is all
  double lifetime = 0;      // s, 0: without end
  bool is_enabled = true;

  // Worked out by parse_object.
  double radius = 0;           // m, of the primitive about its origin; a plane: infinite
  double law_slope = 0;        // N/m, of the law; infinite where it jumps
  double steepest_slope = 0;   // N/m, of law, contact and shape together; infinite where the force jumps
  double enough_slope = no_bound;  // N/m: with this slope a jump is spread over 0.1 mm, and more is never asked for
  Bounds bounds;               // within which it was put: see bounded()
  double texture_part = 1;     // of the heights of its texture that is felt
  double contact_slope = 0;    // N/m, of its contact with the texture on one point of a tool
  bool is_solid() const noexcept { return contact.keep != FS_KEEP_NONE; }
  Friction friction() const noexcept {
    if (!surface || !(surface->settings.static_friction > 0)) return {contact.friction, 0, 0};
    const fs_surface_settings& own = surface->settings;
    return {own.static_friction, own.static_friction - own.dynamic_friction, own.slip_distance};
  }
  const Texture* texture() const noexcept { return surface && surface->texture ? &*surface->texture : nullptr; }
  bool has_impact() const noexcept { return surface && surface->settings.impact_gain > 0; }
  // How steep the texture is at most, as it is felt.
  double texture_slope() const noexcept { return texture() ? texture_part * texture()->steepest() : 0; }
  // Places that are equally near to two of its parts, where a repulsive force turns at once (ridge.h).
  bool has_ridges() const noexcept {
    const bool has_parts = primitive == FS_PRIMITIVE_MESH || (primitive == FS_PRIMITIVE_POLYLINE && !shape->is_straight);
    const auto repels = [](const Profile& p) { return p.kind != FS_PROFILE_NONE && p.sense == FS_SENSE_REPULSIVE; };
    return has_parts && (repels(law.front) || repels(law.back));
  }
  // Its force is steeper somewhere than any slope.
  bool jumps() const noexcept { return !(steepest_slope < no_bound) || has_ridges(); }
  // m: it cannot be felt farther away; below 0: nowhere. On the wrong side of a solid plane or envelope it is felt everywhere.
  double support() const noexcept {
    if (!is_solid()) return law.support;
    const bool is_endless = primitive == FS_PRIMITIVE_PLANE || contact.keep == FS_KEEP_BACK ||
                            (contact.keep == FS_KEEP_FRONT && shape->has_inward_parts);
    return is_endless ? std::numeric_limits<double>::infinity() : std::max(law.support, radius);
  }
  // m: farther away its force is at most `omitted` (N; 0: there is none).
  double support(double omitted) const noexcept {
    if (!(omitted > 0) || !has_tail()) return support();
    return std::max(support_above(law.front, omitted), support_above(law.back, omitted));
  }
  // Whether that may be less. Damping is not: it can be large where the force of the profile is small.
  bool has_tail() const noexcept { return !is_solid() && damping == 0 && (fs::has_tail(law.front) || fs::has_tail(law.back)); }
  uint32_t point_mask() const noexcept { return tool_points ? tool_points : ~0u; }

  // False: the object cannot be adjusted to the other one while it is felt; the two must cross-fade (weight.h).
  bool is_same_version(const Object& other) const noexcept {
    return primitive == other.primitive && shape == other.shape && point_mask() == other.point_mask();
  }
  // Whether the other one, of the same version, gives the same force.
  bool feels_like(const Object& other) const noexcept {
    const fs_contact &a = contact, &b = other.contact;
    return law.front == other.law.front && law.back == other.law.back && damping == other.damping && a.keep == b.keep &&
           a.stiffness == b.stiffness && a.limit == b.limit && a.damping == b.damping && a.friction == b.friction &&
           surface == other.surface && texture_part == other.texture_part;
  }
};

// The checked argument of fs_object_set. A time of 0 stays 0: the scene, which knows its clock, replaces it.
struct ParsedObject {
  Ref<const Object> object;
  Pose pose;
  Twist twist;
  double time, start;
};

// Checks every field, builds the shape's tree and works out the derived fields. Throws INVALID (the sentence begins with
// the object's name); STATE: the process is ending.
// like: an earlier version of the object, whose slopes are used again if the profiles are the same; may be null.
// builds_shape: false as long as nobody evaluates the object.
ParsedObject parse_object(const fs_object& object, const Object* like = nullptr, bool builds_shape = true);

// The object with the given parts (fs_part bits) of `change`, as far as its caller knows them: beyond its struct_size the object
// stays as it is.
fs_object merge_parts(const fs_object& object, const fs_object& change, uint32_t parts);

// The object as a servo evaluates it, within these bounds. Null: they change nothing.
Ref<const Object> bounded(const Object& object, const Bounds& bounds);
Bounds of_use(const Bounds& bounds, const Object& object) noexcept;  // without those that the object needs not

// What fs_report.impact_lost says. frame: through which a servo feels it.
double impact_lost(const Object& object, const ImpactLimit& limit, const fs_frame& frame) noexcept;

// The contract's form of an object, without pose, twist, time and start. Its handles are borrowed.
fs_object to_c(const Object& object);

// Bytes of the name of an object or client: "client/object" fits into FS_NAME_SIZE.
inline constexpr size_t longest_name = 63;
static_assert(2 * longest_name + 2 <= FS_NAME_SIZE);

// Checks of single fields. `field` names the field in the sentence. All throw INVALID.
std::string parse_name(const char* name, const char* field);
Pose parse_pose(const Pose& pose, const char* field);  // zero orientation: identity; within 1e-3 of unit: normalised
Vec3 parse_position(Vec3 v, const char* field);
Twist parse_twist(const Twist& twist, const char* field);
double parse_finite(double value, const char* field);
Pose parse_move(const Pose& pose, const Twist* twist, double time);  // the pose; null: no twist is given

// [rt] As parse_pose, but in place and without a sentence; false: it is not a pose.
bool make_unit_pose(Pose& pose) noexcept;

// fs_part bits. INVALID.
inline constexpr uint32_t all_parts = FS_PART_POSE | FS_PART_PROFILES | FS_PART_CONTACT | FS_PART_SHAPE | FS_PART_OTHER;
uint32_t parse_parts(uint64_t parts);

}  // namespace fs
