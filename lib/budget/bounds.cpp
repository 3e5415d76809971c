#include "budget/bounds.h"

#include <algorithm>
#include <cmath>

#include "budget/wants.h"

namespace fs {
namespace {

// N/m, what all of them want together at most at one place.
double most_of(const std::vector<ObjectWant>& wants, const SceneLimit& limit, double now) {
  SlopeWants slopes{limit, now};
  for (size_t i = 0; i < wants.size(); ++i) {
    const ObjectWant& want = wants[i];
    slopes.add_law(want, i, 2 * i, want.law);
    slopes.add(want, i, 2 * i + 1, contact_reach(want, want.contact), want.contact);
  }
  return std::min(slopes.most_wanted(), limit.whole);
}

// The bounds of all slopes: of the law of want i as user 2i, of its contact as user 2i + 1.
// clear: lowered to the gap between where the tool may be and what is wanted elsewhere.
FairBounds slopes_of(const std::vector<ObjectWant>& wants, const SceneLimit& limit, double now, double& clear) {
  const size_t users = 2 * wants.size();
  std::vector<double> bounds(users);
  for (size_t i = 0; i < wants.size(); ++i) bounds[2 * i] = wants[i].law, bounds[2 * i + 1] = wants[i].contact;
  // A softer object slopes over a longer way, so its region grows: repeat until no region grows. Should that take long, all
  // regions are made as large as they can be; with more than a thousand objects that is sooner.
  const int last_round = std::clamp(static_cast<int>(40'000 / std::max<size_t>(1, wants.size())), 2, 40);
  constexpr double same = 0.99;
  FairBounds out{std::vector<double>(users, never), std::vector<uint32_t>(users, FairBounds::none), {}};
  for (int round = 0; round <= last_round && limit.stiffness < never; ++round) {
    SlopeWants slopes{limit, now};
    for (size_t i = 0; i < wants.size(); ++i) {
      const ObjectWant& want = wants[i];
      const bool is_last = round == last_round;
      const double law = same * bounds[2 * i], contact = same * bounds[2 * i + 1];
      if (is_last) slopes.add(want, i, 2 * i, felt_reach(want, 0), want.law);
      if (!is_last) slopes.add_law(want, i, 2 * i, law);
      slopes.add(want, i, 2 * i + 1, contact_reach(want, is_last ? 0 : contact), want.contact);
    }
    slopes.lower_to_gap(clear);
    const FairBounds found = slopes.bounds(users, limit.stiffness);
    const auto first = static_cast<uint32_t>(out.neighbours.size());
    out.neighbours.insert(out.neighbours.end(), found.neighbours.begin(), found.neighbours.end());
    bool is_same = true;
    for (size_t user = 0; user < users; ++user) {
      is_same &= found.bounds[user] >= same * bounds[user];
      if (!(found.bounds[user] < bounds[user])) continue;
      bounds[user] = out.bounds[user] = found.bounds[user];
      out.neighbours_of[user] = first + found.neighbours_of[user];
    }
    if (is_same) break;
  }
  return out;
}

// With whom an object shares: the neighbours of its law, or where the law gets all that it wants, those of its contact.
SharedWith shared_with(const std::vector<ObjectWant>& wants, size_t number, const FairBounds& bounds) {
  SharedWith out;
  const uint32_t law = bounds.neighbours_of[2 * number], contact = bounds.neighbours_of[2 * number + 1];
  const uint32_t in = law != FairBounds::none ? law : contact;
  if (in == FairBounds::none) return out;
  const Neighbours& neighbours = bounds.neighbours[in];
  const std::string& own = wants[number].object->name;
  for (size_t i = 0; i < std::min<size_t>(neighbours.count, neighbours.objects.size()); ++i) {
    const std::string& name = wants[neighbours.objects[i]].object->name;
    const bool is_new = std::find(out.names.begin(), out.names.end(), name) == out.names.end();
    if (name != own && is_new) out.names.push_back(name);
  }
  out.count = std::max<size_t>(neighbours.count > neighbours.objects.size() ? neighbours.count - 1 : 0, out.names.size());
  return out;
}

}  // namespace

SceneBounds bounds_of(const Snapshot& snapshot, const SceneLimit& limit, double now, const Memory* memory) {
  SceneBounds out;
  std::vector<ObjectWant> wants = object_wants(snapshot, limit, now, memory, out.clear);
  if (limit.is_split) {
    out.wanted = limit.to_loop * most_of(wants, limit, now);
    for (ObjectWant& want : wants) {
      want.law = std::min(want.law, limit.stiffness);
      want.contact = std::min(want.contact, limit.stiffness);
    }
  }
  const FairBounds slopes = slopes_of(wants, limit, now, out.clear);
  FairBounds damping;
  if (limit.damping < never) {
    SlopeWants all{limit, now};
    for (size_t i = 0; i < wants.size(); ++i) {
      const double contact = std::min(slopes.bounds[2 * i + 1], wants[i].contact);
      all.add(wants[i], i, i, felt_reach(wants[i], contact), wants[i].damping);
    }
    damping = all.bounds(wants.size(), limit.damping);
  }

  out.objects.reserve(wants.size());
  for (size_t i = 0; i < wants.size(); ++i) {
    out.has_fading |= !wants[i].is_named;
    if (!wants[i].is_named) continue;
    ObjectBounds row{wants[i].row, wants[i].object, wants[i].is_moving, {}, {}};
    const Object& object = *row.object;
    const unsigned points = wants[i].points;
    const double law = slopes.bounds[2 * i], contact = slopes.bounds[2 * i + 1];
    row.bounds = {limit.stiffness, limit.stiffness / points, limit.damping, limit.damping / points};
    if (law < wants[i].law) row.bounds.slope = law;
    if (contact < wants[i].contact) row.bounds.stiffness = contact / points;
    if (!damping.bounds.empty() && damping.bounds[i] < wants[i].damping) {
      const double part = damping.bounds[i] / wants[i].damping;
      row.bounds.damping = part * object.damping;
      row.bounds.contact_damping = part * object.contact.damping;
    }
    row.bounds = of_use(row.bounds, object);
    row.shared_with = shared_with(wants, i, slopes);
    out.objects.push_back(std::move(row));
  }
  return out;
}

}  // namespace fs
