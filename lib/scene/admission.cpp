#include "scene/admission.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string_view>
#include <unordered_map>
#include <unordered_set>

#include "field/budget.h"
#include "field/frame.h"

namespace fs {
namespace {

// The distance, m, beyond which the slope of a profile is less than `part` of k, the steepest that it may have (N/m). turns: the
// direction of the force changes from place to place, as about a point: at a distance d that is a slope of f(d) / d.
double slope_end(const Profile& p, double k, double part, bool turns) {
  const double all = support(p), least = part * k;
  if (!(all >= 0) || !(k > 0)) return -1;
  if (p.reach > 0) return all;  // it may jump there
  const double late = p.limit / k;  // m, by which a capped profile is behind at most
  const auto turn_end = [&](double force) { return turns ? force / least : 0; };
  switch (p.kind) {
    case FS_PROFILE_CONSTANT: return std::fmin(all, std::fmax(p.gain / k, turn_end(p.gain)));
    case FS_PROFILE_LINEAR_INCREASING: {
      if (!(p.gain > 0)) return std::fmax(std::fmin(p.offset, p.limit) / k, turn_end(std::fmin(p.offset, p.limit)));
      return std::fmax((p.limit + std::fabs(p.offset)) / std::fmin(p.gain, k), turn_end(p.limit));
    }
    case FS_PROFILE_GAUSSIAN: {  // from one width on its slope falls, and is more than that of the turn
      double end = 1;  // widths
      while (end < 5 && p.gain / p.width * end * std::exp(-0.5 * end * end) > least) end += 0.25;
      return std::fmin(all, end * p.width + late);
    }
    case FS_PROFILE_QUADRATIC:
      if (!(p.gain > 0)) return all;
      return std::fmax(std::sqrt((p.limit + std::fabs(p.offset)) / p.gain) + late, turn_end(p.limit));
    case FS_PROFILE_INVERSE:
      return std::fmin(all, std::fmax(std::sqrt(p.gain / least), turn_end(std::fmax(p.offset, 0))) + late);
    default: return all;
  }
}

bool is_under_way(const Motion& motion, double now) { return motion.horizon > 0 && now < motion.time + motion.horizon; }

// Where the newest versions are of the names that have older ones, which fade out.
using Newest = std::unordered_map<std::string_view, Vec3>;
Newest newest_of(const Snapshot& snapshot) {
  const auto for_each = [&](auto&& f) {
    snapshot.chunks.for_each([&](uint32_t, const Chunk& chunk) {
      for_each_bit(chunk.used, [&](uint32_t i) { f(chunk.row(i), chunk.motion(i)); });
    });
  };
  std::unordered_set<std::string_view> fading;
  for_each([&](const Row& row, const Motion&) {
    if (!row.is_named) fading.insert(row.object->name);
  });
  Newest out;
  if (fading.empty()) return out;
  for_each([&](const Row& row, const Motion& motion) {
    if (row.is_named && fading.contains(row.object->name)) out[row.object->name] = motion.pose.position;
  });
  return out;
}

// Whether an older version fades out where the newest one is felt: as their weights add up to 1, that one claims for both.
bool is_covered(const Object& object, const Motion& motion, const Newest& newest) {
  const auto found = newest.find(object.name);
  if (found == newest.end()) return false;
  const double size = object.primitive == FS_PRIMITIVE_PLANE ? 0 : object.radius;
  return norm(found->second - motion.pose.position) <= size + std::fmax(0, object.law.support);
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

// Claims for the steep part of a force and for what is left of its slope farther away, with the wish to which each belongs.
struct Claims {
  std::vector<Claim> all;
  std::vector<size_t> owners;

  void add(const Wish& wish, size_t owner, double reach, double slope, double now, const SceneShare& share) {
    if (!(slope > 0)) return;
    all.push_back(claim_of(wish, reach, now, share, slope));
    owners.push_back(owner);
  }
  // part: of what it wants.
  void add_slopes(const Wish& wish, size_t owner, double part, double now, const SceneShare& share) {
    const Object& object = *wish.row.object;
    add(wish, owner, contact_reach(wish, part), wish.points * wish.contact, now, share);
    if (object.has_ridges()) return add(wish, owner, object.law.support, wish.law, now, share);  // one may be at any distance
    const bool turns = object.primitive != FS_PRIMITIVE_PLANE;
    double slope = wish.law, reach = -1;
    for (const double level : {1.0 / 4, 1.0 / 16, 1.0 / 64, 1.0 / 256}) {
      const double k = part * wish.law;
      reach = std::max(slope_end(object.law.front, k, level, turns), slope_end(object.law.back, k, level, turns));
      if (reach >= object.law.support) break;
      add(wish, owner, reach, slope - level * wish.law, now, share);
      slope = level * wish.law;
    }
    add(wish, owner, turns ? object.law.support : reach, slope, now, share);
  }

  // For each wish the part that all of its claims can have of `total`.
  std::vector<double> parts(size_t wishes, const Box& within, double total) const;
};

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

std::vector<double> Claims::parts(size_t wishes, const Box& within, double total) const {
  std::vector<Claim> claims = all;
  for (Claim& claim : claims) {  // slabs that are not parallel meet somewhere
    if (within.is_empty() && claim.region == Claim::Region::slab) claim.region = Claim::Region::everywhere;
  }
  const std::vector<double> sums = greatest_sums(claims, within.is_empty() ? box_of(claims) : within, total);
  std::vector<double> out(wishes, 1.0);
  for (size_t i = 0; i < sums.size(); ++i) {
    if (sums[i] > total) out[owners[i]] = std::min(out[owners[i]], total / sums[i]);
  }
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
  const Newest newest = newest_of(snapshot);
  std::vector<Wish> wishes;
  snapshot.chunks.for_each([&](uint32_t number, const Chunk& chunk) {
    for_each_bit(chunk.used, [&](uint32_t i) {
      const Row& row = chunk.row(i);
      if (row.is_named && !row.is_in) return;  // it is disabled
      const Object& object = *row.object;
      const Motion& motion = chunk.motion(i);
      if (!row.is_named && is_covered(object, motion, newest)) return;
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
    Claims claims;
    for (size_t i = 0; i < wishes.size(); ++i) {
      const Wish& wish = wishes[i];
      if (round < last_round) claims.add_slopes(wish, i, parts[i], now, share);
      if (round == last_round) claims.add(wish, i, felt_reach(wish, 0), wish.law + wish.points * wish.contact, now, share);
    }
    const std::vector<double> found = claims.parts(wishes.size(), share.within, share.stiffness);
    bool is_same = true;
    for (size_t i = 0; i < wishes.size(); ++i) {
      is_same &= found[i] >= 0.99 * parts[i];
      parts[i] = std::min(parts[i], found[i]);
    }
    if (is_same) break;
  }
  std::vector<double> damping(wishes.size(), 1.0);
  if (share.damping < never) {
    Claims claims;
    for (size_t i = 0; i < wishes.size(); ++i) {
      claims.add(wishes[i], i, felt_reach(wishes[i], parts[i]), wishes[i].damping, now, share);
    }
    damping = claims.parts(wishes.size(), share.within, share.damping);
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
