#include "field/proxy.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <span>

namespace fs {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

bool are_equal(const Pose& a, const Pose& b) noexcept {
  const Quat &p = a.orientation, &q = b.orientation;
  return a.position == b.position && p.w == q.w && p.x == q.x && p.y == q.y && p.z == q.z;
}

// The plane of one member that stops its proxy on the way to a place; place: where, scene frame; part: of the way.
bool find_plane(const Member& member, Vec3 to, double radius, uint32_t* visits, Plane& out, Vec3& place, double& part) noexcept {
  const Solid& solid = *member.solid;
  const Vec3 local = to_local(solid.pose, to);
  if (local == member.touch->at) return false;
  Crossing crossing;
  if (!first_crossing(solid.object->primitive, solid.object->shape.get(), member.touch->side, member.touch->at, local, radius,
                      crossing, visits)) {
    return false;
  }
  part = crossing.part;
  assert(part >= 0 && part <= 1 && std::fabs(norm(crossing.normal) - 1) < 1e-6);
  out.margin = margin_at(solid.pose, member.touch->at, local);
  out.normal = rotate(solid.pose.orientation, crossing.normal);
  place = solid.pose * crossing.point + out.margin * out.normal;
  out.offset = dot(out.normal, place);
  return true;
}

// Where the object itself takes its proxy.
Vec3 carried(const Member& member) noexcept { return member.solid->pose * member.touch->at; }

}  // namespace

double margin_at(const Pose& pose, Vec3 from, Vec3 to) noexcept {
  return 64 * epsilon * (largest_coordinate(from) + largest_coordinate(to) + largest_coordinate(pose.position));
}

// The first plane that stops it; place: where; least: the part of the way.
bool Proxy::find_hit(Vec3 to, Plane& out, Vec3& place, double& least) const noexcept {
  least = std::numeric_limits<double>::infinity();
  for (uint32_t i = 0; i < count; ++i) {
    Plane plane;
    Vec3 here;
    double part;
    if (!find_plane(members[i], to, point_radius, visits, plane, here, part) || !(part < least)) continue;
    least = part;
    out = plane;
    out.member = i;
    place = here;
  }
  return least < std::numeric_limits<double>::infinity();
}

// Moves the proxy along a way that has been found free.
void Proxy::go(Vec3 to) noexcept {
  at = to;
  for (uint32_t i = 0; i < count; ++i) {
    Member& member = members[i];
    member.touch->at = to_local(member.solid->pose, to);
  }
}

bool Proxy::is_free_to(Vec3 place, uint32_t except) const noexcept {
  for (uint32_t i = 0; i < count; ++i) {
    Plane plane;
    Vec3 there;
    double part;
    if (i != except && find_plane(members[i], place, point_radius, visits, plane, there, part)) return false;
  }
  return true;
}

bool Planes::hold(Vec3 hand, Vec3& goal) noexcept {
  const uint32_t count = plane_count;
  assert(count > 0 && count <= planes.size());
  double depth[3], gram[3][3], margin = 0;
  for (uint32_t i = 0; i < count; ++i) {
    depth[i] = planes[i].offset - dot(planes[i].normal, hand);
    margin = std::max(margin, planes[i].margin / 8);
    for (uint32_t k = 0; k < count; ++k) gram[i][k] = dot(planes[i].normal, planes[k].normal);
  }
  // Each set of planes: the point that lies on all of them. Where they only push, and no other plane is passed, no point is nearer
  // (the conditions of Karush, Kuhn and Tucker).
  for (uint32_t set = 1; set < 1u << count; ++set) {
    uint32_t index[3] = {}, size = 0;
    for (uint32_t i = 0; i < count; ++i) {
      if (set >> i & 1) index[size++] = i;
    }
    double pushed[3] = {};
    if (size == 1) {
      pushed[0] = depth[index[0]];
    } else {
      // Cramer's rule; the matrix is symmetric with ones on its diagonal.
      const double ab = gram[index[0]][index[1]];
      const double a = depth[index[0]], b = depth[index[1]];
      if (size == 2) {
        const double det = 1 - ab * ab;
        if (!(det > 1e-9)) continue;
        pushed[0] = (a - ab * b) / det;
        pushed[1] = (b - ab * a) / det;
      } else {
        const double ac = gram[index[0]][index[2]], bc = gram[index[1]][index[2]], c = depth[index[2]];
        const double det = 1 + 2 * ab * bc * ac - ab * ab - bc * bc - ac * ac;
        if (!(det > 1e-9)) continue;
        pushed[0] = (a * (1 - bc * bc) + b * (ac * bc - ab) + c * (ab * bc - ac)) / det;
        pushed[1] = (a * (bc * ac - ab) + b * (1 - ac * ac) + c * (ab * ac - bc)) / det;
        pushed[2] = (a * (ab * bc - ac) + b * (ab * ac - bc) + c * (1 - ab * ab)) / det;
      }
    }
    bool is_good = true;
    Vec3 push{};
    for (uint32_t i = 0; i < size; ++i) {
      is_good &= pushed[i] >= 0;
      push += pushed[i] * planes[index[i]].normal;
    }
    for (uint32_t i = 0; i < count; ++i) {
      const double rounding = margin + 1e-14 * std::fabs(depth[i]);  // a unit vector is one within rounding
      is_good &= dot(planes[i].normal, push) >= depth[i] - rounding;
    }
    if (!is_good) continue;
    goal = hand + push;
    for (uint32_t i = 0; i < size; ++i) {
      planes[i] = planes[index[i]];
      pushes[i] = pushed[i];
    }
    plane_count = size;
    return true;
  }
  return false;
}

uint32_t Planes::span(Vec3 (&basis)[3]) const noexcept {
  uint32_t size = 0;
  for (uint32_t p = 0; p < plane_count; ++p) {
    Vec3 rest = planes[p].normal;
    for (uint32_t i = 0; i < size; ++i) rest += -dot(basis[i], rest) * basis[i];
    if (norm(rest) > 1e-6) basis[size++] = normalized(rest);
  }
  return size;
}

Vec3 Planes::along(Vec3 way) const noexcept {
  Vec3 basis[3];
  const uint32_t size = span(basis);
  for (uint32_t i = 0; i < size; ++i) way += -dot(basis[i], way) * basis[i];
  return way;
}

bool Planes::is_on_one(Vec3 place, double way) const noexcept {
  for (uint32_t p = 0; p < plane_count; ++p) {
    if (dot(planes[p].normal, place) - planes[p].offset <= 4 * planes[p].margin + 1e-9 * way) return true;
  }
  return false;
}

bool Proxy::has_friction() const noexcept {
  for (uint32_t p = 0; p < plane_count; ++p) {
    if (members[planes[p].member].solid->object->friction().still > 0) return true;
  }
  return false;
}

Press Proxy::press_at(Vec3 hand, Vec3 place) const noexcept {
  const Vec3 way = place - hand;
  Press out;
  out.depth = norm(way);
  if (!(out.depth > 0)) return out;
  out.normal = (1 / out.depth) * way;
  const Solid& solid = *members[0].solid;
  const Texture* const texture = solid.object->texture();
  if (!texture) return out;
  const double part = solid.object->texture_part;
  const Texture::Sample sample = texture->at(to_local(solid.pose, place - point_radius * out.normal));
  out.depth = std::max(0.0, out.depth + part * sample.height);
  out.slope = along(rotate(solid.pose.orientation, part * sample.slope));
  Mat3 flat = identity();  // projects on the surface
  Vec3 basis[3];
  const uint32_t size = span(basis);
  for (uint32_t i = 0; i < size; ++i) flat += -1.0 * outer(basis[i], basis[i]);
  out.curvature = flat * rotated(solid.pose.orientation, part * sample.curvature) * flat;
  return out;
}

// A cone (Harwin & Melder 2002). The coefficient is the mean of those of the planes, by how far each pushes. That of a surface
// falls while the proxy slips: see fs_surface_settings.
double Proxy::friction_reach(Vec3 hand, Vec3 goal, double lag) noexcept {
  struct Part {
    Friction friction;
    double weight, slipped;
  };
  std::array<Part, 3> parts;
  double depth = 0;
  for (uint32_t p = 0; p < plane_count; ++p) depth += pushes[p];
  if (!(depth > 0)) return 0;
  double still = 0, drop = 0;
  for (uint32_t p = 0; p < plane_count; ++p) {
    const Member& member = members[planes[p].member];
    parts[p] = {member.solid->object->friction(), pushes[p] / depth, member.touch->slipped};
    still += parts[p].weight * parts[p].friction.still;
    drop += parts[p].weight * parts[p].friction.drop;
  }
  double normal = norm(goal - hand);
  if (members[0].solid->object->texture()) {
    const Press press = press_at(hand, goal);
    normal = press.depth * norm(press.turned());
  }
  if (!(drop > 0)) {  // as mostly
    for (uint32_t p = 0; p < plane_count; ++p) members[planes[p].member].touch->slipped = 0;
    return still * normal;
  }
  for (uint32_t p = 0; p < plane_count; ++p) {
    Friction& friction = parts[p].friction;
    // So the cone closes by at most half of the way of the proxy.
    friction.distance = std::max(friction.distance, 2 * friction.drop * normal);
  }
  const auto all = std::span(parts).first(plane_count);
  // The coefficient when the proxy has gone on by so much, m; fall: by how much it falls there for each metre.
  double fall = 0;
  const auto coefficient_after = [&](double way) {
    double sum = fall = 0;
    for (const Part& part : all) {
      const Friction& f = part.friction;
      const double slipped = f.drop > 0 ? part.slipped + way / f.distance : 0;
      sum += part.weight * f.after(slipped);
      if (f.drop > 0 && slipped < 1) fall += part.weight * f.drop / f.distance;
    }
    return sum;
  };
  const auto note_slip = [&](auto&& slipped_of) {
    for (uint32_t p = 0; p < plane_count; ++p) members[planes[p].member].touch->slipped = slipped_of(parts[p]);
  };

  const double coefficient = coefficient_after(0);
  if (lag <= coefficient * normal) {  // it sticks; after a slip with the coefficient of the slip, until the hand has come back
    if (lag > (coefficient - drop / 10) * normal) return coefficient * normal;
    note_slip([](const Part&) { return 0.0; });
    return still * normal;
  }
  // It slips until friction holds it: lag - way = coefficient_after(way) * normal. The right side is of straight pieces, so
  // Newton's method ends after one step for each.
  double way = 0, reach = coefficient * normal;
  for (size_t i = 0; i <= all.size(); ++i) {
    way += (lag - way - reach) / (1 - fall * normal);
    reach = coefficient_after(way) * normal;
  }
  note_slip([way](const Part& part) {
    return part.friction.drop > 0 ? std::min(1.0, part.slipped + way / part.friction.distance) : 0.0;
  });
  return reach;
}

// The numbers of tries only bound the work of a tick: a way ends in a corner after three planes, and ways along edges of a mesh
// become shorter quickly. Where the tries do not suffice, the proxy stays where it has come to, and goes on in the next tick.
void Proxy::slide(Vec3 hand, bool was_touching) noexcept {
  constexpr int most_ways = 24, most_planes = 12;
  Vec3 target = hand;
  held = {};
  is_stuck = false;
  for (int way = 0; way < most_ways; ++way) {
    plane_count = 0;
    Vec3 goal = target;
    bool is_free = false;
    for (int i = 0; i < most_planes; ++i) {
      Plane plane;
      Vec3 place;
      double part;
      if (!find_hit(goal, plane, place, part)) {
        is_free = true;
        break;
      }
      // From exactly the surface, where a hand may have stood, it first goes above it: a vertex belongs to all its faces.
      if (part == 0 && i < 3 && is_free_to(place)) {
        go(place);
        continue;
      }
      if (way == 0 && i == 0 && !was_touching && members[plane.member].solid->object->friction().still > 0) {
        // It comes to the surface here; from here on friction holds it.
        if (is_free_to(place)) go(place);
      }
      const bool has_room = plane_count < planes.size();
      if (has_room) planes[plane_count++] = plane;
      if (!has_room || !hold(target, goal)) {  // wedged in: it stays where it is
        pushes.fill(0);
        break;
      }
      const double rounding = std::max(plane.margin, 1e-9 * norm(goal - target));
      if (norm(goal - at) <= rounding) break;  // it is there already
    }
    if (way == 0 && has_friction()) {
      // Friction: the proxy stays within a distance of the place where the surface alone would have it. When the surface has gone
      // from under the proxy, nothing holds it up: it keeps its place along the surface only.
      const bool is_on_surface = is_on_one(at, norm(goal - hand));
      const Vec3 lag = is_on_surface ? at - goal : along(at - goal);
      const double length = norm(lag), most = friction_reach(hand, goal, length);
      if (most > 0) {
        held = lag;
        if (length <= most && is_on_surface) {
          is_stuck = true;
          return;
        }
        if (length > most) held = (most / length) * held;
        target = hand + held;
        continue;
      }
    }
    if (!is_free) return;
    const double moved = norm(goal - at);
    go(goal);
    if (plane_count == 0 && !(target == hand)) {  // where friction would have it, nothing holds it
      target = hand;
      held = {};
      continue;
    }
    if (plane_count == 0 || moved <= 1e-9 * norm(goal - target)) return;
  }
}

// The nearest place that no member is in the way to. False: there is none that is near enough, or eight tries did not find it.
bool Proxy::find_place(Vec3& out) const noexcept {
  Planes by;
  Vec3 goal = at;
  double way = 0;  // m, how far objects have moved
  for (int tries = 0;; ++tries) {
    Plane plane;
    Vec3 place;
    double part;
    if (!find_hit(goal, plane, place, part)) break;
    if (by.plane_count == by.planes.size() || tries == 8) return false;
    way = std::max({way, norm(carried(members[plane.member]) - at), plane.margin});
    by.planes[by.plane_count++] = plane;
    if (!by.hold(at, goal) || norm(goal - at) > 2 * way) return false;
  }
  out = goal;
  return true;
}

uint32_t Proxy::carry() noexcept {
  Vec3 to = at;
  uint32_t by = count;  // the member that takes it along
  for (uint32_t i = 0; i < count; ++i) {
    const Member& member = members[i];
    const bool has_moved = member.before && !are_equal(member.before->pose, member.solid->pose);
    if (has_moved && member.before->is_touching && member.solid->object->friction().still > 0) by = i;
  }
  if (by < count) to = carried(members[by]);
  if (!is_free_to(to, by)) {
    Plane plane;
    Vec3 place;
    double part;
    bool is_free = false;
    if (find_hit(at, plane, place, part)) {
      to = carried(members[plane.member]);
      is_free = is_free_to(to, plane.member);
      by = plane.member;
    } else {
      to = at;
      is_free = true;
      by = count;
    }
    if (!is_free) {
      by = count;
      if (!find_place(to)) return split();
    }
  }
  // The one that has taken it along has it exactly where it was.
  const Vec3 kept = by < count ? members[by].touch->at : Vec3{};
  go(to);
  if (by < count) members[by].touch->at = kept;
  return 0;
}

// The proxy stays with the first that it has touched, and with those that are not against that.
uint32_t Proxy::split() noexcept {
  uint32_t base = 0, left = 0;
  while (base < count && !(members[base].before && members[base].before->is_touching)) ++base;
  if (base == count) base = 0;
  std::swap(members[0], members[base]);
  const Vec3 kept = members[0].touch->at, to = carried(members[0]);
  uint32_t all = count;
  for (uint32_t i = 1; i < all;) {
    Plane plane;
    Vec3 place;
    double part;
    if (!find_plane(members[i], to, point_radius, visits, plane, place, part)) {
      ++i;
      continue;
    }
    std::swap(members[i], members[--all]);
    ++left;
  }
  count = all;
  go(to);
  members[0].touch->at = kept;
  return left;
}

}  // namespace fs
