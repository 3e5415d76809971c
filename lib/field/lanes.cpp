#include "field/lanes.h"

#include <cmath>
#include <cstring>

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
FS_INLINE Four root(Four v) { return Four{std::sqrt(v[0]), std::sqrt(v[1]), std::sqrt(v[2]), std::sqrt(v[3])}; }
FS_INLINE Four least(Four a, Four b) { return a < b ? a : b; }
FS_INLINE void add(double* sum, Four value) {
  const Four out = load(sum) + value;
  std::memcpy(sum, &out, sizeof out);
}

FS_INLINE void gaps_in_lanes(const Chunk& chunk, Vec3 from, double* gaps) {
  for (uint32_t i = 0; i < chunk_size; i += lane_count) {
    const Four x = all(from.x) - load(chunk.x + i), y = all(from.y) - load(chunk.y + i), z = all(from.z) - load(chunk.z + i);
    const Four gap = root(x * x + y * y + z * z) - load(chunk.reach + i);
    std::memcpy(gaps + i, &gap, sizeof gap);
  }
}

FS_INLINE uint64_t linear_in_lanes(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm, const Weight* weights,
                                   double share, LaneSum& sum) {
  const Rows& rows = *chunk.rows;
  uint64_t felt = 0;
  const Four zero = all(0), one = all(1);
  for (uint32_t i = 0; i < chunk_size; i += lane_count) {
    const uint64_t wanted = mask >> i & 15;
    if (wanted == 0) continue;
    const Mask is_wanted = Mask{-(long long)(wanted & 1), -(long long)(wanted >> 1 & 1), -(long long)(wanted >> 2 & 1),
                                -(long long)(wanted >> 3 & 1)};
    const Four x = all(position.x) - load(chunk.x + i), y = all(position.y) - load(chunk.y + i),
               z = all(position.z) - load(chunk.z + i);
    const Four d = root(x * x + y * y + z * z);
    const Four signed_limit = load(rows.limit + i);
    const Four limit = signed_limit < zero ? -signed_limit : signed_limit;
    const Four raw = load(rows.gain + i) * d + load(rows.offset + i);
    const Mask is_felt = is_wanted & (raw > zero) & (d <= load(rows.reach + i)) & (d > all(least_distance));
    const Four sign = signed_limit < zero ? -one : one;
    const Four weight = where(is_felt, load(weights, i) * all(share) * sign);
    const Four slope = where(raw < limit, load(rows.gain + i)) * weight;
    const Four inverse = one / (d > all(least_distance) ? d : one);
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

using Gaps = void(const Chunk&, Vec3, double*);
using Linear = uint64_t(const Chunk&, uint64_t, Vec3, Vec3, const Weight*, double, LaneSum&);

void gaps_usual(const Chunk& chunk, Vec3 from, double* gaps) { gaps_in_lanes(chunk, from, gaps); }
uint64_t linear_usual(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm, const Weight* weights, double share,
                      LaneSum& sum) {
  return linear_in_lanes(chunk, mask, position, arm, weights, share, sum);
}

#ifdef __x86_64__
__attribute__((target("avx2"))) void gaps_wide(const Chunk& chunk, Vec3 from, double* gaps) {
  gaps_in_lanes(chunk, from, gaps);
}
__attribute__((target("avx2"))) uint64_t linear_wide(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm,
                                                     const Weight* weights, double share, LaneSum& sum) {
  return linear_in_lanes(chunk, mask, position, arm, weights, share, sum);
}
const bool is_wide = (__builtin_cpu_init(), __builtin_cpu_supports("avx2"));
Gaps* const gaps_best = is_wide ? gaps_wide : gaps_usual;
Linear* const linear_best = is_wide ? linear_wide : linear_usual;
#else
Gaps* const gaps_best = gaps_usual;
Linear* const linear_best = linear_usual;
#endif

}  // namespace

void find_gaps(const Chunk& chunk, Vec3 from, double (&gaps)[chunk_size]) noexcept { gaps_best(chunk, from, gaps); }

uint64_t add_linear(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm, const Weight* weights, double share,
                    LaneSum& sum) noexcept {
  return linear_best(chunk, mask, position, arm, weights, share, sum);
}

}  // namespace fs
