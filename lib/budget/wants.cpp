#include "budget/wants.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string_view>
#include <unordered_map>

namespace fs {
namespace {

bool is_under_way(const Motion& motion, double now) { return motion.horizon > 0 && now < motion.time + motion.horizon; }

// Calls f(number, Row, Motion) for each row that may be felt in the box; empty: anywhere. clear: lowered to the gap to others.
template <class F>
void for_each_within(const Chunks& chunks, const Box& box, double& clear, F&& f) {
  const auto is_near = [&](const Box& its) {
    if (box.is_empty()) return true;
    if (its.is_empty()) return false;
    const double gap = its.gap(box);
    if (gap > 0) clear = std::min(clear, gap);
    return gap <= 0;
  };
  chunks.for_each([&](uint32_t number, const Chunk& chunk) {
    const bool is_any_near = is_near(chunk.box);
    for_each_bit(is_any_near ? chunk.used : chunk.used & chunk.planes, [&](uint32_t i) {
      const bool is_plane = chunk.planes & bit_of(i);
      if (is_plane || is_near(chunk.box_of(i))) f(number * chunk_size + i, chunk.row(i), chunk.motion(i));
    });
  });
}

constexpr double diagonal = 0.577;  // of a way along a diagonal, to each side

SlopeWant slope_want(const ObjectWant& want, Reach reach, double now, const SceneLimit& limit, double slope) {
  const Object& object = *want.object;
  SlopeWant out;
  out.slope = slope;
  const Motion& motion = *want.motion;
  const bool is_on_its_way = is_under_way(motion, now);
  double more = 0;  // m, because it moves
  if (is_on_its_way) {
    more += limit.ahead * (norm(motion.twist.linear) + norm(motion.twist.angular) * std::fmin(object.radius, 1e3));
  }
  if (motion.has_offset(now, limit.blend)) more += motion.most_offset();
  const Pose pose = motion.at(now, 0);
  out.centre = pose.position;
  if (object.primitive == FS_PRIMITIVE_PLANE) {
    const bool is_turning = is_on_its_way && norm(motion.twist.angular) > 0;
    const double front = std::max(reach.front, 0.0), back = std::max(reach.back, 0.0);
    out.region = is_turning ? SlopeWant::Region::everywhere : SlopeWant::Region::slab;
    out.normal = rotate(pose.orientation, {0, 0, 1});
    out.radius = 0.5 * (front + back) + more;
    if (out.radius < never) out.centre += 0.5 * (front - back) * out.normal;
  } else {
    out.radius = object.radius + std::max(reach.front, reach.back) + more;
  }
  if (!(out.radius < 1e9)) out.region = SlopeWant::Region::everywhere;
  return out;
}

// Where nothing is known of where the hand is: a box about all that is somewhere; slabs are everywhere then.
Box box_of(const std::vector<SlopeWant>& wants) {
  Box out;
  for (const SlopeWant& want : wants) {
    if (want.region == SlopeWant::Region::everywhere) continue;
    const Vec3 side{want.radius, want.radius, want.radius};
    out.add(want.centre - side);
    out.add(want.centre + side);
  }
  if (out.is_empty()) out.add(Vec3{});
  return out;
}

// Where nothing is known of where the hand is: slabs that are not parallel meet somewhere.
std::vector<SlopeWant> anywhere(std::vector<SlopeWant> wants) {
  for (SlopeWant& want : wants) {
    if (want.region == SlopeWant::Region::slab) want.region = SlopeWant::Region::everywhere;
  }
  return wants;
}

}  // namespace

Reach contact_reach(const ObjectWant& want, double stiffness) {
  const Object& object = *want.object;
  if (!object.is_solid()) return {-1, -1};
  double depth = object.contact.limit * want.points / stiffness;
  if (const Texture* const texture = object.texture()) depth = depth / least_stiffness_part + texture->deepest();
  const fs_keep keep = object.contact.keep;
  return {keep == FS_KEEP_FRONT ? 0 : depth, keep == FS_KEEP_BACK ? 0 : depth};
}

Reach felt_reach(const ObjectWant& want, double stiffness) {
  const Law& law = want.object->law;
  const Reach contact = contact_reach(want, stiffness);
  return {std::max(support(law.front), contact.front), std::max(support(law.back), contact.back)};
}

void SlopeWants::add(const ObjectWant& want, size_t number, size_t user, Reach reach, double slope) {
  if (!(slope > 0) || !(std::max(reach.front, reach.back) >= 0)) return;
  all.push_back(slope_want(want, reach, now, limit, slope));
  all.back().object = static_cast<uint32_t>(number);
  all.back().user = static_cast<uint32_t>(user);
}

void SlopeWants::add_law(const ObjectWant& want, size_t number, size_t user, double bound) {
  const Law& law = want.object->law;
  const Reach whole = {support(law.front), support(law.back)};
  if (want.object->has_ridges()) return add(want, number, user, whole, want.law);  // one may be at any distance
  const bool turns = want.object->primitive != FS_PRIMITIVE_PLANE;
  double slope = want.law;
  Reach reach{-1, -1};
  for (const double level : {1.0 / 4, 1.0 / 16, 1.0 / 64, 1.0 / 256}) {
    reach = {slope_end(law.front, bound, level, turns), slope_end(law.back, bound, level, turns)};
    if (reach.front >= whole.front && reach.back >= whole.back) break;
    add(want, number, user, reach, slope - level * bound);
    slope = level * bound;
  }
  add(want, number, user, turns ? whole : reach, slope);
}

FairBounds SlopeWants::bounds(size_t users, double most) const {
  if (!limit.within.is_empty()) return fair_bounds(all, users, limit.within, most);
  const std::vector<SlopeWant> wants = anywhere(all);
  return fair_bounds(wants, users, box_of(wants), most);
}

double SlopeWants::most_wanted() const {
  if (!limit.within.is_empty()) return fs::most_wanted(all, limit.within);
  const std::vector<SlopeWant> wants = anywhere(all);
  return fs::most_wanted(wants, box_of(wants));
}

void SlopeWants::lower_to_gap(double& clear) const {
  if (limit.within.is_empty()) return;
  for (const SlopeWant& want : all) {
    const double gap = distance(want, limit.within);
    if (gap > 0) clear = std::min(clear, diagonal * gap);
  }
}

std::vector<ObjectWant> object_wants(const Snapshot& snapshot, const SceneLimit& limit, double now, const Memory* memory,
                                     double& clear) {
  std::vector<ObjectWant> out;
  bool is_any_fading = false;
  for_each_within(snapshot.chunks, limit.within, clear, [&](uint32_t number, const Row& row, const Motion& motion) {
    // One that is disabled counts until it has faded out.
    const bool is_going = row.is_named && !row.is_in;
    if (is_going && !(memory && memory->weight_at(number, row.version, now) > 0)) return;
    const Object& object = *row.object;
    const auto points = static_cast<unsigned>(std::popcount(object.point_mask()));
    const bool is_moving = is_going || is_under_way(motion, now) || motion.has_offset(now, limit.blend);
    ObjectWant want{number, &object, is_moving, row.is_named, std::clamp(points, 1u, limit.points), 0, 0, 0, &motion};
    double law = object.law_slope;
    if (object.jumps()) {
      // At a bend that attracts only the direction jumps, and leads away from there: it wants a part as if it were steep.
      const bool only_bends = law < never && !object.has_ridges();
      law = std::min(only_bends ? std::max(law, limit.whole / 4) : never, object.enough_slope);
    }
    want.law = std::min(law, limit.whole);
    if (object.is_solid()) {
      const double each = object.contact.stiffness > 0 ? object.contact_slope : never;
      want.contact = std::min(want.points * each, limit.whole);
      want.damping = want.points * object.contact.damping;
    }
    want.damping += object.damping;
    if (!limit.within.is_empty()) {
      const double gap = distance(slope_want(want, felt_reach(want, 0), now, limit, 0), limit.within);
      if (gap > 0) clear = std::min(clear, diagonal * gap);
      if (gap > 0) return;
    }
    is_any_fading |= !row.is_named;
    out.push_back(want);
  });
  if (!is_any_fading) return out;
  // An older version that fades out where the newest one is felt: as their weights add up to 1, the newest wants for both.
  std::unordered_map<std::string_view, Vec3> newest;
  for (const ObjectWant& want : out) {
    if (want.is_named) newest[want.object->name] = want.motion->pose.position;
  }
  std::erase_if(out, [&](const ObjectWant& want) {
    const Object& object = *want.object;
    const auto found = want.is_named ? newest.end() : newest.find(object.name);
    if (found == newest.end()) return false;
    const double size = object.primitive == FS_PRIMITIVE_PLANE ? 0 : object.radius;
    return norm(found->second - want.motion->pose.position) <= size + std::fmax(0, object.law.support);
  });
  return out;
}

}  // namespace fs
