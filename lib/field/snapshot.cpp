#include "field/snapshot.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace fs {

Chunk::Chunk() { std::fill_n(reach, chunk_size, -never); }

template <class T>
static void make_unique(Ref<T>& part) {
  if (!part) {
    part = make_ref<T>();
  } else if (!part->is_unique()) {
    part = make_ref<T>(*part);
  }
}

void Chunk::own(uint32_t i) {
  make_unique(rows);
  own_motion(i);
}

void Chunk::own_motion(uint32_t i) { make_unique(motions[i / Motions::size]); }

Row& Chunk::edit_row(uint32_t i) noexcept {
  used |= uint64_t{1} << i;
  return rows->rows[i];
}

void Chunk::move(uint32_t i, const Motion& motion, uint64_t revision) noexcept {
  Motions& group = *motions[i / Motions::size];
  group.motions[i % Motions::size] = motion;
  group.revision[i % Motions::size] = revision;
  place(i);
}

void Chunk::set_object(uint32_t i, Ref<const Object> given) noexcept {
  const uint64_t bit = uint64_t{1} << i;
  Row& row = edit_row(i);
  row.object = std::move(given);
  const Object& object = *row.object;
  const Profile& f = object.law.front;
  const bool is_linear = object.primitive == FS_PRIMITIVE_POINT && object.damping == 0 && object.point_mask() == ~0u &&
                         (f.kind == FS_PROFILE_CONSTANT || f.kind == FS_PROFILE_LINEAR_INCREASING ||
                          f.kind == FS_PROFILE_LINEAR_DECREASING) &&
                         std::fabs(f.gain) < 1e100;
  if (is_linear) {
    rows->linear |= bit;
    rows->offset[i] = f.kind == FS_PROFILE_CONSTANT ? f.gain : f.offset;
    rows->gain[i] = f.kind == FS_PROFILE_CONSTANT ? 0 : f.gain;
    rows->limit[i] = f.sense == FS_SENSE_REPULSIVE ? f.limit : -f.limit;
    rows->reach[i] = f.reach > 0 ? f.reach : never;
  } else {
    rows->linear &= ~bit;
  }
  place(i);
}

void Chunk::place(uint32_t i) noexcept {
  const uint64_t bit = uint64_t{1} << i;
  if (!row(i).object) return;
  const Object& object = *row(i).object;
  const Motion& m = motion(i);
  const bool is_standing = !(m.horizon > 0);
  standing = is_standing ? standing | bit : standing & ~bit;
  planes &= ~bit;
  x[i] = m.pose.position.x;
  y[i] = m.pose.position.y;
  z[i] = m.pose.position.z;
  if (!(object.law.support >= 0)) {
    reach[i] = -never;
  } else if (object.primitive == FS_PRIMITIVE_PLANE) {
    const bool has_distance = is_standing && object.law.support < never;
    if (has_distance) planes |= bit;
    reach[i] = has_distance ? -never : never;
  } else {
    // The sphere around all places between the pose and the end of its twist.
    const Vec3 half = 0.5 * m.horizon * m.twist.linear;
    if (!is_standing) {
      x[i] += half.x;
      y[i] += half.y;
      z[i] += half.z;
    }
    const double rounding = 1e-14 * (object.radius + object.law.support) + 1e-15 * largest_coordinate({x[i], y[i], z[i]});
    reach[i] = object.radius + object.law.support + norm(half) * (1 + 1e-14) + rounding;
  }
}

void Chunk::drop(uint32_t i) noexcept {
  const uint64_t bit = uint64_t{1} << i;
  rows->rows[i] = {};
  rows->linear &= ~bit;
  used &= ~bit;
  standing &= ~bit;
  planes &= ~bit;
  reach[i] = -never;
}

ToolPoints::ToolPoints(std::vector<Vec3> the_points) : points(std::move(the_points)) {
  Vec3 sum{};
  for (const Vec3& p : points) sum += (1.0 / static_cast<double>(points.size())) * p;
  centre = sum;
  for (const Vec3& p : points) radius = std::fmax(radius, norm(p - centre) * (1 + 1e-14));
}

}  // namespace fs
