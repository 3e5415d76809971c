#include "field/point_proxies.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

namespace fs {
namespace {

// Projects on the directions in which planes hold a proxy.
Mat3 held_by(const Planes& planes) noexcept {
  Mat3 out{};
  Vec3 basis[3];
  const uint32_t size = planes.span(basis);
  for (uint32_t i = 0; i < size; ++i) out += outer(basis[i], basis[i]);
  return out;
}

// Springs that act as one have to be the same.
bool can_share(const Object& a, const Object& b) noexcept {
  return stiffness_of(a.contact) == stiffness_of(b.contact) && a.contact.limit == b.contact.limit && !a.texture() && !b.texture();
}

bool has_free_way(const Touch& touch, const Object& object, Vec3 place, double radius,
                  uint32_t* visits) noexcept {  // in the last tick
  Crossing crossing;
  return !first_crossing(object.primitive, object.shape.get(), touch.side, touch.at, to_local(touch.pose, place), radius,
                         crossing, visits);
}

}  // namespace

double part_beside(double limit, Vec3 spring, Vec3 damping) noexcept {
  const double square = dot(damping, damping), both = dot(spring, damping);
  if (!(square > 0) || norm(spring + damping) <= limit) return 1;
  const double room = std::max(0.0, limit * limit - dot(spring, spring));
  return std::clamp((std::sqrt(both * both + square * room) - both) / square, 0.0, 1.0);
}

Mat3 across(Vec3 way) noexcept {
  const Vec3 direction = normalized(way);
  return identity() + -1.0 * outer(direction, direction);
}

// The touch with a version in the layer before, or else in any other; null: there was none. Another layer has it where a solid
// is told apart no more, or where two parts of the unit interval overlap that did not.
const Touch* PointProxies::last_touch(const Point& point, uint64_t version) const noexcept {
  const Touch* out = point.tick.touches.find(*point.before, version, point.number);
  const Touches::View& last = *point.tick.last;
  for (uint32_t n = 0; !out && n < last.layer_count && last.layer_count > 1; ++n) {
    out = point.tick.touches.find(last.layers[n], version, point.number);
  }
  return out;
}

// The touch of an older version of the same object, where the point was held by it; null: there is none.
const Touch* PointProxies::replaced(const Point& point, const Solid& solid) const noexcept {
  if (!point.before || !solid.replaces) return nullptr;
  for (const Solid& other : point.tick.solids) {
    if (!(other.version < solid.version && other.object->name == solid.object->name)) continue;
    const Touch* const touch = point.tick.touches.find(*point.before, other.version, point.number);
    if (touch && touch->is_touching) return touch;
  }
  return nullptr;
}

// A solid that has come near. It keeps the proxy on the side where it is; one that is on the wrong side of a closed surface
// begins at the nearest place on the right side. False: another member is in the way to that place.
bool PointProxies::begin_touch(const Point& point, Member& member) noexcept {
  const Solid& solid = *member.solid;
  const Object& object = *solid.object;
  Touch& touch = *member.touch;
  const Tick& tick = point.tick;
  const double time = tick.last ? tick.now - tick.step : tick.now;
  touch.at = to_local(solid.motion->at(time, tick.tool.blend), proxy_.at);
  touch.slipped = 0;
  touch.side = object.contact.keep == FS_KEEP_BACK ? Side::back : Side::front;
  const bool keeps_either = object.contact.keep == FS_KEEP_EITHER;
  // Which side of an open mesh is inside is not known; but where it replaces one that is touched, it takes over the hand.
  const bool is_closed = object.primitive != FS_PRIMITIVE_MESH || object.shape->closed || replaced(point, solid);
  Closest closest;
  Effort effort{.visits = std::min(4096u, proxy_.visits ? *proxy_.visits : UINT32_MAX)};
  const auto find = [&](Vec3 x, double range) {
    const uint32_t before = effort.visits;
    const bool is_found = closest_point(object.primitive, object.shape.get(), x, range, closest, nullptr, &effort);
    if (proxy_.visits) *proxy_.visits -= std::min(*proxy_.visits, before - effort.visits);
    return is_found;
  };
  const double margin = margin_at(solid.pose, touch.at, touch.at);
  if (tick.tool.point_radius > 0 && object.primitive == FS_PRIMITIVE_PLANE) {
    if (keeps_either) touch.side = touch.at.z < 0 ? Side::back : Side::front;
    const double sign = touch.side == Side::front ? 1 : -1;
    if (sign * touch.at.z > tick.tool.point_radius + margin) return true;
    touch.at.z = sign * (tick.tool.point_radius + margin);
    const Vec3 begins_at = solid.pose * touch.at;
    if (!proxy_.is_free_to(begins_at)) return false;
    proxy_.at = begins_at;
    return true;
  }
  if (!find(touch.at, keeps_either || is_closed ? never : margin)) return true;
  if (keeps_either) touch.side = closest.side;
  const bool is_at_surface = closest.distance <= margin;
  if (!is_at_surface && (keeps_either || !is_closed || closest.side == touch.side)) return true;
  // It begins above the surface, along the normal there or on the way from the hand: in a narrow groove farther above it than
  // elsewhere. Where parts of a mesh cross, that may lead into another part. Then the outward normal of that part is added to the
  // way: in a wedge between two parts, however narrow, the sum of both normals leads out. In a corner of three parts or more the sum
  // may not; there places a little beyond the surface of the other part are tried, each half as far beyond as the one before.
  const auto outwards = [&] { return closest.side == touch.side ? closest.direction : -closest.direction; };
  const Vec3 place = closest.point, away = outwards();
  const Vec3 normal = find(place, 2 * margin) && closest.distance == 0 ? outwards() : away;
  bool has_place = false;
  // Where triangles have been cut, the pieces lie where they should within 1e-12 of the mesh's size: nearer to them it is not
  // known what is outside.
  const bool is_cut = object.primitive == FS_PRIMITIVE_MESH && object.shape->is_united();
  const double size = is_cut ? 2 * object.radius : 0;
  const double least = std::max(margin / 4, 2e-12 * size), most = std::max(2e6 * margin, 1e-6 * size);
  const auto is_above = [&](Vec3 direction, double height) {
    touch.at = place + height * direction;
    return find(touch.at, 2 * height) && closest.side == touch.side && closest.distance > least;
  };
  constexpr int most_parts = 8;  // that cross at one place
  for (double height = std::max(margin, least); height < most && !has_place; height *= 16) {
    for (const Vec3 begin : {normal, away}) {
      Vec3 way = begin;
      for (int parts = 1; parts <= most_parts && !has_place; ++parts) {
        has_place = is_above(normalized(way), height);
        if (closest.side == touch.side) break;
        way += outwards();
      }
    }
    if (!has_place) is_above(normal, height);
    for (double beyond = height / 4; beyond > height / 1e5 && !has_place && closest.side != touch.side; beyond /= 2) {
      has_place = is_above(normalized(closest.point + beyond * outwards() - place), height);
    }
  }
  const Vec3 begins_at = solid.pose * touch.at;
  if (!proxy_.is_free_to(begins_at)) return false;
  proxy_.at = begins_at;
  return true;
}

// Finds the members of the next proxy. False: all have theirs. The order of the proxies, and so of what is settled first:
// 0 solids that touched the point in the last tick, 1 solids that were near it then, 2 new ones, 3 those that have just left
// another proxy because they contradicted it.
bool PointProxies::gather(const Point& point) noexcept {
  const std::span<Solid> solids = point.tick.solids;
  const auto count = static_cast<uint32_t>(solids.size());
  uint32_t first = count, least = 4;
  for (uint32_t i = 0; i < count && least > 0; ++i) {
    const Before& before = before_[i];
    if (before.is_done) continue;
    const uint32_t rank = before.left ? 3 : !before.touch ? 2 : !before.touch->is_touching;
    if (rank >= least) continue;
    least = rank;
    first = i;
  }
  if (first == count) return false;
  proxy_.count = proxy_.plane_count = 0;
  const auto take = [&](uint32_t i, Touch* touch) {
    before_[i].is_done = true;
    if (touch) proxy_.members[proxy_.count++] = {&solids[i], touch, before_[i].touch};
  };
  if (before_[first].left) {
    take(first, before_[first].left);
    return true;
  }
  const Touch* const known = before_[first].touch;
  const auto take_if_it_shares = [&](uint32_t i) {
    const Touch* const before = before_[i].touch;
    const Object& object = *solids[i].object;
    if (before_[i].is_done || before_[i].left || (i != first && !can_share(object, *solids[first].object))) return;
    const bool is_apart = i != first && before && !(before->proxy == known->proxy);
    if (is_apart && (before->is_touching || !has_free_way(*before, object, known->proxy, proxy_.point_radius, proxy_.visits)))
      return;
    Touch* const touch = point.tick.touches.add_touch(point.layer);
    if (touch && before) *touch = *before;
    if (touch && is_apart) touch->at = to_local(before->pose, known->proxy);
    take(i, touch);
  };
  take_if_it_shares(first);
  for (const bool is_new : {false, true}) {  // those that are known come first
    for (uint32_t i = 0; i < count; ++i) {
      if (!before_[i].touch == is_new) take_if_it_shares(i);
    }
  }
  return true;
}

void PointProxies::feel_proxy(const Point& point, Gain& out) noexcept {
  const Vec3 hand = point.at().position;
  const Solid* const solids = point.tick.solids.data();
  const Touches::View* const last = point.tick.last;
  const auto leave = [&](Member& member) {
    Before& before = before_[member.solid - solids];
    before.left = member.touch;
    before.is_done = false;
  };
  const uint32_t all = proxy_.count;
  bool was_touching = false, is_left = before_[proxy_.members[0].solid - solids].left;
  proxy_.at = last ? last->hand[point.number] : hand;
  proxy_.count = 0;
  for (; proxy_.count < all && proxy_.members[proxy_.count].before; ++proxy_.count) {  // those that are known come first
    const Member& member = proxy_.members[proxy_.count];
    was_touching |= member.before->is_touching;
    if (proxy_.count == 0) proxy_.at = is_left ? member.solid->pose * member.touch->at : member.before->proxy;
  }
  if (proxy_.count == 0) {
    if (const Touch* const touch = replaced(point, *proxy_.members[0].solid)) proxy_.at = touch->proxy;
  }
  for (uint32_t i = proxy_.count; i < all; ++i) {
    Member member = proxy_.members[i];
    if (proxy_.visits && *proxy_.visits == 0) {  // it has to wait for a tick with less to do
      *member.touch = {};
    } else if (begin_touch(point, member)) {
      proxy_.members[proxy_.count++] = member;
    } else {
      leave(member);
    }
  }
  if (proxy_.count == 0) return;
  const uint32_t left = proxy_.carry();
  for (uint32_t i = 0; i < left; ++i) leave(proxy_.members[proxy_.count + i]);
  proxy_.slide(hand, was_touching);
  push(point, out);
}

// The spring of the members' contacts, in metres: its force divided by the stiffness.
PointProxies::Spring PointProxies::spring(Vec3 hand) const noexcept {
  const Vec3 pull = proxy_.at - hand;
  const Object& object = *proxy_.members[0].solid->object;
  Spring out{pull, pull, norm(pull), object.contact.limit, {}};
  const double steepest = object.texture_slope();
  if (!object.texture() || proxy_.plane_count == 0) return out;
  // The energy is that of sqrt(depth^2 + held^2), within a limit that holds the force on any slope, whatever friction adds.
  out.press = proxy_.press_at(hand, proxy_.at - proxy_.held);
  out.way = out.press.depth * out.press.turned() + proxy_.held;
  out.size = std::sqrt(out.press.depth * out.press.depth + dot(proxy_.held, proxy_.held));
  out.limit /= 0.5 * (steepest + std::sqrt(steepest * steepest + 4));
  return out;
}

// How its force changes with the hand, divided by the stiffness: along the normals it is held, at the limit only its direction
// changes.
Mat3 PointProxies::change(const Spring& spring, double part) const noexcept {
  Mat3 out = proxy_.is_stuck ? identity() : held_by(proxy_);
  if (const Press& press = spring.press; proxy_.members[0].solid->object->texture()) {
    const Vec3 turned = press.turned();
    out = outer(turned, turned) + press.depth * press.curvature;
    if (!(press.depth > 0)) out = {};
    if (proxy_.is_stuck) out += identity() + -1.0 * held_by(proxy_);
  }
  return part < 1 ? part * (across(spring.way) * out) : out;
}

// The forces of the members' contacts. All members have the same limit, and the spring's sum stays within it: so it is the
// gradient of an energy still, which it would not be if each member's part was limited by itself.
void PointProxies::push(const Point& point, Gain& out) noexcept {
  const ToolState& tool = point.tick.tool;
  const ToolState::Point& at = point.at();
  const Object& object = *proxy_.members[0].solid->object;
  const double k = stiffness_of(object.contact);
  const Spring spring = this->spring(at.position);
  double depth = 0, way = 0;
  for (uint32_t p = 0; p < proxy_.plane_count; ++p) depth += proxy_.pushes[p];
  const auto way_out = [&](uint32_t p) {  // m: what plane p gives of the spring
    if (object.texture()) return (1.0 / proxy_.plane_count) * spring.way;
    if (!(depth > 0)) return (1.0 / proxy_.plane_count) * spring.pull;
    return proxy_.pushes[p] * proxy_.planes[p].normal + (proxy_.pushes[p] / depth) * proxy_.held;
  };
  // On a mesh friction may hold the proxy back across an edge, and so along the normal, too; and very far from the origin the
  // proxy is not exactly where its planes push: the sum itself is within the limit.
  Vec3 all_ways{};
  for (uint32_t p = 0; p < proxy_.plane_count; ++p) all_ways += way_out(p);
  const double part = std::min(part_within(spring.limit, k * spring.size), part_within(object.contact.limit, k * norm(all_ways)));
  assert(part >= 0 && part <= 1);
  const bool is_pushed = !object.texture() || spring.press.depth > 0;  // in a groove it may be in front of the texture
  std::array<Vec3, 3> damping{};  // N, of each plane
  Vec3 all_damping{};
  for (uint32_t p = 0; p < proxy_.plane_count; ++p) {
    const Plane& plane = proxy_.planes[p];
    const Solid& solid = *proxy_.members[plane.member].solid;
    const Vec3 velocity = at.velocity - solid.motion->velocity(proxy_.at, solid.pose, tool.time, tool.blend);
    const double approach = -dot(plane.normal, velocity);
    if (approach > 0 && is_pushed) damping[p] = (solid.object->contact.damping * approach) * plane.normal;
    all_damping += damping[p];
  }
  const double damping_part = part_beside(object.contact.limit, (part * k) * spring.way, all_damping);
  bool is_held = proxy_.plane_count > 0;
  for (uint32_t i = 0; i < proxy_.count; ++i) {
    const Member& member = proxy_.members[i];
    Touch& touch = *member.touch;
    Solid& solid = *member.solid;
    bool is_touching = false;
    Vec3 normals{};
    for (uint32_t p = 0; p < proxy_.plane_count; ++p) {
      const Plane& plane = proxy_.planes[p];
      if (plane.member != i) continue;
      is_touching = true;
      normals += plane.normal;
      const Vec3 pushed = (part * k) * way_out(p), damped = damping_part * damping[p];
      solid.spring = solid.spring + Wrench{pushed, cross(at.arm, pushed)};
      solid.damping = solid.damping + Wrench{damped, cross(at.arm, damped)};
    }
    const Touch* const before = member.before;
    if (before && (is_touching || before->is_touching)) {
      is_held = true;
      way = std::max(way, norm(solid.pose * before->at - before->proxy));
    }
    touch.row = solid.row;
    touch.version = solid.version;
    touch.point = point.number;
    touch.pose = solid.pose;
    touch.proxy = proxy_.at;
    touch.is_touching = is_touching;
    touch.normal = !(is_touching && is_pushed) ? Vec3{} : solid.object->has_impact() ? normalized(normals) : normals;
    if (!is_touching) touch.slipped = 0;
    solid.is_touched |= is_touching;
    if (const double distance = norm(spring.pull); distance < solid.distance) {
      solid.distance = distance;
      solid.proxy = proxy_.at;
    }
  }
  const Touches::View* const last = point.tick.last;
  if (is_held && last) out.spring_change += 2 * object.contact_slope * (way + norm(at.position - last->hand[point.number]));
  if (proxy_.plane_count == 0) return;
  proxy_.members[proxy_.planes[0].member].solid->stiffness += -k * change(spring, part);
  out.pull += k * spring.pull;
  out.stiffness += k;
}

// N, by how much the force of a member's profiles can have changed by the ways of hand and object.
double PointProxies::explained_change(const Point& point, const Member& member) const noexcept {
  const Touches::View* const last = point.tick.last;
  const Object& object = *member.solid->object;
  const double slope = std::min(object.law_slope, object.bounds.slope);
  if (!last || !member.before || !(slope < no_slope_limit) || object.law.has_curves()) return no_slope_limit;
  const Vec3 hand = point.at().position - last->hand[point.number], speed = point.at().velocity - last->velocity[point.number];
  const Vec3 way = member.solid->pose * member.before->at - member.before->proxy;
  return 2 * (slope * (norm(hand) + norm(way)) + object.damping * norm(speed));
}

// The profiles of the members act where the proxy is; on the surface along its normal. Those of a plane act where the proxy would be
// if only the plane held it: at the hand where that is free of the plane, else where it touches the plane. So they depend on the
// hand's place alone, and give no energy on a closed path, also where another solid holds the proxy.
void PointProxies::add_profiles(const Point& point, Gain& out) noexcept {
  const Mat3 proxy_moves = proxy_.is_stuck ? Mat3{} : identity() + -1.0 * held_by(proxy_);  // by how much with the hand, m/m
  const ToolState& tool = point.tick.tool;
  Effort* const effort = point.tick.effort;
  for (uint32_t i = 0; i < proxy_.count; ++i) {
    Solid& solid = *proxy_.members[i].solid;
    const Object& object = *solid.object;
    const double support = object.law.support, slope = object.bounds.slope;
    if (!(support >= 0)) continue;
    const uint32_t all = tool.all_points();
    const double point_weight = 1.0 / std::popcount(tool.is_any_point ? all : object.point_mask() & all);
    const Side side = proxy_.members[i].touch->side;
    Vec3 place = to_local(solid.pose, proxy_.at), normals{};
    Mat3 moves = proxy_moves;  // of the place, m/m
    const Plane* plane = nullptr;
    for (uint32_t p = proxy_.plane_count; p-- > 0;) {
      if (proxy_.planes[p].member != i) continue;
      plane = &proxy_.planes[p];
      normals += rotate(conjugate(solid.pose.orientation), plane->normal);
    }
    bool is_on_surface = plane != nullptr;
    Vec3 away = plane ? rotate(conjugate(solid.pose.orientation), plane->normal) : Vec3{};
    if (object.primitive == FS_PRIMITIVE_PLANE) {
      place = to_local(solid.pose, point.at().position);
      away = {0, 0, side == Side::front ? 1.0 : -1.0};
      is_on_surface = !(dot(away, place) > tool.point_radius);
      const Vec3 normal = rotate(solid.pose.orientation, away);
      moves = identity();
      if (is_on_surface) moves += -1.0 * outer(normal, normal);
    }
    Hint* const hint = solid.hints ? solid.hints + point.number : nullptr;
    ObjectForce got;
    const auto find = [&](Vec3 x, double range, Closest& out) {
      const bool is_found = find_closest(object, x, range, slope, out, hint, effort);
      if (effort && effort->is_cut) got.error += point_weight * error_of(object, *effort, tool.point_radius);
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
    } else if (is_on_surface) {
      closest.side = side;
      closest.distance = side == Side::back ? std::max(tool.point_radius, std::numeric_limits<double>::min()) : tool.point_radius;
      closest.direction = away;
      closest.feature = Feature::face;
    } else {
      is_felt = find(place, support + tool.point_radius, closest);
    }
    if (is_felt) {
      add_profile_force(object, closest, *solid.motion, solid.pose, tool.time - solid.start, point.at(), tool, solid.parsers,
                        point_weight, got, place, is_on_surface && !is_above ? no_slope_limit : slope, hint, effort);
    }
    solid.felt = solid.felt + got.wrench;
    out.profile_change += point_weight * explained_change(point, proxy_.members[i]);
    solid.felt_stiffness += got.stiffness * moves;
    out.error += got.error;
  }
}

void PointProxies::feel(const Tick& tick, uint32_t number, const Layer* before_layer, Layer& layer, Gain& out) noexcept {
  const Point point{tick, number, before_layer, layer};
  proxy_.visits = tick.effort ? &tick.effort->ways : nullptr;
  proxy_.point_radius = tick.tool.point_radius;
  for (uint32_t i = 0; i < tick.solids.size(); ++i) {
    Solid& solid = tick.solids[i];
    Before& before = before_[i];
    before = {};
    before.is_done = !solid.is_present || !(tick.tool.is_any_point || (solid.object->point_mask() >> number & 1));
    if (before.is_done || !before_layer) continue;
    before.touch = last_touch(point, solid.version);
    // Another profile or contact of the same object goes on from where the one before has the proxy.
    // Where another side is kept, it meets the hand anew.
    if (!before.touch && solid.takes_over) before.touch = last_touch(point, solid.takes_over);
    if (before.touch && !keeps(solid.object->contact, before.touch->side)) before.touch = nullptr;
    solid.is_known |= before.touch != nullptr;
  }
  while (gather(point)) {
    if (proxy_.count == 0) continue;  // there are too many
    feel_proxy(point, out);
    if (proxy_.count == 0) continue;
    add_profiles(point, out);
    out.reach = std::max(out.reach, norm(proxy_.at - point.at().position));
  }
}

}  // namespace fs
