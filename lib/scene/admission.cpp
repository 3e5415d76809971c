#include "scene/admission.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "field/budget.h"
#include "field/frame.h"

namespace fs {
namespace {

// The distance, m, beyond which a profile is hardly sloped any more when its slope is at most k: below 0.2 % of that.
double slope_end(const Profile& p, double k) {
  const double all = support(p);
  if (!(all >= 0) || !(k > 0)) return -1;
  if (p.reach > 0) return all;  // it may jump there
  switch (p.kind) {
    case FS_PROFILE_CONSTANT: return std::fmin(all, p.gain / k);
    case FS_PROFILE_LINEAR_INCREASING:
      return p.gain > 0 ? (p.limit + std::fabs(p.offset)) / std::fmin(p.gain, k) : std::fmin(p.offset, p.limit) / k;
    case FS_PROFILE_GAUSSIAN: return std::fmin(all, 4.5 * p.width + std::fmin(p.gain, p.limit) / k);
    case FS_PROFILE_QUADRATIC:
      return p.gain > 0 ? std::sqrt((p.limit + std::fabs(p.offset)) / p.gain) + p.limit / k : all;
    case FS_PROFILE_INVERSE: return std::fmin(all, 23 * std::sqrt(p.gain / k) + p.limit / k);
    default: return all;
  }
}

bool is_under_way(const Motion& motion, double now) { return motion.horizon > 0 && now < motion.time + motion.horizon; }

// Whether a version fades out where the next one is not felt.
bool is_elsewhere(const Object& object, const Motion& motion, const Snapshot& snapshot, uint32_t next) {
  const Chunk* const its = find_chunk(snapshot.chunks, next);
  if (!its) return true;
  const double size = object.primitive == FS_PRIMITIVE_PLANE ? 0 : object.radius;
  const double way = norm(its->motion(next % chunk_size).pose.position - motion.pose.position);
  return way > size + std::fmax(0, object.law.support);
}

// What one row wants, in scene units.
struct Wish {
  Admitted row;
  bool is_named;
  unsigned points;  // of the tool, that feel it
  double law = 0, contact = 0;  // N/m
  double damping = 0;           // N s/m
  const Motion* motion;
};

// m from the object, how deep a contact with this share of what it wants can be; infinite for a share of 0.
double contact_reach(const Wish& wish, double share) {
  const Object& object = *wish.row.object;
  return object.is_solid() ? object.contact.limit / (wish.contact * share) : -1;
}

// m from the object, how far its force is sloped with this share of what it wants.
double sloped_reach(const Wish& wish, double share) {
  const Object& object = *wish.row.object;
  const double k = wish.law * share;
  const double law = std::max(slope_end(object.law.front, k), slope_end(object.law.back, k));
  const double ridges = object.has_ridges() ? object.law.support : -1;  // a ridge may be at any distance
  return std::max({law, ridges, contact_reach(wish, share)});
}

double felt_reach(const Wish& wish, double share) {  // m, how far it is felt at all
  return std::max(wish.row.object->law.support, contact_reach(wish, share));
}

Claim claim_of(const Wish& wish, double reach, double now, const SceneShare& share, double slope) {
  const Object& object = *wish.row.object;
  Claim out;
  out.slope = slope;
  const Motion& motion = *wish.motion;
  const bool is_on_its_way = is_under_way(motion, now);
  if (is_on_its_way) {
    reach += share.ahead * (norm(motion.twist.linear) + norm(motion.twist.angular) * std::fmin(object.radius, 1e3));
  }
  if (motion.has_offset(now, share.blend)) reach += motion.most_offset();
  const Pose pose = motion.at(now, 0);
  out.centre = pose.position;
  if (object.primitive == FS_PRIMITIVE_PLANE) {
    out.region = is_on_its_way && norm(motion.twist.angular) > 0 ? Claim::Region::everywhere : Claim::Region::slab;
    out.normal = rotate(pose.orientation, {0, 0, 1});
    out.radius = reach;
  } else {
    out.radius = object.radius + reach;
  }
  if (!(out.radius < 1e9)) out.region = Claim::Region::everywhere;
  return out;
}

// Where no workspace is known: a box about all that is somewhere; slabs are everywhere then.
Box box_of(const std::vector<Claim>& claims) {
  Box out;
  for (const Claim& c : claims) {
    if (c.region == Claim::Region::everywhere) continue;
    out.add(c.centre - Vec3{c.radius, c.radius, c.radius});
    out.add(c.centre + Vec3{c.radius, c.radius, c.radius});
  }
  if (out.is_empty()) out.add(Vec3{});
  return out;
}

std::vector<double> shares_of(std::vector<Claim> claims, const Box& within, double total) {
  for (Claim& claim : claims) {  // slabs that are not parallel meet somewhere
    if (within.is_empty() && claim.region == Claim::Region::slab) claim.region = Claim::Region::everywhere;
  }
  std::vector<double> out = greatest_sums(claims, within.is_empty() ? box_of(claims) : within, total);
  for (double& sum : out) sum = sum > total ? total / sum : 1;
  return out;
}

}  // namespace

SceneShare share_of(const Views& views, const LoopShare& share, double most, double blend) {
  SceneShare out{never, never, blend, share.ahead, 0, 1, {}};
  bool is_anywhere = !(share.radius > 0 && share.height > 0);
  double lever_part = 1;
  for (const View& view : views.rows) {
    if (view.version == 0) continue;
    const fs_frame& frame = view.frame;
    out.to_device = std::max(out.to_device, frame.scale * frame.force_scale);
    out.points = std::max(out.points, static_cast<unsigned>(view.tool->points.size()));
    double arm = 0;
    for (const Vec3& point : view.tool->points) arm = std::max(arm, norm(point));
    if (arm / frame.scale > share.lever) lever_part = std::min(lever_part, std::pow(share.lever * frame.scale / arm, 2));
    if (view.is_held || !view.has_own_frame) is_anywhere = true;  // where the clutch has put it only the tick knows
    const double margin = 1.2;
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3 device{margin * (corner & 1 ? 1 : -1) * share.radius, margin * (corner & 2 ? 1 : -1) * share.radius,
                        margin * (corner & 4 ? 0.5 : -0.5) * share.height};
      const Vec3 place = frame.scale * to_local(frame.pose, device);
      out.within.add(place - Vec3{arm, arm, arm});
      out.within.add(place + Vec3{arm, arm, arm});
    }
  }
  if (is_anywhere) out.within = {};
  if (!(out.to_device > 0)) return out;
  out.stiffness = std::min(lever_part * share.stiffness, most > 0 ? most : never) / out.to_device;
  out.damping = share.damping / out.to_device;
  return out;
}

Bounds bounds_alone(const SceneShare& share) noexcept {
  return {share.stiffness, share.stiffness / share.points, share.damping, share.damping / share.points};
}

std::vector<Admitted> admit(const Snapshot& snapshot, const SceneShare& share, double now) {
  std::vector<Wish> wishes;
  snapshot.chunks.for_each([&](uint32_t number, const Chunk& chunk) {
    for_each_bit(chunk.used, [&](uint32_t i) {
      const Row& row = chunk.row(i);
      if (row.is_named && !row.is_in) return;  // it is disabled
      const Object& object = *row.object;
      const Motion& motion = chunk.motion(i);
      if (row.next != no_row && !is_elsewhere(object, motion, snapshot, row.next)) return;  // that one claims for both
      const unsigned points =
          std::min(share.points, static_cast<unsigned>(std::popcount(object.point_mask())));
      const bool is_moving = is_under_way(motion, now) || motion.has_offset(now, share.blend);
      Wish wish{{number * chunk_size + i, &object, is_moving, {}}, row.is_named, std::max(points, 1u), 0, 0, 0, &motion};
      // Where the shape makes it jump, as a bend does, it gets a part as if it were steep.
      const bool jumps = object.has_ridges() || !(object.steepest_slope < never);
      const double law = jumps ? std::max(object.law_slope, share.stiffness / 4) : object.law_slope;
      wish.law = std::min(law, share.stiffness);
      if (object.is_solid()) {
        wish.contact = object.contact.stiffness > 0 ? std::min(object.contact.stiffness, share.stiffness) : share.stiffness;
        wish.damping = points * object.contact.damping;
      }
      wish.damping += object.damping;
      wishes.push_back(wish);
    });
  });

  // A smaller share of a bounded force is sloped farther away, so the regions grow until nothing changes any more; should
  // that take long, they are as large as they can be.
  std::vector<double> parts(wishes.size(), 1.0);
  constexpr int last_round = 8;
  for (int round = 0; round <= last_round && share.stiffness < never; ++round) {
    std::vector<Claim> claims;
    for (size_t i = 0; i < wishes.size(); ++i) {
      const double slope = wishes[i].law + wishes[i].points * wishes[i].contact;
      const double reach = round < last_round ? sloped_reach(wishes[i], parts[i]) : felt_reach(wishes[i], 0);
      claims.push_back(claim_of(wishes[i], reach, now, share, slope));
    }
    const std::vector<double> found = shares_of(claims, share.within, share.stiffness);
    bool is_same = true;
    for (size_t i = 0; i < wishes.size(); ++i) {
      is_same &= found[i] >= 0.99 * parts[i];
      parts[i] = std::min(parts[i], found[i]);
    }
    if (is_same) break;
  }
  std::vector<double> damping(wishes.size(), 1.0);
  if (share.damping < never) {
    std::vector<Claim> claims;
    for (const Wish& wish : wishes) {
      claims.push_back(claim_of(wish, felt_reach(wish, parts[claims.size()]), now, share, wish.damping));
    }
    damping = shares_of(claims, share.within, share.damping);
  }

  std::vector<Admitted> out;
  out.reserve(wishes.size());
  for (size_t i = 0; i < wishes.size(); ++i) {
    if (!wishes[i].is_named) continue;
    Admitted row = wishes[i].row;
    const Object& object = *row.object;
    const unsigned points = wishes[i].points;
    row.bounds = {share.stiffness, share.stiffness / points, share.damping, share.damping / points};
    if (parts[i] < 1) row.bounds.slope = parts[i] * wishes[i].law;
    if (parts[i] < 1) row.bounds.stiffness = parts[i] * wishes[i].contact;
    if (damping[i] < 1) row.bounds.damping = damping[i] * object.damping;
    if (damping[i] < 1) row.bounds.contact_damping = damping[i] * object.contact.damping;
    row.bounds = of_use(row.bounds, object);
    out.push_back(row);
  }
  return out;
}

}  // namespace fs
