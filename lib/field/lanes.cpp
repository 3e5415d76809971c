#include "field/lanes.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "law/formula.h"
#include "math/lanes.h"

namespace fs {
namespace {

using namespace lanes;

FS_INLINE Doubles4 weights_at(const Weight* weights, uint32_t i) {
  if (!weights) return all(1.0);
  return Doubles4{weights[i].value(), weights[i + 1].value(), weights[i + 2].value(), weights[i + 3].value()};
}
FS_INLINE void add(double* sum, Doubles4 value) {
  const Doubles4 out = load(sum) + value;
  std::memcpy(sum, &out, sizeof out);
}

// What formula() asks, of four rows.
template <uint32_t count, class FormBits>
struct Four {
  const FormulaLanes<count>& numbers;
  uint32_t i;  // of the first
  Doubles4 limits;
  Doubles4 inverse_distance;
  const FormBits& form_bits;

  FS_INLINE Doubles4 gain() const { return load(numbers.gain + i); }
  FS_INLINE Doubles4 offset() const { return load(numbers.offset + i); }
  FS_INLINE Doubles4 limit() const { return limits; }
  FS_INLINE Reciprocal<Doubles4> width() const { return {load(numbers.per_width + i)}; }
  FS_INLINE Reciprocal<Doubles4> distance() const { return {inverse_distance}; }
  FS_INLINE uint64_t which(Form form) const { return form_bits(form); }
};

// f(d) of four rows, from row i on. limits: without sign. form_bits(form): bit k: lane k has this formula.
template <uint32_t count, class FormBits>
FS_INLINE Felt<Doubles4> laws_at(Doubles4 d, Doubles4 inverse_distance, const FormulaLanes<count>& numbers, uint32_t i,
                                 Doubles4 limits, const FormBits& form_bits) {
  Felt<Doubles4> out = formula(Four<count, FormBits>{numbers, i, limits, inverse_distance, form_bits}, d);
  out.is_felt &= d <= load(numbers.reach + i);
  return out;
}

// Lowers the lanes in `capped`. is_falling, is_bent: any of them has a `fall`, a bend.
template <uint32_t count>
FS_INLINE void lower(Felt<Doubles4>& f, Doubles4 d, const CapLanes<count>& caps, uint32_t i, uint64_t capped, bool is_falling,
                     bool is_bent) {
  const Longs4 mine = lanes_of<Doubles4>(capped);
  const Doubles4 slope = load(caps.slope + i);
  if (is_bent) cut_at_bend(f, mine, d, load(caps.bend + i), load(caps.bend_force + i), load(caps.bend_slope + i));
  cut_at_rise(f, mine, d, load(caps.rise + i), slope);
  if (is_falling) cut_at_fall(f, mine, d, load(caps.fall + i), slope);
  f.is_felt &= f.force > Doubles4{};
}

// The same for a ball, whose gap is that of its skin, and whose laws are those there: see Cap::lower.
template <uint32_t count>
FS_INLINE void lower_of_ball(Felt<Doubles4>& f, Doubles4 d, Doubles4 gap, double radius, const CapLanes<count>& caps, uint32_t i,
                             uint64_t capped) {
  const Longs4 mine = lanes_of<Doubles4>(capped), is_inside = d < all(radius);
  const Doubles4 slope = load(caps.slope + i), across = load(caps.across + i), across_raw = load(caps.across_raw + i);
  Felt<Doubles4> inside{f.force, Doubles4{}, f.is_felt};
  cut_at_bend(f, mine, gap, load(caps.bend + i), load(caps.bend_force + i), load(caps.bend_slope + i));
  cut_at_rise(f, mine, gap, load(caps.own_rise + i), slope);
  cut_at_fall(f, mine, gap, load(caps.fall + i), slope);
  cut(inside, mine, f.force + slope * (all(radius) - d), -slope);
  f.force = is_inside ? inside.force : f.force;
  f.slope = is_inside ? inside.slope : f.slope;
  cut_at_rise(f, mine, d, least(across + slope * all(radius), across_raw), slope);
  f.is_felt &= f.force > Doubles4{};
}

// How far the skin of a ball is from what is d away from its middle, and one by that.
struct Skin {
  Doubles4 gap, inverse;
};
FS_INLINE Skin skin_of(Doubles4 d, Doubles4 inverse, double radius) {
  if (!(radius > 0)) return {d, inverse};
  const Doubles4 outside = d - all(radius), gap = outside > Doubles4{} ? outside : Doubles4{};
  return {gap, all(1.0) / (gap > all(least_distance) ? gap : all(least_distance))};
}

FS_INLINE void add_forces(Doubles4 fx, Doubles4 fy, Doubles4 fz, Doubles4 arm_x, Doubles4 arm_y, Doubles4 arm_z, LaneSum& sum) {
  add(sum.fx, fx);
  add(sum.fy, fy);
  add(sum.fz, fz);
  add(sum.tx, arm_y * fz - arm_z * fy);
  add(sum.ty, arm_z * fx - arm_x * fz);
  add(sum.tz, arm_x * fy - arm_y * fx);
}

FS_INLINE uint64_t points_in_lanes(const Chunk& chunk, uint64_t mask, Vec3 position, double radius, Vec3 arm,
                                   const Weight* weights, double point_weight, LaneSum& sum) {
  const Rows& rows = *chunk.rows;
  const uint64_t others = mask & ~rows.with(Form::linear), capped = weights ? mask & rows.capped : 0;
  const Doubles4 one = all(1.0), px = all(position.x), py = all(position.y), pz = all(position.z),
                 point_weights = all(point_weight);
  Doubles4 fx{}, fy{}, fz{};
  Longs4 felt{};
  Longs4 bits{1, 2, 4, 8};  // of the four rows
  for (uint32_t i = 0; i < chunk_size; i += lane_count, bits <<= lane_count) {
    const uint64_t wanted = mask >> i & 15;
    if (wanted == 0) continue;
    const Motions& at = *chunk.motions[i / Motions::size];
    const Doubles4 x = px - load(at.x), y = py - load(at.y), z = pz - load(at.z);
    const Doubles4 d = root(x * x + y * y + z * z);
    const Doubles4 signed_limit = load(rows.formulas.limit + i);
    const Longs4 has_direction = d > all(least_distance);
    const Doubles4 inverse = one / (has_direction ? d : one);
    const uint64_t other = others >> i & 15;
    const auto form_bits = [&](Form form) __attribute__((always_inline)) { return other ? rows.with(form) >> i & 15 : 0; };
    const Skin skin = skin_of(d, inverse, radius);
    Felt<Doubles4> laws = laws_at(skin.gap, skin.inverse, rows.formulas, i, magnitude(signed_limit), form_bits);
    if (radius > 0) laws.slope = d < all(radius) ? Doubles4{} : laws.slope;
    if (const uint64_t some = capped >> i & 15) {
      if (radius > 0) lower_of_ball(laws, d, skin.gap, radius, *rows.caps, i, some);
      else lower(laws, d, *rows.caps, i, some, rows.falling >> i & 15, rows.bent >> i & 15);
    }
    const Longs4 is_felt = lanes_of<Doubles4>(wanted) & laws.is_felt & has_direction;
    felt |= is_felt & bits;
    // All numbers but the slopes are finite, so they are 0 where the weight is.
    const Doubles4 weight = where(is_felt, signed_as(weights_at(weights, i) * point_weights, signed_limit));
    const Doubles4 ux = x * inverse, uy = y * inverse, uz = z * inverse;
    const Doubles4 force = laws.force * weight;
    fx += force * ux;
    fy += force * uy;
    fz += force * uz;
    const Doubles4 turning = force * inverse, rest = where(is_felt, laws.slope * weight) - turning;
    const Doubles4 rx = rest * ux, ry = rest * uy;
    add(sum.xx, rx * ux + turning);
    add(sum.xy, rx * uy);
    add(sum.xz, rx * uz);
    add(sum.yy, ry * uy + turning);
    add(sum.yz, ry * uz);
    add(sum.zz, rest * uz * uz + turning);
  }
  add_forces(fx, fy, fz, all(arm.x), all(arm.y), all(arm.z), sum);
  return any_of(felt);
}

FS_INLINE uint64_t closest_points_in_lanes(const ClosestPoints::Four* fours, const ClosestPoints::Caps* caps, uint32_t count,
                                           double radius, LaneSum& sum) {
  uint64_t felt = 0;
  const Doubles4 zero = all(0.0), one = all(1.0);
  for (const ClosestPoints::Four* four = fours; four != fours + count; ++four) {
    const ClosestPoints::Four& l = *four;
    const Doubles4 d = load(l.distance), signed_limit = load(l.formulas.limit), inverse = one / d;
    const auto form_bits = [&](Form form) __attribute__((always_inline)) { return l.forms[static_cast<size_t>(form)]; };
    const Skin skin = skin_of(d, inverse, radius);
    Felt<Doubles4> laws = laws_at(skin.gap, skin.inverse, l.formulas, 0, magnitude(signed_limit), form_bits);
    if (radius > 0) laws.slope = d < all(radius) ? zero : laws.slope;
    if (l.capped && radius > 0) lower_of_ball(laws, d, skin.gap, radius, caps[four - fours], 0, l.capped);
    else if (l.capped) lower(laws, d, caps[four - fours], 0, l.capped, true, true);
    const Longs4 is_felt = lanes_of<Doubles4>(l.used) & laws.is_felt;
    const Doubles4 sign = signed_limit < zero ? -one : one;
    const Doubles4 weight = load(l.weight) * sign;
    const Doubles4 force = where(is_felt, laws.force * weight), slope = where(is_felt, laws.slope * weight);
    const Doubles4 ux = load(l.ux), uy = load(l.uy), uz = load(l.uz);
    add_forces(force * ux, force * uy, force * uz, load(l.arm_x), load(l.arm_y), load(l.arm_z), sum);
    const Longs4 is_turning = is_felt & lanes_of<Doubles4>(l.turning) & (d > all(least_distance));
    const Doubles4 turning = where(is_turning, force * inverse), rest = slope - turning;
    const Doubles4 tx = load(l.tx), ty = load(l.ty), tz = load(l.tz);
    const Doubles4 rx = rest * ux, ry = rest * uy, ex = turning * tx, ey = turning * ty;
    add(sum.xx, rx * ux - ex * tx + turning);
    add(sum.xy, rx * uy - ex * ty);
    add(sum.xz, rx * uz - ex * tz);
    add(sum.yy, ry * uy - ey * ty + turning);
    add(sum.yz, ry * uz - ey * tz);
    add(sum.zz, rest * uz * uz - turning * tz * tz + turning);
    for (uint32_t k = 0; k < lane_count; ++k) felt |= static_cast<uint64_t>(is_felt[k] & 1) << l.rows[k];
  }
  return felt;
}

FS_INLINE void gaps_in_lanes(const Outline& outline, Vec3 from, Gaps& gaps) {
  const Vec3 local = from - outline.origin;
  const float fx = static_cast<float>(local.x), fy = static_cast<float>(local.y), fz = static_cast<float>(local.z);
  // What rounding can make of a distance, of the place `from` itself too.
  const float part = 1 - 4e-7f;
  const float rounding = static_cast<float>(2e-7 * norm(local) + 1e-15 * largest_coordinate(from));
  for (uint32_t i = 0; i < chunk_size; i += 8) {
    const Floats8 x = fx - load(outline.x + i), y = fy - load(outline.y + i), z = fz - load(outline.z + i);
    const Floats8 squared = x * x + y * y + z * z;
    const Floats8 gap = root(squared) * part - rounding - load(outline.reach + i);
    std::memcpy(gaps + i, &gap, sizeof gap);
  }
}

FS_INLINE Within within_in_lanes(const Gaps& gaps, float most) {
  constexpr float infinity = std::numeric_limits<float>::infinity();
  const Floats8 none = infinity - Floats8{};
  Floats8 beyond = none;
  Within out{0, infinity};
  for (uint32_t half = 0; half < 2; ++half) {
    Words8 bits{1, 2, 4, 8, 16, 32, 64, 128}, found{};
    for (uint32_t i = 32 * half; i < 32 * half + 32; i += 8, bits <<= 8) {
      const Floats8 gap = load(gaps + i), farther = gap > most ? gap : none;
      found |= (Words8)(gap <= most) & bits;
      beyond = farther < beyond ? farther : beyond;
    }
    for (int k = 0; k < 8; ++k) out.rows |= static_cast<uint64_t>(found[k]) << (32 * half);
  }
  for (int k = 0; k < 8; ++k) out.least_beyond = std::min(out.least_beyond, beyond[k]);
  return out;
}

FS_INLINE Awake awake_in_lanes(const double* wake_at, double travelled) {
  Doubles4 beyond = all(never);
  Longs4 bits{1, 2, 4, 8}, found{};
  for (uint32_t i = 0; i < 64; i += lane_count, bits <<= lane_count) {
    const Doubles4 at = load(wake_at + i);
    const Longs4 sleeps = at > all(travelled);
    found |= ~sleeps & bits;
    beyond = least(sleeps ? at : beyond, beyond);
  }
  return {any_of(found), std::min(std::min(beyond[0], beyond[1]), std::min(beyond[2], beyond[3]))};
}

}  // namespace

void ClosestPoints::add(uint32_t row, const Entry& entry) noexcept {
  const uint32_t k = row % lane_count, bit = 1u << k;
  if (counts_[k] == four_count_) fours_[four_count_++] = {};
  Four& l = fours_[counts_[k]++];
  const Profile& f = *entry.law;
  l.used |= bit;
  if (entry.is_turning) l.turning |= bit;
  l.forms[static_cast<size_t>(l.formulas.set(k, f))] |= bit;
  l.rows[k] = static_cast<uint8_t>(row);
  l.ux[k] = entry.direction.x;
  l.uy[k] = entry.direction.y;
  l.uz[k] = entry.direction.z;
  l.tx[k] = entry.tangent.x;
  l.ty[k] = entry.tangent.y;
  l.tz[k] = entry.tangent.z;
  l.distance[k] = entry.distance;
  l.weight[k] = entry.weight;
  l.arm_x[k] = entry.arm.x;
  l.arm_y[k] = entry.arm.y;
  l.arm_z[k] = entry.arm.z;
  l.formulas.per_width[k] = std::min(l.formulas.per_width[k], 1e300);  // so that it is 0 widths to a distance of 0
  if (f.cap) {
    if (!l.capped) caps_[&l - fours_] = {};
    l.capped |= bit;
    caps_[&l - fours_].set(k, *f.cap);
  }
}

uint64_t ClosestPoints::take(double radius, LaneSum& sum) noexcept {
  const uint64_t felt = run<closest_points_in_lanes>(fours_, caps_, four_count_, radius, sum);
  std::fill_n(counts_, lane_count, 0);
  four_count_ = 0;
  return felt;
}

void Outline::take(const Chunk& chunk) noexcept {
  constexpr uint32_t groups = chunk_size / Motions::size;
  constexpr float infinity = std::numeric_limits<float>::infinity();
  for (const Ref<Motions>& group : chunk.motions) {  // mostly not in the cache
    const auto address = reinterpret_cast<uintptr_t>(group.get());  // a number: it may be null
    __builtin_prefetch(reinterpret_cast<const void*>(address));
    __builtin_prefetch(reinterpret_cast<const void*>(address + 64));
  }
  bool has_origin = false;
  for (uint32_t g = 0; g < groups; ++g) {
    const Motions* const group = chunk.motions[g].get();
    const uint32_t i = g * Motions::size;
    Floats4 fx{}, fy{}, fz{}, most{-infinity, -infinity, -infinity, -infinity};
    if (group) {
      if (!has_origin) origin = {group->x[0], group->y[0], group->z[0]};
      has_origin = true;
      fx = __builtin_convertvector(load(group->x) - all(origin.x), Floats4);
      fy = __builtin_convertvector(load(group->y) - all(origin.y), Floats4);
      fz = __builtin_convertvector(load(group->z) - all(origin.z), Floats4);
      const auto size = [](Floats4 v) { return v < 0 ? -v : v; };
      std::memcpy(&most, group->reach, sizeof most);
      most += 2e-7f * (size(fx) + size(fy) + size(fz)) + static_cast<float>(1e-15 * largest_coordinate(origin));
    }
    std::memcpy(x + i, &fx, sizeof fx);
    std::memcpy(y + i, &fy, sizeof fy);
    std::memcpy(z + i, &fz, sizeof fz);
    std::memcpy(reach + i, &most, sizeof most);
  }
}

void find_gaps(const Outline& outline, Vec3 from, Gaps& gaps) noexcept { run<gaps_in_lanes>(outline, from, gaps); }

Within rows_within(const Gaps& gaps, float most) noexcept { return run<within_in_lanes>(gaps, most); }

Awake find_awake(const double (&wake_at)[64], double travelled) noexcept { return run<awake_in_lanes>(wake_at, travelled); }

uint64_t add_points(const Chunk& chunk, uint64_t mask, Vec3 position, double radius, Vec3 arm, const Weight* weights,
                    double point_weight, LaneSum& sum) noexcept {
  return run<points_in_lanes>(chunk, mask, position, radius, arm, weights, point_weight, sum);
}

}  // namespace fs
