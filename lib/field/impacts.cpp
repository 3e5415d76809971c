#include "field/impacts.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "field/point_proxies.h"

namespace fs {
namespace {

// At the device.
constexpr double least_speed = 0.02;  // m/s
constexpr double free_for = 0.05;     // s
constexpr double free_way = 1e-3;     // m

// Whether a place is on the side that the solid keeps, and farther from it than the range, m.
bool is_clear(const Impacts::Source& source, Vec3 place, double range) noexcept {
  Closest closest;
  Effort effort{.visits = 1024};
  const Vec3 local = to_local(source.pose, place);
  const bool is_found =
      closest_point(source.object->primitive, source.object->shape.get(), local, never, closest, nullptr, &effort);
  return is_found && !effort.is_cut && closest.distance > range && keeps(source.object->contact, closest.side);
}

}  // namespace

Impacts::One* Impacts::find(uint64_t version, uint32_t point) noexcept {
  for (uint32_t i = 0; i < count_; ++i) {
    if (all_[i].version == version && all_[i].point == point) return &all_[i];
  }
  return nullptr;
}

// weight: of the version and those that take over from it, each of which may be struck by itself.
void Impacts::meet(const Source& source, double weight, const Meeting& meeting, const ToolState& tool) noexcept {
  One* one = find(source.version, meeting.point);
  const bool is_armed = meeting.was_free && (!one || one->is_armed);
  if (!one) {
    if (count_ == most) return;
    one = &all_[count_++];
    *one = One{};
    one->version = source.version;
    one->point = meeting.point;
    one->weight = weight;
  }
  one->free = 0;
  one->is_armed = false;
  if (!is_armed) return;
  const ToolState::Point& point = tool.points[meeting.point];
  const Vec3 velocity = point.velocity - source.motion->velocity(point.position, source.pose, tool.time, tool.blend);
  const double speed = -dot(velocity, meeting.normal) / tool.scale;  // at the device
  if (!(speed >= least_speed)) return;
  const uint32_t all = tool.all_points(), feeling = tool.is_any_point ? all : source.object->point_mask() & all;
  const Impact asked = source.object->surface->impact();
  const double part = weight > 0 ? source.weight / weight : 0;
  const double wanted = part * std::min(asked.gain * speed * tool.scale, source.object->contact.limit) / std::popcount(feeling);
  const double stiffness = stiffness_of(source.object->contact) * tool.scale * tool.force_scale;  // at the device
  // What still rings keeps its tone, as its slope would not be that which was counted.
  if (one->now.is_over()) one->impact = tool.impacts ? tool.impacts->limit().bounded(asked, stiffness) : asked;
  double amplitude = wanted * tool.force_scale;
  if (tool.impacts) {
    amplitude = std::min(amplitude, tool.impacts->most(one->impact, speed));
    tool.impacts->strike(one->impact, amplitude);
  }
  const bool is_first_half = one->age < 0.5 / one->impact.frequency;
  one->momentum = (is_first_half ? one->momentum : 0) + amplitude * one->impact.impulse();
  one->age = 0;
  one->is_bounded = amplitude < wanted * tool.force_scale;
  if (tool.force_scale > 0) one->now.strike((amplitude / tool.force_scale) * meeting.normal);
}

void Impacts::feel(const Impacts* last, double step, std::span<const Source> sources, std::span<const Meeting> meetings,
                   const ToolState& tool, Felt& out) noexcept {
  count_ = 0;
  const auto source_of = [&](uint64_t version) {
    const auto found = std::ranges::find(sources, version, &Source::version);
    return found == sources.end() ? nullptr : &*found;
  };
  const auto heir_of = [&](uint64_t version) {
    const auto found = std::ranges::find(sources, version, &Source::takes_over);
    return found == sources.end() ? nullptr : &*found;
  };
  const auto whole_weight = [&](const Source* source) {  // of the version, and those that take over from it
    double sum = 0;
    for (; source; source = heir_of(source->version)) sum += source->weight;
    return sum;
  };
  for (uint32_t i = 0; last && i < last->count_; ++i) {
    One one = last->all_[i];
    const Source* source = source_of(one.version);
    if (!source) source = heir_of(one.version);
    if (source) {  // the version in which it began, and those that take over its weight
      one.version = source->version;
      one.weight = whole_weight(source);
    }
    one.now.go_on(one.impact, step);
    if (one.now.is_over()) one.now = {}, one.is_bounded = false;
    one.free += step;
    one.age += step;
    const bool is_far =
        !source || one.point >= tool.count ||
        (one.free >= free_for && is_clear(*source, tool.points[one.point].position, tool.point_radius + free_way * tool.scale));
    one.is_armed |= one.free >= free_for && is_far;
    if (!one.is_armed || !one.now.is_over()) all_[count_++] = one;
  }
  for (const Meeting& meeting : meetings) {
    if (const Source* const source = source_of(meeting.version)) meet(*source, whole_weight(source), meeting, tool);
  }
  for (uint32_t i = 0; i < count_; ++i) {
    const One& one = all_[i];
    if (one.now.is_over() || one.point >= tool.count) continue;
    out.is_bounded |= one.is_bounded;
    if (tool.impacts) {
      const bool is_first_half = one.age < 0.5 / one.impact.frequency;
      tool.impacts->feel(tool.force_scale * one.now.slope(one.impact), is_first_half ? one.momentum : 0);
    }
    const Wrench whole{one.now.force, cross(tool.points[one.point].arm, one.now.force)};
    const Source* const source = source_of(one.version);
    if (!source) {
      out.wrench = out.wrench + one.weight * whole;
      continue;
    }
    // The solid's force stays within its limit.
    const Vec3 given = source->sum->force;
    const double limit = std::max(one.weight * source->object->contact.limit, norm(given));
    *source->sum = *source->sum + (one.weight * part_beside(limit, given, one.weight * one.now.force)) * whole;
  }
}

}  // namespace fs
