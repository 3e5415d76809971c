#include "scene/admission.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string_view>
#include <unordered_map>

#include "field/budget.h"
#include "field/frame.h"

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

// What one row wants, in scene units.
struct Wish {
  Admitted row;
  bool is_named;
  unsigned points;  // of the tool, that feel it
  double law = 0, contact = 0;  // N/m, of the contact on all points together
  double damping = 0;           // N s/m
  const Motion* motion;
};

// The distances from an object up to which something of it is felt, m; below 0: nowhere.
struct Reach {
  double front, back;  // of a plane; else only the greater counts
};

// How deep a contact of this stiffness can be; infinite for 0.
Reach contact_reach(const Wish& wish, double stiffness) {
  const Object& object = *wish.row.object;
  if (!object.is_solid()) return {-1, -1};
  const double depth = object.contact.limit * wish.points / stiffness;
  const fs_keep keep = object.contact.keep;
  return {keep == FS_KEEP_FRONT ? 0 : depth, keep == FS_KEEP_BACK ? 0 : depth};
}

Reach felt_reach(const Wish& wish, double stiffness) {  // how far it is felt at all
  const Law& law = wish.row.object->law;
  const Reach contact = contact_reach(wish, stiffness);
  return {std::max(support(law.front), contact.front), std::max(support(law.back), contact.back)};
}

Claim claim_of(const Wish& wish, Reach reach, double now, const SceneShare& share, double slope) {
  const Object& object = *wish.row.object;
  Claim out;
  out.slope = slope;
  const Motion& motion = *wish.motion;
  const bool is_on_its_way = is_under_way(motion, now);
  double more = 0;  // m, because it moves
  if (is_on_its_way) {
    more += share.ahead * (norm(motion.twist.linear) + norm(motion.twist.angular) * std::fmin(object.radius, 1e3));
  }
  if (motion.has_offset(now, share.blend)) more += motion.most_offset();
  const Pose pose = motion.at(now, 0);
  out.centre = pose.position;
  if (object.primitive == FS_PRIMITIVE_PLANE) {
    const bool is_turning = is_on_its_way && norm(motion.twist.angular) > 0;
    const double front = std::max(reach.front, 0.0), back = std::max(reach.back, 0.0);
    out.region = is_turning ? Claim::Region::everywhere : Claim::Region::slab;
    out.normal = rotate(pose.orientation, {0, 0, 1});
    out.radius = 0.5 * (front + back) + more;
    if (out.radius < never) out.centre += 0.5 * (front - back) * out.normal;
  } else {
    out.radius = object.radius + std::max(reach.front, reach.back) + more;
  }
  if (!(out.radius < 1e9)) out.region = Claim::Region::everywhere;
  return out;
}

// What all of them want, and where.
struct Claims {
  std::vector<Claim> all;

  // number: of the wish. user: that claims for it.
  void add(const Wish& wish, size_t number, size_t user, Reach reach, double slope, double now, const SceneShare& share) {
    if (!(slope > 0) || !(std::max(reach.front, reach.back) >= 0)) return;
    all.push_back(claim_of(wish, reach, now, share, slope));
    all.back().object = static_cast<uint32_t>(number);
    all.back().user = static_cast<uint32_t>(user);
  }
  // Claims for the steep part of a force that has this bound, N/m, and for what is left of its slope farther away.
  void add_law(const Wish& wish, size_t number, size_t user, double bound, double now, const SceneShare& share) {
    const Law& law = wish.row.object->law;
    const Reach all = {support(law.front), support(law.back)};
    if (wish.row.object->has_ridges()) return add(wish, number, user, all, wish.law, now, share);  // one may be at any distance
    const bool turns = wish.row.object->primitive != FS_PRIMITIVE_PLANE;
    double slope = wish.law;
    Reach reach{-1, -1};
    for (const double level : {1.0 / 4, 1.0 / 16, 1.0 / 64, 1.0 / 256}) {
      reach = {slope_end(law.front, bound, level, turns), slope_end(law.back, bound, level, turns)};
      if (reach.front >= all.front && reach.back >= all.back) break;
      add(wish, number, user, reach, slope - level * bound, now, share);
      slope = level * bound;
    }
    add(wish, number, user, turns ? all : reach, slope, now, share);
  }

  Shares shares(size_t users, const Box& within, double total) const;
  double most(const Box& within) const;

 private:
  std::vector<Claim> anywhere() const;
};

// Where nothing is known of where the hand is: a box about all that is somewhere; slabs are everywhere then.
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

// Where nothing is known of where the hand is: slabs that are not parallel meet somewhere.
std::vector<Claim> Claims::anywhere() const {
  std::vector<Claim> out = all;
  for (Claim& claim : out) {
    if (claim.region == Claim::Region::slab) claim.region = Claim::Region::everywhere;
  }
  return out;
}

Shares Claims::shares(size_t users, const Box& within, double total) const {
  if (!within.is_empty()) return fair_shares(all, users, within, total);
  const std::vector<Claim> claims = anywhere();
  return fair_shares(claims, users, box_of(claims), total);
}

double Claims::most(const Box& within) const {
  if (!within.is_empty()) return most_wanted(all, within);
  const std::vector<Claim> claims = anywhere();
  return most_wanted(claims, box_of(claims));
}

// The wishes of all that may be felt where the tool may be.
std::vector<Wish> wishes_of(const Snapshot& snapshot, const SceneShare& share, double now, const Memory* memory, double& clear) {
  std::vector<Wish> out;
  bool is_any_fading = false;
  for_each_within(snapshot.chunks, share.within, clear, [&](uint32_t number, const Row& row, const Motion& motion) {
    // One that is disabled counts until it has faded out.
    const bool is_going = row.is_named && !row.is_in;
    if (is_going && !(memory && memory->weight_at(number, row.version, now) > 0)) return;
    const Object& object = *row.object;
    const auto points = static_cast<unsigned>(std::popcount(object.point_mask()));
    const bool is_moving = is_going || is_under_way(motion, now) || motion.has_offset(now, share.blend);
    Wish wish{{number, &object, is_moving, {}, {}}, row.is_named, std::clamp(points, 1u, share.points), 0, 0, 0, &motion};
    double law = object.law_slope;
    if (object.jumps()) {
      // At a bend that attracts only the direction jumps, and leads away from there: it gets a part as if it were steep.
      const bool only_bends = law < never && !object.has_ridges();
      law = std::min(only_bends ? std::max(law, share.whole / 4) : never, object.enough_slope);
    }
    wish.law = std::min(law, share.whole);
    if (object.is_solid()) {
      const double each = object.contact.stiffness > 0 ? object.contact.stiffness : never;
      wish.contact = std::min(wish.points * each, share.whole);
      wish.damping = wish.points * object.contact.damping;
    }
    wish.damping += object.damping;
    if (!share.within.is_empty()) {
      const double gap = distance(claim_of(wish, felt_reach(wish, 0), now, share, 0), share.within);
      if (gap > 0) clear = std::min(clear, diagonal * gap);
      if (gap > 0) return;
    }
    is_any_fading |= !row.is_named;
    out.push_back(wish);
  });
  if (!is_any_fading) return out;
  // An older version that fades out where the newest one is felt: as their weights add up to 1, that one claims for both.
  std::unordered_map<std::string_view, Vec3> newest;
  for (const Wish& wish : out) {
    if (wish.is_named) newest[wish.row.object->name] = wish.motion->pose.position;
  }
  std::erase_if(out, [&](const Wish& wish) {
    const Object& object = *wish.row.object;
    const auto found = wish.is_named ? newest.end() : newest.find(object.name);
    if (found == newest.end()) return false;
    const double size = object.primitive == FS_PRIMITIVE_PLANE ? 0 : object.radius;
    return norm(found->second - wish.motion->pose.position) <= size + std::fmax(0, object.law.support);
  });
  return out;
}

// N/m, what all wishes together want at most at one place.
double most_of(const std::vector<Wish>& wishes, const SceneShare& share, double now) {
  Claims claims;
  for (size_t i = 0; i < wishes.size(); ++i) {
    const Wish& wish = wishes[i];
    claims.add_law(wish, i, 2 * i, wish.law, now, share);
    claims.add(wish, i, 2 * i + 1, contact_reach(wish, wish.contact), wish.contact, now, share);
  }
  return std::min(claims.most(share.within), share.whole);
}

// The bounds of the slopes of all wishes: of the law of wish i as user 2i, of its contact as user 2i + 1.
// clear: lowered to the gap between where the tool may be and what is claimed elsewhere.
Shares slopes_of(const std::vector<Wish>& wishes, const SceneShare& share, double now, double& clear) {
  const size_t users = 2 * wishes.size();
  std::vector<double> bounds(users);
  for (size_t i = 0; i < wishes.size(); ++i) bounds[2 * i] = wishes[i].law, bounds[2 * i + 1] = wishes[i].contact;
  // A bounded force is sloped farther away the lower the bound is, so the regions grow until nothing changes any more; should
  // that take long, they are as large as they can be.
  constexpr int last_round = 40;
  constexpr double same = 0.99;
  Shares out{std::vector<double>(users, never), std::vector<uint32_t>(users, Shares::none), {}};
  for (int round = 0; round <= last_round && share.stiffness < never; ++round) {
    Claims claims;
    for (size_t i = 0; i < wishes.size(); ++i) {
      const Wish& wish = wishes[i];
      const bool is_last = round == last_round;
      const double law = same * bounds[2 * i], contact = same * bounds[2 * i + 1];
      if (is_last) claims.add(wish, i, 2 * i, felt_reach(wish, 0), wish.law, now, share);
      if (!is_last) claims.add_law(wish, i, 2 * i, law, now, share);
      claims.add(wish, i, 2 * i + 1, contact_reach(wish, is_last ? 0 : contact), wish.contact, now, share);
    }
    if (!share.within.is_empty()) {
      for (const Claim& claim : claims.all) {
        const double gap = distance(claim, share.within);
        if (gap > 0) clear = std::min(clear, diagonal * gap);
      }
    }
    const Shares found = claims.shares(users, share.within, share.stiffness);
    const auto first = static_cast<uint32_t>(out.crowds.size());
    out.crowds.insert(out.crowds.end(), found.crowds.begin(), found.crowds.end());
    bool is_same = true;
    for (size_t user = 0; user < users; ++user) {
      is_same &= found.levels[user] >= same * bounds[user];
      if (!(found.levels[user] < bounds[user])) continue;
      bounds[user] = out.levels[user] = found.levels[user];
      out.crowd[user] = first + found.crowd[user];
    }
    if (is_same) break;
  }
  return out;
}

// With whom the users of a wish share, as the first that has to does.
SharedWith shared_with(const std::vector<Wish>& wishes, size_t number, const Shares& shares) {
  SharedWith out;
  const uint32_t in = shares.crowd[2 * number] != Shares::none ? shares.crowd[2 * number] : shares.crowd[2 * number + 1];
  if (in == Shares::none) return out;
  const Crowd& crowd = shares.crowds[in];
  const std::string& own = wishes[number].row.object->name;
  for (size_t i = 0; i < std::min<size_t>(crowd.count, crowd.objects.size()); ++i) {
    const std::string& name = wishes[crowd.objects[i]].row.object->name;
    const bool is_new = std::find(out.names.begin(), out.names.end(), name) == out.names.end();
    if (name != own && is_new) out.names.push_back(name);
  }
  out.count = std::max<size_t>(crowd.count > crowd.objects.size() ? crowd.count - 1 : 0, out.names.size());
  return out;
}

}  // namespace

std::string SharedWith::text(size_t room) const {
  std::string list, out;
  for (size_t shown = 0; shown <= names.size(); ++shown) {
    if (shown > 0) list += (shown > 1 ? ", " : "") + names[shown - 1];
    const size_t more = count - shown;
    std::string whole = list;
    if (more > 0) whole = shown > 0 ? list + " and " + std::to_string(more) + " more" : std::to_string(more) + " others";
    if (more == 1 && shown == 0) whole = "another";
    if (has_clients) whole += whole.empty() ? "other clients" : "; other clients";
    if (whole.size() <= room) out = whole;
  }
  return out;
}

SceneShare share_of(const Views& views, const LoopShare& share, double most, double blend, double ahead) {
  SceneShare out{never, never, never, blend, ahead, 0, 0, 1, 0, {}};
  bool is_anywhere = !(share.radius > 0 && share.height > 0);
  double lever_part = 1;
  for (const View& view : views.rows) {
    if (view.version == 0) continue;
    const fs_frame& frame = view.frame;
    out.to_device = std::max(out.to_device, frame.scale * frame.force_scale);
    out.points = std::max(out.points, static_cast<unsigned>(view.tool->points.size()));
    double arm = 0;
    for (const Vec3& point : view.tool->points) arm = std::max(arm, norm(point));
    out.arm = std::max(out.arm, arm);
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
  const auto in_scene = [&](double stiffness) { return std::min(lever_part * stiffness, most > 0 ? most : never) / out.to_device; };
  out.stiffness = in_scene(share.stiffness);
  out.whole = in_scene(share.whole);
  out.to_loop = out.to_device / lever_part;
  out.damping = share.damping / out.to_device;
  return out;
}

Bounds bounds_alone(const SceneShare& share) noexcept {
  return {share.stiffness, share.stiffness / share.points, share.damping, share.damping / share.points};
}

Admission admit(const Snapshot& snapshot, const SceneShare& share, double now, const Memory* memory) {
  Admission out;
  std::vector<Wish> wishes = wishes_of(snapshot, share, now, memory, out.clear);
  if (share.stiffness < share.whole) {
    out.wanted = share.to_loop * most_of(wishes, share, now);
    for (Wish& wish : wishes) {
      wish.law = std::min(wish.law, share.stiffness);
      wish.contact = std::min(wish.contact, share.stiffness);
    }
  }
  const Shares slopes = slopes_of(wishes, share, now, out.clear);
  Shares damping;
  if (share.damping < never) {
    Claims claims;
    for (size_t i = 0; i < wishes.size(); ++i) {
      const double contact = std::min(slopes.levels[2 * i + 1], wishes[i].contact);
      claims.add(wishes[i], i, i, felt_reach(wishes[i], contact), wishes[i].damping, now, share);
    }
    damping = claims.shares(wishes.size(), share.within, share.damping);
  }

  out.objects.reserve(wishes.size());
  for (size_t i = 0; i < wishes.size(); ++i) {
    out.has_fading |= !wishes[i].is_named;
    if (!wishes[i].is_named) continue;
    Admitted row = wishes[i].row;
    const Object& object = *row.object;
    const unsigned points = wishes[i].points;
    const double law = slopes.levels[2 * i], contact = slopes.levels[2 * i + 1];
    row.bounds = {share.stiffness, share.stiffness / points, share.damping, share.damping / points};
    if (law < wishes[i].law) row.bounds.slope = law;
    if (contact < wishes[i].contact) row.bounds.stiffness = contact / points;
    if (!damping.levels.empty() && damping.levels[i] < wishes[i].damping) {
      const double part = damping.levels[i] / wishes[i].damping;
      row.bounds.damping = part * object.damping;
      row.bounds.contact_damping = part * object.contact.damping;
    }
    row.bounds = of_use(row.bounds, object);
    row.shared_with = shared_with(wishes, i, slopes);
    out.objects.push_back(std::move(row));
  }
  return out;
}

}  // namespace fs
