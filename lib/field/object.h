// A force-object as the rest of the core sees it: checked once, immutable, shared by all who look at it.
// parse_object is the only validator: deeper code never checks again.
#pragma once

#include <cmath>
#include <string>

#include <forceserver/scene.h>

#include "base/counted.h"
#include "force/law.h"
#include "force/shape.h"
#include "math/pose.h"

namespace fs {

struct Object : Counted<Object> {
  std::string name;
  fs_primitive primitive = FS_PRIMITIVE_POINT;
  Law law;
  double damping = 0;       // N s/m
  fs_contact contact{};     // keep is NONE: contacts come with the proxy
  Ref<const Shape> shape;   // built, where anybody evaluates
  uint32_t tool_points = 0;  // as the contract has it: 0 is all
  double lifetime = 0;      // s, 0: without end
  bool is_enabled = true;

  // Worked out when it is admitted.
  double radius = 0;           // m, of the primitive about its origin; a plane: infinite
  double steepest_slope = 0;   // N/m, of the force in the distance; infinite where it jumps
  uint32_t point_mask() const noexcept { return tool_points ? tool_points : ~0u; }

  // What cannot change while it is felt but by fading from one version to the other.
  bool is_same_version(const Object& other) const noexcept {
    return primitive == other.primitive && shape == other.shape && point_mask() == other.point_mask();
  }
};

// What fs_object_set is given, checked. Times that are 0 are left for the scene, which knows its clock.
struct ParsedObject {
  Ref<const Object> object;
  Pose pose;
  Twist twist;
  double time, start;
};

// Checks every field, builds the shape's tree, works out what depends on the whole. Throws INVALID (the sentence begins
// with the object's name), VERSION, UNSUPPORTED.
// like: an object of which much may be the same, and need not be worked out again; may be null.
// builds_shape: false where nobody evaluates the object yet.
ParsedObject parse_object(const fs_object& object, const Object* like = nullptr, bool builds_shape = true);

// Only what stands in `parts` (fs_part bits) is taken from `change`, the rest from `object`; both as the contract has them.
fs_object merge_parts(const fs_object& object, const fs_object& change, uint32_t parts);

// The other way, all but pose, twist, time and start. Handles are borrowed.
fs_object to_c(const Object& object);

// The checks that others need too. `field` is the name in the sentence. All throw INVALID.
std::string parse_name(const char* name, const char* field);
Pose parse_pose(const Pose& pose, const char* field);  // zero orientation: identity; within 1e-3 of unit: normalised
Vec3 parse_position(Vec3 v, const char* field);
Twist parse_twist(const Twist& twist, const char* field);
double parse_finite(double value, const char* field);

// [rt] The same for a pose without a sentence: false when it is not a pose. Normalises in place.
bool make_unit_pose(Pose& pose) noexcept;

// fs_part bits. INVALID.
inline constexpr uint32_t all_parts = FS_PART_POSE | FS_PART_PROFILES | FS_PART_CONTACT | FS_PART_SHAPE | FS_PART_OTHER;
uint32_t parse_parts(uint64_t parts);

// struct_size of what a caller made: larger than ours throws VERSION, smaller INVALID.
void check_struct_size(uint32_t given, size_t ours, const char* type);

}  // namespace fs
