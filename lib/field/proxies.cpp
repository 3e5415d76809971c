#include "field/proxies.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace fs {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr double spread = 0.02;        // s, over which a jump of the proxy is spread

// A proxy lies above the surface by this much, m: more than rounding makes of coordinates as large as these of the object's
// frame.
double margin_at(const Pose& pose, Vec3 from, Vec3 to) noexcept {
  return 64 * epsilon * (largest_coordinate(from) + largest_coordinate(to) + largest_coordinate(pose.position));
}

Vec3 limited(Vec3 force, double limit) noexcept {
  const double size = norm(force);
  return size > limit ? (limit / size) * force : force;
}

bool are_equal(const Pose& a, const Pose& b) noexcept {
  const Quat &p = a.orientation, &q = b.orientation;
  return a.position == b.position && p.w == q.w && p.x == q.x && p.y == q.y && p.z == q.z;
}

}  // namespace

void Proxies::begin(double now) noexcept {
  step_ = std::clamp(now - now_, 0.0, 0.1);
  now_ = now;
  current_ = 1 - current_;
  Tick& tick = ticks_[current_];
  tick.count = 0;
  for (ViewTouches& view : tick.views) view.what = 0;
}

void Proxies::forget() noexcept {
  for (Tick& tick : ticks_) {
    tick.count = 0;
    for (ViewTouches& view : tick.views) view.what = 0;
  }
}

// ------------------------------------------------------------------------------------------------------- where it goes

// The plane of one member that stops the proxy on its way; at: where, scene frame; part: of the way.
bool Proxies::find_plane(const Member& member, Vec3 to, Plane& out, Vec3& at, double& part) const noexcept {
  const Solid& solid = *member.solid;
  const Vec3 local = to_local(solid.pose, to);
  Crossing crossing;
  if (!first_crossing(solid.object->primitive, solid.object->shape.get(), member.touch->side, member.touch->at, local,
                      crossing)) {
    return false;
  }
  part = crossing.part;
  out.margin = margin_at(solid.pose, member.touch->at, local);
  out.normal = rotate(solid.pose.orientation, crossing.normal);
  at = solid.pose * crossing.point + out.margin * out.normal;
  out.offset = dot(out.normal, at);
  return true;
}

// The first of them.
bool Proxies::find_hit(const Group& group, Vec3 to, Plane& out, Vec3& at) const noexcept {
  double least = std::numeric_limits<double>::infinity();
  for (uint32_t i = 0; i < group.count; ++i) {
    Plane plane;
    Vec3 here;
    double part;
    if (!find_plane(group.members[i], to, plane, here, part) || !(part < least)) continue;
    least = part;
    out = plane;
    out.member = i;
    at = here;
  }
  return least < std::numeric_limits<double>::infinity();
}

// Moves the proxy along a way that has been found free.
void Proxies::go(Group& group, Vec3 to) const noexcept {
  group.proxy = to;
  for (uint32_t i = 0; i < group.count; ++i) {
    Member& member = group.members[i];
    member.touch->at = to_local(member.solid->pose, to);
  }
}

// The point nearest to `hand` that all planes of the group allow. shares: how far each of them pushes it. Planes that do not
// push are dropped. False: there is no such point.
bool Proxies::hold(Planes& group, Vec3 hand, Vec3& goal) noexcept {
  const uint32_t count = group.plane_count;
  double most = std::numeric_limits<double>::infinity();
  uint32_t best = 0;
  std::array<double, 3> best_shares{};
  double depth[3], gram[3][3], margin = 0;
  for (uint32_t i = 0; i < count; ++i) {
    depth[i] = group.planes[i].offset - dot(group.planes[i].normal, hand);
    margin = std::max(margin, group.planes[i].margin / 8);
    for (uint32_t k = 0; k < count; ++k) gram[i][k] = dot(group.planes[i].normal, group.planes[k].normal);
  }
  // Each set of planes: the point that lies on all of them.
  for (uint32_t set = 1; set < 1u << count; ++set) {
    uint32_t index[3] = {}, size = 0;
    for (uint32_t i = 0; i < count; ++i) {
      if (set >> i & 1) index[size++] = i;
    }
    double share[3] = {};
    if (size == 1) {
      share[0] = depth[index[0]];
    } else {
      // Cramer's rule; the matrix is symmetric with ones on its diagonal.
      const double ab = gram[index[0]][index[1]];
      const double a = depth[index[0]], b = depth[index[1]];
      if (size == 2) {
        const double det = 1 - ab * ab;
        if (!(det > 1e-9)) continue;
        share[0] = (a - ab * b) / det;
        share[1] = (b - ab * a) / det;
      } else {
        const double ac = gram[index[0]][index[2]], bc = gram[index[1]][index[2]], c = depth[index[2]];
        const double det = 1 + 2 * ab * bc * ac - ab * ab - bc * bc - ac * ac;
        if (!(det > 1e-9)) continue;
        share[0] = (a * (1 - bc * bc) + b * (ac * bc - ab) + c * (ab * bc - ac)) / det;
        share[1] = (a * (bc * ac - ab) + b * (1 - ac * ac) + c * (ab * ac - bc)) / det;
        share[2] = (a * (ab * bc - ac) + b * (ab * ac - bc) + c * (1 - ab * ab)) / det;
      }
    }
    bool is_good = true;
    Vec3 push{};
    for (uint32_t i = 0; i < size; ++i) {
      is_good &= share[i] >= 0;
      push += share[i] * group.planes[index[i]].normal;
    }
    for (uint32_t i = 0; i < count; ++i) is_good &= dot(group.planes[i].normal, push) >= depth[i] - margin;
    if (!is_good || !(norm(push) < most)) continue;
    most = norm(push);
    best = set;
    best_shares = {};
    for (uint32_t i = 0; i < size; ++i) best_shares[index[i]] = share[i];
    goal = hand + push;
  }
  if (best == 0) return false;
  uint32_t kept = 0;
  for (uint32_t i = 0; i < count; ++i) {
    if (!(best >> i & 1)) continue;
    group.planes[kept] = group.planes[i];
    group.shares[kept++] = best_shares[i];
  }
  group.plane_count = kept;
  return true;
}

// Moves the proxy as near to the hand as it gets.
void Proxies::slide(Group& group, Vec3 hand, bool was_touching) noexcept {
  constexpr int most_ways = 24, most_planes = 12;
  Vec3 target = hand;
  group.held = {};
  group.is_stuck = false;
  for (int way = 0; way < most_ways; ++way) {
    group.plane_count = 0;
    Vec3 goal = target;
    bool is_free = false;
    for (int i = 0; i < most_planes; ++i) {
      Plane plane;
      Vec3 at;
      if (!find_hit(group, goal, plane, at)) {
        is_free = true;
        break;
      }
      if (way == 0 && i == 0 && !was_touching && group.members[plane.member].solid->object->contact.friction > 0) {
        // It comes to the surface here; from here on friction holds it.
        Plane other_plane;
        Vec3 other_at;
        if (!find_hit(group, at, other_plane, other_at)) go(group, at);
      }
      const bool has_room = group.plane_count < group.planes.size();
      if (has_room) group.planes[group.plane_count++] = plane;
      if (!has_room || !hold(group, target, goal)) {  // wedged in: it stays where it is
        group.shares.fill(0);
        break;
      }
      const double rounding = std::max(plane.margin, 1e-9 * norm(goal - target));
      if (norm(goal - group.proxy) <= rounding) break;  // it is there already
    }
    if (way == 0 && group.plane_count > 0) {
      // Friction: the proxy stays within a cone about the place where the surface alone would have it (Harwin & Melder 2002).
      double friction = 0, depth = 0;
      for (uint32_t i = 0; i < group.plane_count; ++i) {
        friction += group.shares[i] * group.members[group.planes[i].member].solid->object->contact.friction;
        depth += group.shares[i];
      }
      if (friction > 0 && depth > 0) {
        const Vec3 back = group.proxy - goal;
        const double most = friction / depth * norm(goal - hand), length = norm(back);
        if (length <= most) {
          group.held = back;
          group.is_stuck = true;
          return;
        }
        group.held = (most / length) * back;
        target = hand + group.held;
        continue;
      }
    }
    if (!is_free) return;
    const double moved = norm(goal - group.proxy);
    go(group, goal);
    if (group.plane_count == 0 && !(target == hand)) {  // where friction would have it, nothing holds it
      target = hand;
      group.held = {};
      continue;
    }
    if (group.plane_count == 0 || moved <= 1e-9 * norm(goal - target)) return;
  }
}

// Objects that have moved take the proxy with them: one that touches it with friction always, any other when it would pass
// over it.
void Proxies::carry(Group& group) noexcept {
  for (int round = 0; round < 2; ++round) {
    bool is_carried = false;
    for (uint32_t i = 0; i < group.count; ++i) {
      const Member& member = group.members[i];
      const Solid& solid = *member.solid;
      Touch& touch = *member.touch;
      const Vec3 local = to_local(solid.pose, group.proxy);
      if (local == touch.at) continue;
      const bool has_moved = member.before && !are_equal(member.before->pose, solid.pose);
      const bool sticks = round == 0 && has_moved && member.before->is_touching && solid.object->contact.friction > 0;
      Crossing crossing;
      if (sticks || first_crossing(solid.object->primitive, solid.object->shape.get(), touch.side, touch.at, local, crossing)) {
        group.proxy = solid.pose * touch.at;
        is_carried = true;
      } else {
        touch.at = local;
      }
    }
    if (!is_carried) return;
  }
}

// ------------------------------------------------------------------------------------------------------------ touches

// A solid that has come near. It keeps the proxy on the side where it is; one that is on the wrong side of a closed surface
// begins at the nearest place on the right side.
void Proxies::begin_touch(const ViewTouches* last, Group& group, Member& member) noexcept {
  const Solid& solid = *member.solid;
  const Object& object = *solid.object;
  Touch& touch = *member.touch;
  const Pose before = solid.motion->at(last ? now_ - step_ : now_);
  touch.at = to_local(before, group.proxy);
  touch.side = object.contact.keep == FS_KEEP_BACK ? Side::back : Side::front;
  touch.spring = touch.rest = {};
  touch.fading = 0;
  touch.is_touching = touch.is_fading = false;
  const bool keeps_either = object.contact.keep == FS_KEEP_EITHER;
  const bool is_closed = object.primitive != FS_PRIMITIVE_MESH || object.shape->closed;
  Closest closest;
  Effort effort{.visits = 4096};
  const auto find = [&](Vec3 x, double range) {
    return closest_point(object.primitive, object.shape.get(), x, range, closest, nullptr, &effort);
  };
  const double margin = margin_at(solid.pose, touch.at, to_local(before, group.proxy));
  if (!find(touch.at, keeps_either || is_closed ? never : margin)) return;
  if (keeps_either) touch.side = closest.side;
  const bool is_at_surface = closest.distance <= margin;
  if (!is_at_surface && (keeps_either || !is_closed || closest.side == touch.side)) return;
  // Above the surface, along its normal there: in a narrow groove farther above it than elsewhere.
  const Vec3 place = closest.point, away = closest.side == Side::back ? -closest.direction : closest.direction;
  const Vec3 normal = find(place, 2 * margin) && closest.distance == 0 ? closest.direction : away;
  const double sign = touch.side == Side::back ? -1 : 1;
  for (const double factor : {1.0, 16.0, 256.0}) {
    touch.at = place + (sign * factor * margin) * normal;
    if (find(touch.at, 2 * factor * margin) && closest.side == touch.side && closest.distance > margin / 64) break;
  }
  group.proxy = solid.pose * touch.at;
}

const Proxies::Touch* Proxies::find_before(const ViewTouches& last, const Solid& solid, uint32_t point) noexcept {
  // They mostly come in the same order as last time.
  const uint32_t count = last.end - last.begin;
  for (uint32_t k = 0; k < count; ++k) {
    if (++cursor_ >= last.end || cursor_ < last.begin) cursor_ = last.begin;
    const Touch& touch = ticks_[1 - current_].touches[cursor_];
    if (touch.version == solid.version && touch.row == solid.row && touch.point == point) return &touch;
  }
  return nullptr;
}

void Proxies::feel_group(const ViewTouches* last, Group& group, uint32_t point, const ToolState& tool) noexcept {
  const Vec3 hand = tool.points[point].position;
  group.proxy = last ? last->hand[point] : hand;
  bool was_touching = false, is_known = false;
  for (uint32_t i = 0; i < group.count; ++i) {
    Member& member = group.members[i];
    member.before = nullptr;
    if (last) member.before = find_before(*last, *member.solid, point);
    if (!member.before) continue;
    *member.touch = *member.before;
    was_touching |= member.before->is_touching;
    if (!is_known) group.proxy = member.before->proxy;
    is_known = true;
  }
  for (uint32_t i = 0; i < group.count; ++i) {
    Member& member = group.members[i];
    member.touch->row = member.solid->row;
    member.touch->version = member.solid->version;
    member.touch->point = point;
    member.touch->pose = member.solid->pose;
    if (!member.before) begin_touch(last, group, member);
  }
  carry(group);
  slide(group, hand, was_touching);
  push(last, group, point, tool);
}

// The springs of a group in which solids fade. Each solid is there for a part of the unit interval, as long as its weight: the
// versions of one name one after the other, all others from 0 on. At each place of the interval only those that are there
// hold the proxy; the spring is the mean. So a solid that goes leaves to the others what they hold without it.
void Proxies::fade(Group& group, Vec3 hand, double k) noexcept {
  std::array<double, 2 * most_solids>& levels = levels_;
  uint32_t level_count = 0;
  bool is_held[most_solids];
  for (uint32_t i = 0; i < group.count; ++i) {
    const Solid& solid = *group.members[i].solid;
    Vec3 at;
    double part;
    own_[i].member = i;
    is_held[i] = find_plane(group.members[i], hand, own_[i], at, part);
    double begin = 0;
    for (uint32_t other = 0; other < group.count; ++other) {
      const Solid& newer = *group.members[other].solid;
      if (newer.version > solid.version && newer.object->name == solid.object->name) begin += newer.weight;
    }
    Touch& touch = *group.members[i].touch;
    touch.spring = {};
    touch.is_touching = false;
    levels[2 * i] = std::min(begin, 1.0);
    levels[2 * i + 1] = std::min(begin + solid.weight, 1.0);
    level_count += 2;
  }
  std::array<double, 2 * most_solids> sorted = levels;
  std::sort(sorted.begin(), sorted.begin() + level_count);
  for (uint32_t n = 1; n < level_count; ++n) {
    const double length = sorted[n] - sorted[n - 1], middle = 0.5 * (sorted[n] + sorted[n - 1]);
    if (!(length > 0)) continue;
    // The plane that is violated most is added until none is.
    Planes here;
    Vec3 goal = hand;
    for (int tries = 0; tries < 8 && here.plane_count < 3; ++tries) {
      const Plane* worst = nullptr;
      double depth = 0;
      for (uint32_t i = 0; i < group.count; ++i) {
        if (!is_held[i] || !(levels[2 * i] < middle && middle < levels[2 * i + 1])) continue;
        const double by = own_[i].offset - dot(own_[i].normal, goal) - own_[i].margin / 4;
        if (by > depth) {
          depth = by;
          worst = &own_[i];
        }
      }
      if (!worst) break;
      here.planes[here.plane_count++] = *worst;
      if (!hold(here, hand, goal)) break;
    }
    double sum = 0;
    for (uint32_t p = 0; p < here.plane_count; ++p) sum += here.shares[p];
    for (uint32_t p = 0; p < here.plane_count && sum > 0; ++p) {
      Touch& touch = *group.members[here.planes[p].member].touch;
      const double weight = group.members[here.planes[p].member].solid->weight;
      touch.is_touching = true;
      touch.spring += (k * length / weight) * (here.shares[p] * here.planes[p].normal + (here.shares[p] / sum) * group.held);
    }
  }
}

// The forces of the group's contacts.
void Proxies::push(const ViewTouches* last, Group& group, uint32_t point, const ToolState& tool) noexcept {
  const ToolState::Point& at = tool.points[point];
  const double k = stiffness_of(group.members[0].solid->object->contact);
  const Vec3 pull = group.proxy - at.position;
  double sum = 0;
  for (uint32_t p = 0; p < group.plane_count; ++p) sum += group.shares[p];
  std::array<Vec3, most_solids>& damping = damping_;
  bool is_fading = false;
  for (uint32_t i = 0; i < group.count; ++i) is_fading |= group.members[i].solid->weight < 1;
  is_fading &= group.plane_count > 0 && group.count > 1;
  if (is_fading) fade(group, at.position, k);
  bool was_fading = false;
  Vec3 jump{};               // N, of the sum of the springs,
  uint32_t most_changed = 0;  // which goes to this member
  double way = last ? norm(at.position - last->hand[point]) : never, most_change = -1;
  for (uint32_t i = 0; i < group.count; ++i) {
    Member& member = group.members[i];
    Touch& touch = *member.touch;
    const Solid& solid = *member.solid;
    damping[i] = {};
    if (!is_fading) {
      touch.spring = {};
      touch.is_touching = false;
    }
    for (uint32_t p = 0; p < group.plane_count; ++p) {
      const Plane& plane = group.planes[p];
      if (plane.member != i) continue;
      touch.is_touching = true;
      if (!is_fading) touch.spring += k * (sum > 0 ? group.shares[p] * plane.normal + (group.shares[p] / sum) * group.held
                                   : (1.0 / group.plane_count) * pull);
      const Vec3 velocity = at.velocity - solid.motion->velocity(group.proxy, solid.pose, tool.time);
      const double approach = -dot(plane.normal, velocity);
      if (approach > 0) damping[i] += solid.object->contact.damping * approach * plane.normal;
    }
    touch.proxy = group.proxy;
    touch.is_fading = is_fading;
    touch.fading = std::max(0.0, touch.fading - step_);
    if (!member.before) continue;
    touch.rest = member.before->fading > 0 ? (touch.fading / member.before->fading) * member.before->rest : Vec3{};
    was_fading |= member.before->is_fading;
    const double limit = solid.object->contact.limit;  // what is beyond it has not been felt
    const Vec3 change = limited(member.before->spring, limit) - limited(touch.spring, limit);
    jump += change;
    if (norm(change) > most_change) {
      most_change = norm(change);
      most_changed = i;
    }
    way = std::max(way, norm(at.position - last->hand[point]) + norm(solid.pose * member.before->at - member.before->proxy));
  }
  // A jump that the motions of hand and objects do not explain is spread. (While solids fade, weights do that.)
  const double size = norm(jump), allowed = 2 * k * way;
  if (most_change > 0 && size > allowed && !is_fading && !was_fading) {
    Touch& touch = *group.members[most_changed].touch;
    touch.rest += (1 - allowed / size) * jump;
    touch.fading = spread;
  }
  for (uint32_t i = 0; i < group.count; ++i) {
    const Touch& touch = *group.members[i].touch;
    Solid& solid = *group.members[i].solid;
    const Vec3 force = touch.spring + damping[i] + touch.rest;
    if (touch.is_touching) solid.is_touched = true;
    if (const double distance = norm(pull); distance < solid.distance) {
      solid.distance = distance;
      solid.proxy = group.proxy;
    }
    solid.wrench.force += force;
    solid.wrench.torque += cross(at.arm, force);
  }
  // How the force changes with the hand: along the normals it is held.
  if (group.plane_count == 0) return;
  Mat3 held{};
  if (group.is_stuck) {
    held = identity();
  } else {
    Vec3 basis[3];
    uint32_t size = 0;
    for (uint32_t p = 0; p < group.plane_count; ++p) {
      Vec3 rest = group.planes[p].normal;
      for (uint32_t i = 0; i < size; ++i) rest += -dot(basis[i], rest) * basis[i];
      if (!(norm(rest) > 1e-6)) continue;
      basis[size++] = normalized(rest);
      held += outer(basis[size - 1], basis[size - 1]);
    }
  }
  group.members[group.planes[0].member].solid->stiffness += -k * held;
}

// ---------------------------------------------------------------------------------------------------------- the whole

namespace {

// The rigid pose that best fits the proxies of the points (least squares; a few steps of Gauss and Newton about the pose of the
// tool, because proxies are near it).
Pose fitted(const ToolState& tool, const Vec3* proxies) noexcept {
  Pose pose = tool.pose;
  const double share = 1.0 / tool.count;
  Vec3 middle{}, target{};
  for (uint32_t k = 0; k < tool.count; ++k) {
    middle += share * tool.points[k].arm;
    target += share * proxies[k];
  }
  Quat turn = identity_quat();
  for (int step = 0; tool.count > 1 && step < 4; ++step) {
    Mat3 inertia{};
    Vec3 torque{};
    double size = 0;
    for (uint32_t k = 0; k < tool.count; ++k) {
      const Vec3 arm = rotate(turn, tool.points[k].arm - middle), error = proxies[k] - target - arm;
      inertia += dot(arm, arm) * identity() + -1.0 * outer(arm, arm);
      torque += cross(arm, error);
      size += dot(arm, arm);
    }
    if (!(size > 0)) break;
    inertia += 1e-9 * size * identity();  // points on a line say nothing of a turn about it
    const Mat3& m = inertia;
    const Vec3 x{m.xx, m.yx, m.zx}, y{m.xy, m.yy, m.zy}, z{m.xz, m.yz, m.zz};
    const double det = dot(x, cross(y, z));
    if (!(std::fabs(det) > 0)) break;
    const Vec3 by{dot(torque, cross(y, z)) / det, dot(x, cross(torque, z)) / det, dot(x, cross(y, torque)) / det};
    turn = normalized(exp_rotation(by) * turn);
  }
  pose.orientation = tool.count > 1 ? normalized(turn * pose.orientation) : pose.orientation;
  pose.position = target - rotate(turn, middle);
  return pose;
}

}  // namespace

void Proxies::feel(uint32_t view, uint64_t what, const ToolState& tool, fs_response& out) noexcept {
  Tick& tick = ticks_[current_];
  ViewTouches& here = tick.views[view];
  const ViewTouches& before = ticks_[1 - current_].views[view];
  const ViewTouches* const last = before.what == what ? &before : nullptr;
  here.what = what;
  here.begin = tick.count;
  here.reach = 0;
  std::array<Vec3, FS_TOOL_POINTS_MAX> proxies;
  for (uint32_t i = 0; i < solid_count_; ++i) {
    Solid& solid = solids_[i];
    solid.pose = solid.motion->at(tool.time);
    solid.wrench = solid.felt = {};
    solid.stiffness = {};
    solid.is_touched = false;
    solid.distance = never;
  }
  for (uint32_t k = 0; k < tool.count; ++k) {
    const Vec3 hand = tool.points[k].position;
    here.hand[k] = hand;
    Vec3 pull{};
    double stiffness = 0;
    uint64_t done[most_solids / 64] = {};
    for (uint32_t first = 0; first < solid_count_; ++first) {
      if (done[first / 64] >> first % 64 & 1) continue;
      const double wanted = stiffness_of(solids_[first].object->contact);
      Group& group = group_;
      group.count = 0;
      group.plane_count = 0;
      for (uint32_t i = first; i < solid_count_; ++i) {
        Solid& solid = solids_[i];
        if (stiffness_of(solid.object->contact) != wanted) continue;
        done[i / 64] |= uint64_t{1} << i % 64;
        if (!tool.is_any_point && !(solid.object->point_mask() >> k & 1)) continue;
        if (tick.count == most_touches) break;
        group.members[group.count++] = {&solid, &tick.touches[tick.count++], nullptr};
      }
      if (group.count == 0) continue;
      feel_group(last, group, k, tool);
      add_profiles(group, k, tool);
      here.reach = std::max(here.reach, norm(group.proxy - hand));
      if (group.plane_count > 0) {
        pull += wanted * (group.proxy - hand);
        stiffness += wanted;
      }
    }
    proxies[k] = stiffness > 0 ? hand + (1 / stiffness) * pull : hand;
    if (last) here.reach = std::max(here.reach, 2 * norm(hand - last->hand[k]));
  }
  here.end = tick.count;
  if (what >= felt_.what) {
    felt_.what = what;
    felt_.count = 0;
  }
  for (uint32_t i = 0; i < solid_count_; ++i) {
    Solid& solid = solids_[i];
    const double force = norm(solid.wrench.force), limit = solid.object->contact.limit;
    const double share = force > limit ? limit / force : 1;
    const Wrench wrench{share * solid.wrench.force + solid.felt.force, share * solid.wrench.torque + solid.felt.torque};
    out.wrench.force += solid.weight * wrench.force;
    out.wrench.torque += solid.weight * wrench.torque;
    out.stiffness += solid.weight * solid.stiffness;
    if (solid.is_touched) out.flags |= FS_RESPONSE_CONTACT;
    if (!(wrench.force == Vec3{})) {
      ++out.felt_count;
      if (solid.weight < 1) out.flags |= FS_RESPONSE_FADING;
      if (what >= felt_.what && felt_.count < FeltSolids::size) {
        felt_.felt[felt_.count++] = {solid.version, wrench, solid.proxy, solid.distance};
      }
    }
  }
  out.proxy = fitted(tool, proxies.data());
  if (what >= felt_.what) newest_.write(felt_);
  solid_count_ = 0;
}

// The profiles of the group's objects act where the proxy is; on the surface along its normal.
void Proxies::add_profiles(const Group& group, uint32_t point, const ToolState& tool) noexcept {
  for (uint32_t i = 0; i < group.count; ++i) {
    Solid& solid = *group.members[i].solid;
    const Object& object = *solid.object;
    const double support = object.law.support;
    if (!(support >= 0)) continue;
    const uint32_t all = tool.count == 32 ? ~0u : (1u << tool.count) - 1;
    const double share = 1.0 / std::popcount(tool.is_any_point ? all : object.point_mask() & all);
    Closest closest;
    const Plane* plane = nullptr;
    for (uint32_t p = 0; p < group.plane_count && !plane; ++p) {
      if (group.planes[p].member == i) plane = &group.planes[p];
    }
    if (plane) {
      closest.side = group.members[i].touch->side;
      closest.distance = closest.side == Side::back ? std::numeric_limits<double>::min() : 0;  // the sign tells the side
      closest.direction = rotate(conjugate(solid.pose.orientation), plane->normal);
      closest.feature = Feature::face;
    } else if (!closest_point(object.primitive, object.shape.get(), to_local(solid.pose, group.proxy), support, closest)) {
      continue;
    }
    Share got;
    add_profile_force(object, closest, *solid.motion, solid.pose, tool.time - solid.start, tool.points[point], tool,
                      solid.parsers, share, got);
    solid.felt.force += got.wrench.force;
    solid.felt.torque += got.wrench.torque;
    solid.stiffness += got.stiffness;
  }
}

}  // namespace fs
