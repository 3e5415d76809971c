#include "field/proxies.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "field/fit.h"

namespace fs {
namespace {

constexpr double spread = 0.02;        // s, over which a jump of the proxy is spread

// Projects on the directions in which planes hold a proxy.
Mat3 held_by(const Planes& planes) noexcept {
  Mat3 out{};
  Vec3 basis[3];
  const uint32_t size = planes.span(basis);
  for (uint32_t i = 0; i < size; ++i) out += outer(basis[i], basis[i]);
  return out;
}

Vec3 limited(Vec3 force, double limit) noexcept {
  const double size = norm(force);
  return size > limit ? (limit / size) * force : force;
}

}  // namespace

void Proxies::begin(double now) noexcept {
  step_ = std::clamp(now - now_, 0.0, 0.1);
  now_ = now;
  touches_.begin();
}

// ------------------------------------------------------------------------------------------------------------ touches

// A solid that has come near. It keeps the proxy on the side where it is; one that is on the wrong side of a closed surface
// begins at the nearest place on the right side.
void Proxies::begin_touch(const Touches::View* last, Member& member) noexcept {
  const Solid& solid = *member.solid;
  const Object& object = *solid.object;
  Touch& touch = *member.touch;
  const Pose before = solid.motion->at(last ? now_ - step_ : now_, blend_);
  touch.at = to_local(before, proxy_.at);
  touch.side = object.contact.keep == FS_KEEP_BACK ? Side::back : Side::front;
  touch.spring = touch.rest = {};
  touch.fading = 0;
  touch.is_touching = touch.is_fading = false;
  const bool keeps_either = object.contact.keep == FS_KEEP_EITHER;
  // Which side of an open mesh is inside is not known; but where it replaces one that is touched, it takes over the hand.
  const bool is_closed = object.primitive != FS_PRIMITIVE_MESH || object.shape->closed || replaces_touched(solid);
  Closest closest;
  Effort effort{.visits = 4096};
  const auto find = [&](Vec3 x, double range) {
    return closest_point(object.primitive, object.shape.get(), x, range, closest, nullptr, &effort);
  };
  const double margin = margin_at(solid.pose, touch.at, touch.at);
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
  proxy_.at = solid.pose * touch.at;
}

// Whether the proxy touches an older version of the same object.
bool Proxies::replaces_touched(const Solid& solid) const noexcept {
  for (uint32_t i = 0; solid.weight < 1 && i < proxy_.count; ++i) {
    const Member& other = proxy_.members[i];
    if (other.before && other.before->is_touching && other.solid->version < solid.version &&
        other.solid->object->name == solid.object->name) {
      return true;
    }
  }
  return false;
}

void Proxies::feel_proxy(const Touches::View* last, uint32_t point, const ToolState& tool) noexcept {
  const Vec3 hand = tool.points[point].position;
  proxy_.at = last ? last->hand[point] : hand;
  bool was_touching = false, is_known = false;
  for (uint32_t i = 0; i < proxy_.count; ++i) {
    Member& member = proxy_.members[i];
    if (!member.before) continue;
    *member.touch = *member.before;
    if (member.is_taken_over) {  // what is left of a jump stays with that one
      member.touch->rest = {};
      member.touch->fading = 0;
    }
    was_touching |= member.before->is_touching;
    if (!is_known) proxy_.at = member.before->proxy;
    is_known = true;
  }
  for (uint32_t i = 0; i < proxy_.count; ++i) {
    Member& member = proxy_.members[i];
    member.touch->row = member.solid->row;
    member.touch->version = member.solid->version;
    member.touch->point = point;
    member.touch->pose = member.solid->pose;
    if (!member.before) begin_touch(last, member);
  }
  proxy_.carry();
  proxy_.slide(hand, was_touching);
  push(last, point, tool);
}

// Once a tick and view, because it compares names. Only solids that fade have other versions.
void Proxies::stack_versions() noexcept {
  for (uint32_t i = 0; i < solid_count_; ++i) {
    Solid& solid = solids_[i];
    solid.begin = 0;
    for (uint32_t other = 0; solid.weight < 1 && other < solid_count_; ++other) {
      const Solid& newer = solids_[other];
      if (newer.version > solid.version && newer.weight < 1 && newer.object->name == solid.object->name) {
        solid.begin += newer.weight;
      }
    }
  }
}

// The springs of a group in which solids fade. Each solid is there for a part of the unit interval, as long as its weight: the
// versions of one name one after the other, all others from 0 on. At each place of the interval only those that are there
// hold the proxy; the spring is the mean. So a solid that goes leaves to the others what they hold without it.
void Proxies::fade(Vec3 hand, double k) noexcept {
  std::array<double, 2 * most_solids>& levels = levels_;
  const uint32_t level_count = 2 * proxy_.count;
  bool is_held[most_solids];
  for (uint32_t i = 0; i < proxy_.count; ++i) {
    const Solid& solid = *proxy_.members[i].solid;
    Vec3 at;
    double part;
    own_[i].member = i;
    is_held[i] = find_plane(proxy_.members[i], hand, own_[i], at, part);
    Touch& touch = *proxy_.members[i].touch;
    touch.spring = {};
    touch.is_touching = false;
    levels[2 * i] = std::min(solid.begin, 1.0);
    levels[2 * i + 1] = std::min(solid.begin + solid.weight, 1.0);
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
      for (uint32_t i = 0; i < proxy_.count; ++i) {
        if (!is_held[i] || !(levels[2 * i] < middle && middle < levels[2 * i + 1])) continue;
        const double by = own_[i].offset - dot(own_[i].normal, goal) - own_[i].margin / 4;
        if (by > depth) {
          depth = by;
          worst = &own_[i];
        }
      }
      if (!worst) break;
      here.planes[here.plane_count++] = *worst;
      if (!here.hold(hand, goal)) break;
    }
    double sum = 0;
    for (uint32_t p = 0; p < here.plane_count; ++p) sum += here.shares[p];
    if (here.plane_count > 0) {
      Solid& first = *proxy_.members[here.planes[0].member].solid;
      first.stiffness += (-k * length / first.weight) * (proxy_.is_stuck ? identity() : held_by(here));
    }
    const Vec3 held = limited(proxy_.held, proxy_.friction_reach(here, hand, goal, false));
    for (uint32_t p = 0; p < here.plane_count && sum > 0; ++p) {
      Touch& touch = *proxy_.members[here.planes[p].member].touch;
      const double weight = proxy_.members[here.planes[p].member].solid->weight;
      touch.is_touching = true;
      touch.spring += (k * length / weight) * (here.shares[p] * here.planes[p].normal + (here.shares[p] / sum) * held);
    }
  }
}

// The forces of the group's contacts.
void Proxies::push(const Touches::View* last, uint32_t point, const ToolState& tool) noexcept {
  const ToolState::Point& at = tool.points[point];
  const double k = stiffness_of(proxy_.members[0].solid->object->contact);
  const Vec3 pull = proxy_.at - at.position;
  double sum = 0;
  for (uint32_t p = 0; p < proxy_.plane_count; ++p) sum += proxy_.shares[p];
  std::array<Vec3, most_solids>& damping = damping_;
  bool is_fading = false;
  for (uint32_t i = 0; i < proxy_.count; ++i) is_fading |= proxy_.members[i].solid->weight < 1;
  is_fading &= proxy_.plane_count > 0 && proxy_.count > 1;
  if (is_fading) fade(at.position, k);
  bool was_fading = false;
  Vec3 jump{};               // N, of the sum of the springs,
  uint32_t most_changed = 0;  // which goes to this member
  double way = last ? norm(at.position - last->hand[point]) : never, most_change = -1;
  for (uint32_t i = 0; i < proxy_.count; ++i) {
    Member& member = proxy_.members[i];
    Touch& touch = *member.touch;
    const Solid& solid = *member.solid;
    damping[i] = {};
    if (!is_fading) {
      touch.spring = {};
      touch.is_touching = false;
    }
    for (uint32_t p = 0; p < proxy_.plane_count; ++p) {
      const Plane& plane = proxy_.planes[p];
      if (plane.member != i) continue;
      touch.is_touching = true;
      if (!is_fading) touch.spring += k * (sum > 0 ? proxy_.shares[p] * plane.normal + (proxy_.shares[p] / sum) * proxy_.held
                                   : (1.0 / proxy_.plane_count) * pull);
      const Vec3 velocity = at.velocity - solid.motion->velocity(proxy_.at, solid.pose, tool.time, tool.blend);
      const double approach = -dot(plane.normal, velocity);
      if (approach > 0) damping[i] += solid.object->contact.damping * approach * plane.normal;
    }
    touch.proxy = proxy_.at;
    touch.is_fading = is_fading;
    touch.fading = std::max(0.0, touch.fading - step_);
    if (!member.before || member.is_taken_over) continue;
    touch.rest = member.before->fading > 0 ? (touch.fading / member.before->fading) * member.before->rest : Vec3{};
    was_fading |= member.before->is_fading;
    const double limit = solid.object->contact.limit;  // the hand has not felt what is beyond it
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
    Touch& touch = *proxy_.members[most_changed].touch;
    touch.rest += (1 - allowed / size) * jump;
    touch.fading = spread;
  }
  for (uint32_t i = 0; i < proxy_.count; ++i) {
    const Touch& touch = *proxy_.members[i].touch;
    Solid& solid = *proxy_.members[i].solid;
    const Vec3 force = touch.spring + damping[i] + touch.rest;
    if (touch.is_touching) solid.is_touched = true;
    if (const double distance = norm(pull); distance < solid.distance) {
      solid.distance = distance;
      solid.proxy = proxy_.at;
    }
    solid.wrench.force += force;
    solid.wrench.torque += cross(at.arm, force);
  }
  // How the force changes with the hand: along the normals it is held.
  if (proxy_.plane_count == 0 || is_fading) return;  // fade() has told it
  proxy_.members[proxy_.planes[0].member].solid->stiffness += -k * (proxy_.is_stuck ? identity() : held_by(proxy_));
}

// ---------------------------------------------------------------------------------------------------------- the whole

void Proxies::feel(uint32_t view, uint64_t what, const ToolState& tool, Effort* effort, fs_response& out) noexcept {
  Touches::View& here = touches_.begin_view(view, what);
  const Touches::View* const last = touches_.last(view, what);
  blend_ = tool.blend;
  std::array<Vec3, FS_TOOL_POINTS_MAX> proxies;
  bool is_spreading = false;
  for (uint32_t i = 0; i < solid_count_; ++i) {
    Solid& solid = solids_[i];
    solid.pose = solid.motion->at(tool.time, tool.blend);
    solid.wrench = solid.felt = {};
    solid.stiffness = solid.felt_stiffness = {};
    solid.is_touched = false;
    solid.distance = never;
  }
  stack_versions();
  for (uint32_t k = 0; k < tool.count; ++k) {
    const Vec3 hand = tool.points[k].position;
    here.hand[k] = hand;
    Vec3 pull{};
    double stiffness = 0;
    uint64_t done[most_solids / 64] = {};
    for (uint32_t i = 0; i < solid_count_; ++i) {
      // Another profile or contact of the same object goes on from where the one before has the proxy.
      const Solid& solid = solids_[i];
      Before& before = before_[i];
      before.touch = last ? touches_.find(*last, solid, solid.version, k) : nullptr;
      before.is_of_older = last && !before.touch && solid.takes_over;
      if (before.is_of_older) before.touch = touches_.find(*last, solid, solid.takes_over, k);
    }
    for (uint32_t first = 0; first < solid_count_; ++first) {
      if (done[first / 64] >> first % 64 & 1) continue;
      const double wanted = stiffness_of(solids_[first].object->contact);
      proxy_.count = 0;
      proxy_.plane_count = 0;
      const Touch* known = nullptr;
      for (uint32_t i = first; i < solid_count_; ++i) {
        Solid& solid = solids_[i];
        if (done[i / 64] >> i % 64 & 1 || stiffness_of(solid.object->contact) != wanted) continue;
        // Those that have got the same stiffness by a change keep their own proxies until these meet, in free space at the latest.
        const Touch* const before = before_[i].touch;
        if (before && known && !(before->proxy == known->proxy)) continue;
        if (before) known = before;
        done[i / 64] |= uint64_t{1} << i % 64;
        if (!tool.is_any_point && !(solid.object->point_mask() >> k & 1)) continue;
        Touch* const touch = touches_.add(here);
        if (!touch) break;
        proxy_.members[proxy_.count++] = {&solid, touch, before, before_[i].is_of_older};
      }
      if (proxy_.count == 0) continue;
      feel_proxy(last, k, tool);
      add_profiles(k, tool, effort, out.error_bound);
      here.reach = std::max(here.reach, norm(proxy_.at - hand));
      for (uint32_t i = 0; i < proxy_.count; ++i) is_spreading |= proxy_.members[i].touch->fading > 0;
      if (proxy_.plane_count > 0) {
        pull += wanted * (proxy_.at - hand);
        stiffness += wanted;
      }
    }
    proxies[k] = stiffness > 0 ? hand + (1 / stiffness) * pull : hand;
    if (last) here.reach = std::max(here.reach, 2 * norm(hand - last->hand[k]));
    if (last && is_spreading) here.reach = std::max(here.reach, last->reach + norm(hand - last->hand[k]));  // until it is over
  }
  if (what >= felt_.what) {
    felt_.what = what;
    felt_.count = 0;
  }
  for (uint32_t i = 0; i < solid_count_; ++i) {
    Solid& solid = solids_[i];
    const double force = norm(solid.wrench.force), limit = solid.object->contact.limit;
    const double share = force > limit ? limit / force : 1;
    if (share < 1) {  // only the direction still changes
      const Vec3 direction = (1 / force) * solid.wrench.force;
      solid.stiffness = share * ((identity() + -1.0 * outer(direction, direction)) * solid.stiffness);
    }
    solid.stiffness += solid.felt_stiffness;
    const Wrench wrench{share * solid.wrench.force + solid.felt.force, share * solid.wrench.torque + solid.felt.torque};
    out.wrench.force += solid.weight * wrench.force;
    out.wrench.torque += solid.weight * wrench.torque;
    out.stiffness += solid.weight * solid.stiffness;
    if (solid.is_touched) out.flags |= FS_RESPONSE_CONTACT;
    if (!(wrench.force == Vec3{})) {
      ++out.felt_count;
      if (solid.weight < 1) out.flags |= FS_RESPONSE_FADING;
      if (solid.is_bounded) out.flags |= FS_RESPONSE_CAPPED;
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
void Proxies::add_profiles(uint32_t point, const ToolState& tool, Effort* effort, double& error) noexcept {
  for (uint32_t i = 0; i < proxy_.count; ++i) {
    Solid& solid = *proxy_.members[i].solid;
    const Object& object = *solid.object;
    const double support = object.law.support, slope = object.bounds.slope;
    if (!(support >= 0)) continue;
    const uint32_t all = tool.count == 32 ? ~0u : (1u << tool.count) - 1;
    const double share = 1.0 / std::popcount(tool.is_any_point ? all : object.point_mask() & all);
    const Side side = proxy_.members[i].touch->side;
    Vec3 place = to_local(solid.pose, proxy_.at), normals{};
    const Plane* plane = nullptr;
    for (uint32_t p = proxy_.plane_count; p-- > 0;) {
      if (proxy_.planes[p].member != i) continue;
      plane = &proxy_.planes[p];
      normals += rotate(conjugate(solid.pose.orientation), plane->normal);
    }
    Hint* const hint = solid.hints ? solid.hints + point : nullptr;
    Share got;
    const auto find = [&](Vec3 x, double range, Closest& out) {
      const bool is_found = find_closest(object, x, range, slope, out, hint, effort);
      if (effort && effort->is_cut) got.error += share * error_of(object, *effort);
      return is_found;
    };
    // On the surface a force that is blended is that of a place just above it, so that it does not change when the proxy leaves.
    Closest closest, above;
    bool is_above = false;
    if (plane && slope < no_slope_limit && object.has_ridges()) {
      const double height = 1e-7 * object.radius + 16 * plane->margin;
      const Vec3 x = place + height * normals;
      is_above = find(x, 4 * height, above) && above.side == side && above.distance > 0;
      if (is_above) place = x;
    }
    bool is_felt = true;
    if (is_above) {
      closest = above;
    } else if (plane) {
      closest.side = side;
      closest.distance = side == Side::back ? std::numeric_limits<double>::min() : 0;  // the sign tells the side
      closest.direction = rotate(conjugate(solid.pose.orientation), plane->normal);
      closest.feature = Feature::face;
    } else {
      is_felt = find(place, support, closest);
    }
    if (is_felt) {
      add_profile_force(object, closest, *solid.motion, solid.pose, tool.time - solid.start, tool.points[point], tool,
                        solid.parsers, share, got, place, plane && !is_above ? no_slope_limit : slope, hint, effort);
    }
    solid.felt.force += got.wrench.force;
    solid.felt.torque += got.wrench.torque;
    solid.felt_stiffness += got.stiffness;
    error += solid.weight * got.error;
  }
}

}  // namespace fs
