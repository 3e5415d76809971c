#include "field/lanes.h"

#include <algorithm>
#include <array>
#include <climits>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/processor.h"

namespace fs {
namespace {

// Vectors of the compiler (gcc, clang): on a processor without registers so wide it takes several. A comparison gives all
// bits of a lane, or none.
typedef double Four __attribute__((vector_size(32)));
typedef long long Mask __attribute__((vector_size(32)));

#define FS_INLINE inline __attribute__((always_inline))

FS_INLINE Four load(const double* from) {
  Four out;
  std::memcpy(&out, from, sizeof out);
  return out;
}
FS_INLINE Four all(double value) { return Four{value, value, value, value}; }
FS_INLINE Four where(Mask mask, Four value) { return (Four)(mask & (Mask)value); }  // else 0
FS_INLINE Four root(Four v) { return Four{std::sqrt(v[0]), std::sqrt(v[1]), std::sqrt(v[2]), std::sqrt(v[3])}; }
FS_INLINE Four least(Four a, Four b) { return a < b ? a : b; }
constexpr Mask signs{LLONG_MIN, LLONG_MIN, LLONG_MIN, LLONG_MIN};
FS_INLINE Four size(Four v) { return (Four)((Mask)v & ~signs); }
FS_INLINE Four signed_as(Four v, Four sign) { return (Four)((Mask)v ^ ((Mask)sign & signs)); }

constexpr double least_distance = 1e-150;  // m: nearer than this there is no direction

FS_INLINE Four weights_at(const Weight* weights, uint32_t i) {
  if (!weights) return all(1);
  return Four{weights[i].value(), weights[i + 1].value(), weights[i + 2].value(), weights[i + 3].value()};
}
// The lanes whose bit is set, of four bits.
FS_INLINE Mask lanes_of(uint64_t bits) {
  static constexpr auto masks = [] {
    std::array<std::array<long long, lane_count>, 16> out{};
    for (unsigned b = 0; b < 16; ++b) {
      for (unsigned k = 0; k < lane_count; ++k) out[b][k] = b >> k & 1 ? -1 : 0;
    }
    return out;
  }();
  Mask out;
  std::memcpy(&out, &masks[bits], sizeof out);
  return out;
}
FS_INLINE uint64_t any_of(Mask lanes) { return static_cast<uint64_t>(lanes[0] | lanes[1] | lanes[2] | lanes[3]); }
FS_INLINE void add(double* sum, Four value) {
  const Four out = load(sum) + value;
  std::memcpy(sum, &out, sizeof out);
}

// e^-u for u >= 0, within 2 units in the last place: 2^n e^r with |r| <= ln(2)/2, the latter by its Taylor series. Our
// own, because the exp of the system gives other bits for another width.
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

// What the formulas of four rows give.
struct Laws {
  Four force, slope;  // N, N/m: of f(d), where it is felt
  Mask is_felt;
};

// offset to reach: of the four rows. quadratic to gaussian: bit k: lane k has this formula. inverse_distance: 1 / d.
FS_INLINE Laws laws_at(Four d, Four inverse_distance, const double* offset_of, const double* gain_of, const double* per_width_of,
                       Four limit, const double* reach_of, uint64_t quadratic, uint64_t inverse, uint64_t gaussian) {
  const Four gain = load(gain_of), offset = load(offset_of);
  Four raw = gain * d + offset, steepness = gain;
  if (quadratic) {
    const Mask mine = lanes_of(quadratic);
    raw = mine ? gain * d * d + offset : raw;
    steepness = mine ? all(2) * (gain * d) : steepness;
  }
  if (inverse) {
    const Mask mine = lanes_of(inverse);
    raw = mine ? gain * inverse_distance + offset : raw;
    steepness = mine ? -(gain * inverse_distance) * inverse_distance : steepness;
  }
  if (gaussian) {
    const Mask mine = lanes_of(gaussian);
    const Four per_width = load(per_width_of), q = d * per_width, force = gain * exp_minus(all(0.5) * q * q);
    raw = mine ? force : raw;
    steepness = mine ? -(force * q) * per_width : steepness;
  }
  return {least(raw, limit), where(raw < limit, steepness), (raw > all(0)) & (d <= load(reach_of))};
}

FS_INLINE void cut(Laws& laws, Mask mine, Four force, Four slope) {
  mine &= force < laws.force;
  laws.force = mine ? force : laws.force;
  laws.slope = mine ? slope : laws.slope;
}
// As Cap::lower, for the lanes in `capped`. is_falling, is_bent: any of them has a `fall`, a bend.
template <uint32_t count>
FS_INLINE void lower(Laws& laws, Four d, const CapLanes<count>& caps, uint32_t i, uint64_t capped, bool is_falling,
                     bool is_bent) {
  const Mask mine = lanes_of(capped);
  const Four slope = load(caps.slope + i);
  if (is_bent) {
    const Four bend_slope = load(caps.bend_slope + i);
    const Mask is_beyond = (d - load(caps.bend + i)) * bend_slope > all(0);
    cut(laws, mine & is_beyond, load(caps.bend_force + i) + bend_slope * d, bend_slope);
  }
  cut(laws, mine, load(caps.rise + i) + slope * d, slope);
  if (is_falling) cut(laws, mine, load(caps.fall + i) - slope * d, -slope);
  laws.is_felt &= laws.force > all(0);
}

FS_INLINE void add_forces(Four fx, Four fy, Four fz, Four arm_x, Four arm_y, Four arm_z, LaneSum& sum) {
  add(sum.fx, fx);
  add(sum.fy, fy);
  add(sum.fz, fz);
  add(sum.tx, arm_y * fz - arm_z * fy);
  add(sum.ty, arm_z * fx - arm_x * fz);
  add(sum.tz, arm_x * fy - arm_y * fx);
}

FS_INLINE uint64_t points_in_lanes(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm, const Weight* weights,
                                   double share, LaneSum& sum) {
  const Rows& rows = *chunk.rows;
  const uint64_t others = mask & ~rows.linear, capped = weights ? mask & rows.capped : 0;
  const Four one = all(1), px = all(position.x), py = all(position.y), pz = all(position.z), shares = all(share);
  Four fx{}, fy{}, fz{};
  Mask felt{};
  Mask bits{1, 2, 4, 8};  // of the four rows
  for (uint32_t i = 0; i < chunk_size; i += lane_count, bits <<= lane_count) {
    const uint64_t wanted = mask >> i & 15;
    if (wanted == 0) continue;
    const Motions& at = *chunk.motions[i / Motions::size];
    const Four x = px - load(at.x), y = py - load(at.y), z = pz - load(at.z);
    const Four d = root(x * x + y * y + z * z);
    const Four signed_limit = load(rows.limit + i);
    const Mask has_direction = d > all(least_distance);
    const Four inverse = one / (has_direction ? d : one);
    const uint64_t other = others >> i & 15;
    Laws laws = laws_at(d, inverse, rows.offset + i, rows.gain + i, rows.per_width + i, size(signed_limit),
                        rows.reach + i, other ? rows.quadratic >> i & 15 : 0, other ? rows.inverse >> i & 15 : 0,
                        other ? rows.gaussian >> i & 15 : 0);
    if (const uint64_t some = capped >> i & 15) lower(laws, d, *rows.caps, i, some, rows.falling >> i & 15, rows.bent >> i & 15);
    const Mask is_felt = lanes_of(wanted) & laws.is_felt & has_direction;
    felt |= is_felt & bits;
    // All numbers but the slopes are finite, so they are 0 where the weight is.
    const Four weight = where(is_felt, signed_as(weights_at(weights, i) * shares, signed_limit));
    const Four ux = x * inverse, uy = y * inverse, uz = z * inverse;
    const Four force = laws.force * weight;
    fx += force * ux;
    fy += force * uy;
    fz += force * uz;
    const Four turning = force * inverse, rest = where(is_felt, laws.slope * weight) - turning;
    const Four rx = rest * ux, ry = rest * uy;
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

FS_INLINE uint64_t contacts_in_lanes(const Contacts::Layer* layers, const Contacts::Caps* caps, uint32_t count,
                                     LaneSum& sum) {
  uint64_t felt = 0;
  const Four zero = all(0), one = all(1);
  for (const Contacts::Layer* layer = layers; layer != layers + count; ++layer) {
    const Contacts::Layer& l = *layer;
    const Four d = load(l.distance), signed_limit = load(l.limit), inverse = one / d;
    Laws laws =
        laws_at(d, inverse, l.offset, l.gain, l.per_width, size(signed_limit), l.reach, l.quadratic, l.inverse, l.gaussian);
    if (l.capped) lower(laws, d, caps[layer - layers], 0, l.capped, true, true);
    const Mask is_felt = lanes_of(l.used) & laws.is_felt;
    const Four sign = signed_limit < zero ? -one : one;
    const Four weight = load(l.weight) * sign;
    const Four force = where(is_felt, laws.force * weight), slope = where(is_felt, laws.slope * weight);
    const Four ux = load(l.ux), uy = load(l.uy), uz = load(l.uz);
    add_forces(force * ux, force * uy, force * uz, load(l.arm_x), load(l.arm_y), load(l.arm_z), sum);
    const Four turning = where(is_felt & lanes_of(l.turning) & (d > all(least_distance)), force * inverse), rest = slope - turning;
    const Four tx = load(l.tx), ty = load(l.ty), tz = load(l.tz);
    const Four rx = rest * ux, ry = rest * uy, ex = turning * tx, ey = turning * ty;
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

typedef float Eight __attribute__((vector_size(32)));
typedef uint32_t Bits __attribute__((vector_size(32)));

FS_INLINE Eight load_eight(const float* from) {
  Eight out;
  std::memcpy(&out, from, sizeof out);
  return out;
}

FS_INLINE void gaps_in_lanes(const Outline& outline, Vec3 from, Gaps& gaps) {
  const Vec3 local = from - outline.origin;
  const float fx = static_cast<float>(local.x), fy = static_cast<float>(local.y), fz = static_cast<float>(local.z);
  // What rounding can make of a distance, of the place `from` itself too.
  const float part = 1 - 4e-7f;
  const float rounding = static_cast<float>(2e-7 * norm(local) + 1e-15 * largest_coordinate(from));
  for (uint32_t i = 0; i < chunk_size; i += 8) {
    const Eight x = fx - load_eight(outline.x + i), y = fy - load_eight(outline.y + i), z = fz - load_eight(outline.z + i);
    const Eight squared = x * x + y * y + z * z;
    Eight distance;
    for (int k = 0; k < 8; ++k) distance[k] = std::sqrt(squared[k]);
    const Eight gap = distance * part - rounding - load_eight(outline.reach + i);
    std::memcpy(gaps + i, &gap, sizeof gap);
  }
}

FS_INLINE Within within_in_lanes(const Gaps& gaps, float most) {
  constexpr float infinity = std::numeric_limits<float>::infinity();
  const Eight none = infinity - Eight{};
  Eight beyond = none;
  Within out{0, infinity};
  for (uint32_t half = 0; half < 2; ++half) {
    Bits bits{1, 2, 4, 8, 16, 32, 64, 128}, found{};
    for (uint32_t i = 32 * half; i < 32 * half + 32; i += 8, bits <<= 8) {
      const Eight gap = load_eight(gaps + i), farther = gap > most ? gap : none;
      found |= (Bits)(gap <= most) & bits;
      beyond = farther < beyond ? farther : beyond;
    }
    for (int k = 0; k < 8; ++k) out.rows |= static_cast<uint64_t>(found[k]) << (32 * half);
  }
  for (int k = 0; k < 8; ++k) out.least_beyond = std::min(out.least_beyond, beyond[k]);
  return out;
}

FS_INLINE Awake awake_in_lanes(const double* wake_at, double travelled) {
  Four beyond = all(never);
  Mask bits{1, 2, 4, 8}, found{};
  for (uint32_t i = 0; i < 64; i += lane_count, bits <<= lane_count) {
    const Four at = load(wake_at + i);
    const Mask sleeps = at > all(travelled);
    found |= ~sleeps & bits;
    beyond = least(sleeps ? at : beyond, beyond);
  }
  return {any_of(found), std::min(std::min(beyond[0], beyond[1]), std::min(beyond[2], beyond[3]))};
}

// All of them for one width.
struct Width {
  uint64_t (*points)(const Chunk&, uint64_t, Vec3, Vec3, const Weight*, double, LaneSum&);
  uint64_t (*contacts)(const Contacts::Layer*, const Contacts::Caps*, uint32_t, LaneSum&);
  void (*gaps)(const Outline&, Vec3, Gaps&);
  Within (*within)(const Gaps&, float);
  Awake (*awake)(const double*, double);
};

// The same functions for the processor at hand (TARGET: nothing) and for one with AVX2.
#define FS_WIDTH(NAME, TARGET)                                                                                              \
  TARGET uint64_t NAME##_points(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm, const Weight* weights,          \
                                double share, LaneSum& sum) {                                                               \
    return points_in_lanes(chunk, mask, position, arm, weights, share, sum);                                                \
  }                                                                                                                         \
  TARGET uint64_t NAME##_contacts(const Contacts::Layer* layers, const Contacts::Caps* caps, uint32_t count,                \
                                  LaneSum& sum) {                                                                           \
    return contacts_in_lanes(layers, caps, count, sum);                                                                     \
  }                                                                                                                         \
  TARGET void NAME##_gaps(const Outline& outline, Vec3 from, Gaps& gaps) { gaps_in_lanes(outline, from, gaps); }            \
  TARGET Within NAME##_within(const Gaps& gaps, float most) { return within_in_lanes(gaps, most); }                         \
  TARGET Awake NAME##_awake(const double* wake_at, double travelled) { return awake_in_lanes(wake_at, travelled); }         \
  constexpr Width NAME{NAME##_points, NAME##_contacts, NAME##_gaps, NAME##_within, NAME##_awake};

FS_WIDTH(usual, )
#ifdef __x86_64__
FS_WIDTH(wide, __attribute__((target("avx2"))))
const Width& width() noexcept { return has_avx2 ? wide : usual; }
#else
const Width& width() noexcept { return usual; }
#endif

}  // namespace

void Contacts::add(uint32_t row, const Contact& contact) noexcept {
  const uint32_t k = row % lane_count, bit = 1u << k;
  if (counts_[k] == layer_count_) layers_[layer_count_++] = {};
  Layer& l = layers_[counts_[k]++];
  const Profile& f = *contact.law;
  const Formula formula(f);
  l.used |= bit;
  if (contact.is_turning) l.turning |= bit;
  if (formula.kind == FS_PROFILE_QUADRATIC) l.quadratic |= bit;
  if (formula.kind == FS_PROFILE_INVERSE) l.inverse |= bit;
  if (formula.kind == FS_PROFILE_GAUSSIAN) l.gaussian |= bit;
  l.rows[k] = static_cast<uint8_t>(row);
  l.ux[k] = contact.direction.x;
  l.uy[k] = contact.direction.y;
  l.uz[k] = contact.direction.z;
  l.tx[k] = contact.tangent.x;
  l.ty[k] = contact.tangent.y;
  l.tz[k] = contact.tangent.z;
  l.distance[k] = contact.distance;
  l.weight[k] = contact.weight;
  l.arm_x[k] = contact.arm.x;
  l.arm_y[k] = contact.arm.y;
  l.arm_z[k] = contact.arm.z;
  l.offset[k] = formula.offset;
  l.gain[k] = formula.gain;
  l.per_width[k] = std::min(formula.per_width, 1e300);  // so that it is 0 widths to a distance of 0
  l.limit[k] = formula.limit;
  l.reach[k] = formula.reach;
  if (f.cap) {
    if (!l.capped) caps_[&l - layers_] = {};
    l.capped |= bit;
    caps_[&l - layers_].set(k, *f.cap);
  }
}

uint64_t Contacts::take(LaneSum& sum) noexcept {
  const uint64_t felt = width().contacts(layers_, caps_, layer_count_, sum);
  std::fill_n(counts_, lane_count, 0);
  layer_count_ = 0;
  return felt;
}

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

void find_gaps(const Outline& outline, Vec3 from, Gaps& gaps) noexcept { width().gaps(outline, from, gaps); }

Within rows_within(const Gaps& gaps, float most) noexcept { return width().within(gaps, most); }

Awake find_awake(const double (&wake_at)[64], double travelled) noexcept { return width().awake(wake_at, travelled); }

uint64_t add_points(const Chunk& chunk, uint64_t mask, Vec3 position, Vec3 arm, const Weight* weights, double share,
                    LaneSum& sum) noexcept {
  return width().points(chunk, mask, position, arm, weights, share, sum);
}

}  // namespace fs
