// What one kind of profile (fs_profile_kind) differs in from the others: one table, which all the library asks. Whoever adds a
// kind adds a row here and a name in names.h; beside that only NONE and CUSTOM are told apart elsewhere.
#pragma once

#include <cstdint>
#include <limits>

#include "law/cap.h"
#include "law/curve.h"
#include "law/form.h"

namespace fs {

struct Profile {
  fs_profile_kind kind = FS_PROFILE_NONE;
  fs_sense sense = FS_SENSE_ATTRACTIVE;
  double gain = 0, offset = 0, width = 0;
  double limit = 0;
  double reach = 0;  // m; 0 means unlimited, as in fs_profile
  Ref<const Curve> curve;
  Ref<const Cap> cap;  // null: its slope has no bound

  ScaledCurve scaled_curve() const noexcept { return {curve.get(), gain, limit}; }
};

// What bounds the distance from which on the slope of a profile is of no account (slope_end in profile.h).
struct SlopeEnd {
  double support;  // m, of the profile
  double k;        // N/m, the steepest that the profile may be
  double least;    // N/m: less is of no account
  double farther;     // m, how much farther out a profile with a capped slope has the same force, at most
  bool turns;      // the direction of the force changes from place to place: a slope of f(d) / d

  double turn(double force) const noexcept { return turns ? force / least : 0; }  // m, until this force turns less than that
};

struct Kind {
  enum class Gain : uint8_t { zero, not_negative, not_positive, any };

  // The fields of fs_profile that it uses.
  Gain gain;
  bool has_offset, has_width, has_curve;
  bool is_constant;  // f is the gain
  Form form;         // without a curve

  // The following take a profile of this kind. They do not regard reach and cap. The first three take none with gain 0.

  // The support of f clamped at 0.
  double (*support)(const Profile&) noexcept;
  // N/m, the supremum of |slope| over d <= end where 0 < f < limit.
  double (*slope)(const Profile&, double end) noexcept;
  // Sets what f is lowered to where it is steeper than cap.slope: rise, fall, bend or knots.
  void (*bend)(const Profile&, Cap& cap);
  // m, beyond this distance f is at most `force` (N, > 0); -1: everywhere. Null: f does not fade out without end.
  double (*tail)(const Profile&, double force) noexcept;
  // m, see SlopeEnd. Takes none that never gives a force, and none with a reach.
  double (*slope_end)(const Profile&, const SlopeEnd&) noexcept;
};

extern const Kind kinds[FS_PROFILE_CUSTOM + 1];

// [rt] kind: one that parse_profile lets pass.
inline const Kind& kind_of(fs_profile_kind kind) noexcept { return kinds[kind]; }

// A profile without a curve in the numbers of its formula. With gain 0 any of them is linear.
struct Formula {
  explicit Formula(const Profile& f) noexcept
      : gain(f.gain), offset(f.offset), width(f.width), limit(f.limit),
        reach(f.reach > 0 ? f.reach : std::numeric_limits<double>::infinity()) {
    const Kind& kind = kind_of(f.kind);
    if (f.gain != 0) form = kind.form;
    if (kind.is_constant) offset = f.gain;
    if (kind.is_constant || f.gain == 0) gain = 0;  // not -0
  }
  Form form = Form::linear;
  double gain, offset, width, limit, reach;
};

}  // namespace fs
