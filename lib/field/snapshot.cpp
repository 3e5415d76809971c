#include "field/snapshot.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

namespace fs {

Motions::Motions() { std::fill_n(reach, size, -std::numeric_limits<float>::infinity()); }

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
  rows_sequence = sequence;
  own_motion(i);
}

void Chunk::own_caps() { make_unique(rows->caps); }

void Chunk::own_motion(uint32_t i) { make_unique(motions[i / Motions::size]); }

void Chunk::move(uint32_t i, const Motion& motion, uint64_t revision) noexcept {
  Motions& group = *motions[i / Motions::size];
  group.motions[i % Motions::size] = motion;
  group.revision[i % Motions::size] = revision;
  place(i);
}

void Chunk::begin_offset(uint32_t i, double t, double blend) noexcept {
  motions[i / Motions::size]->motions[i % Motions::size].begin_offset(t, blend);
  place(i);
}

Row& Chunk::set(uint32_t i, Ref<const Object> given, Ref<const Object> bounded, const Motion& motion,
                uint64_t revision) noexcept {
  const uint64_t bit = uint64_t{1} << i;
  const Object& object = *given;
  const Ref<const Cap> the_cap = bounded ? bounded->law.front.cap : nullptr;
  const bool is_softer = bounded && bounded->steepest_slope < object.steepest_slope;
  rows->bounded = is_softer ? rows->bounded | bit : rows->bounded & ~bit;
  rows->rows[i].object = std::move(given);
  rows->rows[i].bounded = std::move(bounded);
  used |= bit;
  const Law& law = object.law;
  rows->forget_formulas(bit);
  if (object.is_solid()) {
    rows->solids |= bit;
  } else if (object.damping == 0 && fits_lanes(law.front) && fits_lanes(law.back)) {
    const bool has_room = !the_cap || (rows->caps && rows->caps->is_unique() && the_cap->slope < 1e100);
    if (object.primitive != FS_PRIMITIVE_POINT || object.point_mask() != ~0u) {
      rows->by_closest_point |= bit;
    } else if (has_room) {
      rows->forms[static_cast<size_t>(rows->formulas.set(i, law.front))] |= bit;
      if (the_cap) {
        const Cap& cap = *the_cap;
        rows->capped |= bit;
        if (cap.fall < never) rows->falling |= bit;
        if (cap.bend_slope != 0) rows->bent |= bit;
        rows->caps->set(i, cap);
      }
    }
  }
  move(i, motion, revision);
  return rows->rows[i];
}

void Chunk::omit(double force) noexcept {
  if (!rows) return;
  rows->omitted = force;
  for_each_bit(used, [&](uint32_t i) { place(i); });
}

Box Chunk::box_of(uint32_t i) const noexcept {
  const Motions& group = *motions[i / Motions::size];
  const uint32_t k = i % Motions::size;
  const double r = group.reach[k];
  if (!(r > -never)) return {};
  const Vec3 c{group.x[k], group.y[k], group.z[k]};
  return {{c.x - r, c.y - r, c.z - r}, {c.x + r, c.y + r, c.z + r}};
}

// A row has gone from one box to another.
void Chunk::move_box(const Box& before, const Box& after) noexcept {
  if (before.is_empty() || before.is_inside(box)) return box.add(after);
  box = {};
  for_each_bit(used, [&](uint32_t i) { box.add(box_of(i)); });
}

void Chunk::place(uint32_t i) noexcept {
  const Box before = box_of(i);
  const uint64_t bit = uint64_t{1} << i;
  const Object& object = *row(i).object;
  Motions& group = *motions[i / Motions::size];
  const uint32_t k = i % Motions::size;
  const Motion& m = group.motions[k];
  const double support = object.support(rows->omitted);
  constexpr float infinity = std::numeric_limits<float>::infinity();
  const bool is_standing = !(m.horizon > 0);
  const double offset = m.most_offset();
  const bool is_blended = offset > 0 || m.most_turn() > 0;
  standing = is_standing ? standing | bit : standing & ~bit;
  blended = is_blended ? blended | bit : blended & ~bit;
  planes &= ~bit;
  group.x[k] = m.pose.position.x;
  group.y[k] = m.pose.position.y;
  group.z[k] = m.pose.position.z;
  if (!(support >= 0)) {
    group.reach[k] = -infinity;
  } else if (object.primitive == FS_PRIMITIVE_PLANE) {
    const bool has_distance = is_standing && support < never;
    if (has_distance) planes |= bit;
    group.reach[k] = has_distance ? -infinity : infinity;
  } else {
    // The sphere around all places between the pose and the end of its twist, and as far about them as an offset takes it.
    const Vec3 half = 0.5 * m.horizon * m.twist.linear;
    if (!is_standing) {
      group.x[k] += half.x;
      group.y[k] += half.y;
      group.z[k] += half.z;
    }
    const double rounding = 1e-15 * largest_coordinate({group.x[k], group.y[k], group.z[k]});
    const double reach = (object.radius + support + norm(half) + offset + rounding) * (1 + 2e-7) + 1e-30;
    group.reach[k] = reach < 1e37 ? static_cast<float>(reach) : infinity;
  }
  move_box(before, box_of(i));
}

void Chunk::drop(uint32_t i) noexcept {
  const uint64_t bit = uint64_t{1} << i;
  const Box before = box_of(i);
  rows->rows[i] = {};
  rows->bounded &= ~bit;
  rows->forget_formulas(bit);
  used &= ~bit;
  standing &= ~bit;
  blended &= ~bit;
  planes &= ~bit;
  motions[i / Motions::size]->reach[i % Motions::size] = -std::numeric_limits<float>::infinity();
  move_box(before, {});
}

ToolPoints::ToolPoints(std::vector<Vec3> the_points, double the_point_radius)
    : points(std::move(the_points)), point_radius(the_point_radius) {
  Vec3 sum{};
  for (const Vec3& p : points) sum += (1.0 / static_cast<double>(points.size())) * p;
  centre = sum;
  for (const Vec3& p : points) radius = std::fmax(radius, norm(p - centre) * (1 + 1e-14));
}

}  // namespace fs
