// Profiles: the intensity f(d, t), clamped to [0, limit] and zero beyond reach (Table 2 of the paper).
#pragma once

#include "law/kind.h"

namespace fs {

// Checks every field of an fs_profile; `field` is its name in the error sentence ("front"). Throws INVALID.
Profile parse_profile(const fs_profile& profile, const char* field);
// Converts back to an fs_profile; the curve in it is borrowed, not retained.
fs_profile to_c(const Profile& profile);
bool operator==(const Profile& a, const Profile& b);  // but for their caps

// [rt] d in m, >= 0 (may be infinite); t in s; parser: made by the profile's curve. The slope is 0 where f is clamped,
// and always finite. With a cap, it is the capped f. radius: m, of the ball about d that feels it: f(max(0, d - radius), t).
Intensity evaluate(const Profile& profile, Curve::Parser* parser, double d, double t, double radius = 0) noexcept;

// The distance beyond which the profile gives no force, m: d > support means f = 0. Infinite when the force never ends,
// -1 when the profile never gives a force. For an expression it is the reach.
double support(const Profile& profile) noexcept;

// The distance beyond which it gives `force` (N, > 0) at most, m: less than the support only for those that fade out without
// end, GAUSSIAN and INVERSE.
double support_above(const Profile& profile, double force) noexcept;
// Whether that is ever less than the support.
bool has_tail(const Profile& profile) noexcept;

// Whether the profile gives a force at any distance d > 0. For a curve only its support is asked.
bool is_ever_felt(const Profile& profile) noexcept;

// The cap of a profile by itself, without regard to the other side of d = 0. slope: N/m, > 0 and finite.
Ref<Cap> make_cap(const Profile& profile, double slope);

// The distance beyond which the slope of the profile is less than `part` of k, the steepest that it may have (N/m), m. turns:
// the direction of the force changes from place to place, as about a point: at a distance d that is a slope of f(d) / d.
double slope_end(const Profile& profile, double k, double part, bool turns) noexcept;

// A bound of the force between two distances (m), N, as if it had no cap; for a curve its limit.
double most_between(const Profile& profile, double least, double most) noexcept;

// The steepest |df/dd| over all d >= 0 where 0 < f < limit, N/m; infinite when f jumps at the reach. A curve is not
// evaluated: the slopes computed when it was made are scaled by the gain and cut off by limit and reach (curve.h). A cap
// is not regarded, in first_force neither.
double steepest_slope(const Profile& profile);
// The force at d = 0, N; for an expression the greatest of its samples in time.
double first_force(const Profile& profile);

}  // namespace fs
