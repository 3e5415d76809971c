#include "law/law.h"

#include <algorithm>
#include <cmath>

namespace fs {
namespace {

constexpr double unbounded = std::numeric_limits<double>::infinity();

double slope_without_cap(const Law& law) {
  // At s = 0, g goes from the back's value to the front's. A point or polyline has no back; there the direction turns over.
  const auto outward = [](const Profile& profile) { return profile.sense == FS_SENSE_REPULSIVE ? 1.0 : -1.0; };
  const double front = outward(law.front) * first_force(law.front);
  const double back = -outward(law.back) * first_force(law.back);
  if (front != back || (law.has_edges && front != 0)) return unbounded;
  return std::fmax(steepest_slope(law.front), steepest_slope(law.back));
}

bool is_expression(const Profile& profile) { return profile.curve && profile.curve->expression(); }
bool is_timed(const Profile& profile) { return profile.curve && profile.curve->is_timed(); }

Ref<Cap> cap_of(Profile& profile, double slope) {
  profile.cap = nullptr;
  return profile.kind == FS_PROFILE_NONE ? nullptr : make_cap(profile, slope);
}

}  // namespace

Law capped(const Law& law, double slope) {
  Law out = law;
  out.front.cap = out.back.cap = nullptr;
  const bool is_exact = !is_expression(law.front) && !is_expression(law.back);
  if (!(slope < unbounded) || (is_exact && slope_without_cap(out) <= slope)) return out;
  const Ref<Cap> front = cap_of(out.front, slope), back = cap_of(out.back, slope);

  // The force from which each side may rise at s = 0: the other side's, if it has the same direction. N
  struct Across {
    double force = 0, raw = 0;  // with the cap, and without
  };
  Across across_front, across_back;
  const bool goes_on = front && back && out.front.sense != out.back.sense && !law.has_edges;
  if (goes_on && !is_timed(out.front) && !is_timed(out.back)) {
    const Law::Parsers parsers = out.make_parsers();
    const auto force_at_0 = [](const Profile& profile, const Cap& cap, Curve::Parser* parser) {
      const Intensity raw = evaluate(profile, parser, 0, 0);
      return Across{cap.lower(profile.scaled_curve(), parser, 0, 0, raw).force, raw.force};
    };
    across_front = force_at_0(out.back, *back, parsers.back.get());
    across_back = force_at_0(out.front, *front, parsers.front.get());
  }
  if (front) front->across = across_front.force, front->across_raw = across_front.raw;
  if (back) back->across = across_back.force, back->across_raw = across_back.raw;
  out.front.cap = front;
  out.back.cap = back;
  return out;
}

double slope_of(const Law& law) {
  double most = unbounded;
  for (const Profile* const side : {&law.front, &law.back}) {
    if (side->cap) most = std::fmin(most, side->cap->slope);
  }
  return std::fmin(slope_without_cap(law), most);
}

}  // namespace fs
