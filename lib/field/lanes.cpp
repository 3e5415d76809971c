#include "field/lanes.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace fs {
namespace {

// Vectors of the compiler (gcc, clang): on a processor without registers so wide it takes several. A comparison gives all
// bits of a lane, or none.
typedef double Four __attribute__((vector_size(32)));
typedef long long Mask __attribute__((vector_size(32)));

constexpr double least_distance = 1e-150;  // m: nearer than this there is no direction

#define FS_INLINE inline __attribute__((always_inline))

FS_INLINE Four load(const double* from) {
  Four out;
  std::memcpy(&out, from, sizeof out);
  return out;
}
FS_INLINE Four all(double value) { return Four{value, value, value, value}; }
FS_INLINE Four load(const Weight* weights, uint32_t i) {
  if (!weights) return all(1);
  return Four{weights[i].value(), weights[i + 1].value(), weights[i + 2].value(), weights[i + 3].value()};
}
FS_INLINE Four where(Mask mask, Four value) { return (Four)(mask & (Mask)value); }  // else 0
FS_INLINE Mask lanes_of(uint64_t bits) {
  return Mask{-(long long)(bits & 1), -(long long)(bits >> 1 & 1), -(long long)(bits >> 2 & 1), -(long long)(bits >> 3 & 1)};
}
FS_INLINE Four root(Four v) { return Four{std::sqrt(v[0]), std::sqrt(v[1]), std::sqrt(v[2]), std::sqrt(v[3])}; }
FS_INLINE Four least(Four a, Four b) { return a < b ? a : b; }
FS_INLINE void add(double* sum, Four value) {
  const Four out = load(sum) + value;
  std::memcpy(sum, &out, sizeof out);
}

// e^-u for u >= 0, within 2 units in the last place: 2^n e^r with |r| <= ln(2)/2, the latter by its Taylor series. The
// library's own, because that of the system is not the same on every width.
FS_INLINE Four exp_minus(Four u) {
  const Four magic = all(0x1.8p52);  // a number added to it is rounded to an integer, which stands in its last bits
  const Four limited = u < all(760) ? u : all(760);
  const Four n = limited * all(-1.4426950408889634) + magic - magic;
  const Four r = -limited - n * all(0x1.62e42fefa38p-1) - n * all(0x1.ef35793c7673p-45);
  Four sum = all(1.0 / 6227020800);
  for (const double c : {1.0 / 479001600, 1.0 / 39916800, 1.0 / 3628800, 1.0 / 362880, 1.0 / 40320, 1.0 / 5040, 1.0 / 720,
                         1.0 / 120, 1.0 / 24, 1.0 / 6, 0.5, 1.0, 1.0}) {
    sum = sum * r + all(c);
  }
  // In two steps, because 2^n may be too small for a double.
  const Four half = n * all(0.5) + magic, rest = n - (half - magic) + magic;
  const Mask one = (Mask)all(1);
  return sum * (Four)(one + ((Mask)half << 52)) * (Four)(one + ((Mask)rest << 52));
}

FS_INLINE uint64_t points_in_lanes(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm, const Weight* weights,
                                   double share, LaneSum& sum) {
  const Rows& rows = *chunk.rows;
  uint64_t felt = 0;
  const Four zero = all(0), one = all(1);
  for (uint32_t i = 0; i < chunk_size; i += lane_count) {
    const uint64_t wanted = mask >> i & 15;
    if (wanted == 0) continue;
    const Mask is_wanted = lanes_of(wanted);
    const Motions& at = *chunk.motions[i / Motions::size];
    const Four x = all(position.x) - load(at.x), y = all(position.y) - load(at.y), z = all(position.z) - load(at.z);
    const Four d = root(x * x + y * y + z * z);
    const Four signed_limit = load(rows.limit + i);
    const Four limit = signed_limit < zero ? -signed_limit : signed_limit;
    const Four gain = load(rows.gain + i), offset = load(rows.offset + i);
    const Four inverse = one / (d > all(least_distance) ? d : one);
    Four raw = gain * d + offset, steepness = gain;
    if (const uint64_t some = rows.quadratic >> i & 15) {
      const Mask mine = lanes_of(some);
      raw = mine ? gain * d * d + offset : raw;
      steepness = mine ? all(2) * (gain * d) : steepness;
    }
    if (const uint64_t some = rows.inverse >> i & 15) {
      const Mask mine = lanes_of(some);
      raw = mine ? gain * inverse + offset : raw;
      steepness = mine ? -(gain * inverse) * inverse : steepness;
    }
    if (const uint64_t some = rows.gaussian >> i & 15) {
      const Mask mine = lanes_of(some);
      const Four per_width = load(rows.per_width + i), q = d * per_width, force = gain * exp_minus(all(0.5) * q * q);
      raw = mine ? force : raw;
      steepness = mine ? -(force * q) * per_width : steepness;
    }
    const Mask is_felt = is_wanted & (raw > zero) & (d <= load(rows.reach + i)) & (d > all(least_distance));
    const Four sign = signed_limit < zero ? -one : one;
    const Four weight = where(is_felt, load(weights, i) * all(share) * sign);
    const Four slope = where(raw < limit, steepness) * weight;
    const Four ux = x * inverse, uy = y * inverse, uz = z * inverse;
    const Four force = least(raw, limit) * weight;
    const Four fx = where(is_felt, force * ux), fy = where(is_felt, force * uy), fz = where(is_felt, force * uz);
    add(sum.fx, fx);
    add(sum.fy, fy);
    add(sum.fz, fz);
    add(sum.tx, all(arm.y) * fz - all(arm.z) * fy);
    add(sum.ty, all(arm.z) * fx - all(arm.x) * fz);
    add(sum.tz, all(arm.x) * fy - all(arm.y) * fx);
    const Four turning = where(is_felt, force * inverse), rest = where(is_felt, slope - force * inverse);
    const Four rx = rest * ux, ry = rest * uy;
    add(sum.xx, rx * ux + turning);
    add(sum.xy, rx * uy);
    add(sum.xz, rx * uz);
    add(sum.yy, ry * uy + turning);
    add(sum.yz, ry * uz);
    add(sum.zz, rest * uz * uz + turning);
    for (uint32_t k = 0; k < lane_count; ++k) felt |= static_cast<uint64_t>(is_felt[k] & 1) << (i + k);
  }
  return felt;
}

using Points = uint64_t(const Chunk&, uint64_t, Vec3, Vec3, const Weight*, double, LaneSum&);

uint64_t points_usual(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm, const Weight* weights, double share,
                      LaneSum& sum) {
  return points_in_lanes(chunk, mask, position, arm, weights, share, sum);
}

#ifdef __x86_64__
__attribute__((target("avx2"))) uint64_t points_wide(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm,
                                                     const Weight* weights, double share, LaneSum& sum) {
  return points_in_lanes(chunk, mask, position, arm, weights, share, sum);
}
Points* best_points() noexcept {
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx2") ? points_wide : points_usual;
}
#else
Points* best_points() noexcept { return points_usual; }
#endif

Points* points_best = best_points();

}  // namespace

void allow_wide_lanes(bool are_allowed) noexcept { points_best = are_allowed ? best_points() : points_usual; }

// Four floats are as wide as every processor has them.
typedef float Floats __attribute__((vector_size(16)));

void Outline::take(const Chunk& chunk) noexcept {
  constexpr uint32_t groups = chunk_size / Motions::size;
  constexpr float infinity = std::numeric_limits<float>::infinity();
  for (const Ref<Motions>& group : chunk.motions) {  // mostly not in the cache
    __builtin_prefetch(group.get());
    __builtin_prefetch(reinterpret_cast<const char*>(group.get()) + 64);
  }
  bool has_origin = false;
  for (uint32_t g = 0; g < groups; ++g) {
    const Motions* const group = chunk.motions[g].get();
    const uint32_t i = g * Motions::size;
    Floats fx{}, fy{}, fz{}, most{-infinity, -infinity, -infinity, -infinity};
    if (group) {
      if (!has_origin) origin = {group->x[0], group->y[0], group->z[0]};
      has_origin = true;
      fx = __builtin_convertvector(load(group->x) - all(origin.x), Floats);
      fy = __builtin_convertvector(load(group->y) - all(origin.y), Floats);
      fz = __builtin_convertvector(load(group->z) - all(origin.z), Floats);
      const auto size = [](Floats v) { return v < 0 ? -v : v; };
      std::memcpy(&most, group->reach, sizeof most);
      most += 2e-7f * (size(fx) + size(fy) + size(fz)) + static_cast<float>(1e-15 * largest_coordinate(origin));
    }
    std::memcpy(x + i, &fx, sizeof fx);
    std::memcpy(y + i, &fy, sizeof fy);
    std::memcpy(z + i, &fz, sizeof fz);
    std::memcpy(reach + i, &most, sizeof most);
  }
}

void find_gaps(const Outline& outline, Vec3 from, float (&gaps)[chunk_size]) noexcept {
  const auto load = [](const float* from) {
    Floats out;
    std::memcpy(&out, from, sizeof out);
    return out;
  };
  const Vec3 local = from - outline.origin;
  const float fx = static_cast<float>(local.x), fy = static_cast<float>(local.y), fz = static_cast<float>(local.z);
  // What rounding can make of a distance, of the place `from` itself too.
  const float part = 1 - 4e-7f;
  const float rounding = static_cast<float>(2e-7 * norm(local) + 1e-15 * largest_coordinate(from));
  for (uint32_t i = 0; i < chunk_size; i += 4) {
    const Floats x = fx - load(outline.x + i), y = fy - load(outline.y + i), z = fz - load(outline.z + i);
    const Floats squared = x * x + y * y + z * z;
    const Floats distance{std::sqrt(squared[0]), std::sqrt(squared[1]), std::sqrt(squared[2]), std::sqrt(squared[3])};
    const Floats gap = distance * part - rounding - load(outline.reach + i);
    std::memcpy(gaps + i, &gap, sizeof gap);
  }
}

uint64_t add_points(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm, const Weight* weights, double share,
                    LaneSum& sum) noexcept {
  return points_best(chunk, mask, position, arm, weights, share, sum);
}

}  // namespace fs
