// The force law of an object: both of its sides as one function g(s) of the signed distance s, positive in front. The
// force on the tool is g along the direction in which s grows, so g > 0 pushes towards the front. A point or polyline
// has a front only.
#pragma once

#include <cmath>

#include "law/profile.h"

namespace fs {

struct Law {
  Profile front, back;
  // The surface has edges. A force that goes on through it, as a weight does, would turn at once where it passes one.
  bool has_edges = false;
  double support = -1;  // m, no force beyond this distance on either side; may be infinite; negative: never a force

  // The parsers of the custom profiles; each thread has its own.
  struct Parsers {
    std::unique_ptr<Curve::Parser> front, back;
  };
  // A member is null when its profile needs no parser.
  Parsers make_parsers() const {
    Parsers out;
    if (front.curve) out.front = front.curve->make_parser();
    if (back.curve) out.back = back.curve->make_parser();
    return out;
  }
  bool has_curves() const noexcept { return front.curve || back.curve; }

  // [rt] g (N) and its slope (N/m) at s (m) and the profiles' time t (s), felt by a ball about s; parsers: may be null
  // without curves; radius: m, of the ball.
  Intensity at(double s, double t, const Parsers* parsers, double radius = 0) const noexcept {
    if (!(s < 0)) {
      const Intensity f = evaluate(front, parsers ? parsers->front.get() : nullptr, std::fabs(s), t, radius);
      return front.sense == FS_SENSE_REPULSIVE ? f : Intensity{-f.force, -f.slope};
    }
    const Intensity f = evaluate(back, parsers ? parsers->back.get() : nullptr, -s, t, radius);
    return back.sense == FS_SENSE_REPULSIVE ? Intensity{-f.force, f.slope} : Intensity{f.force, -f.slope};
  }
  double limit(double s) const noexcept { return s < 0 ? back.limit : front.limit; }  // N
};

// The law with a bound on its slope: the largest function that has the sign of g, is nowhere above |g| in magnitude and is
// nowhere steeper than `slope` (N/m, > 0), across s = 0 and the reach too. So a force that begins at s = 0, or turns
// over there, is at most slope*|s|, and one that goes on there may differ from that of the other side by that much; but at a
// surface with edges every force begins. An infinite slope, and one that g exceeds nowhere, leave the law as it is. A cap that `law` has already is replaced.
//
// For a table all of this is exact. An expression is sampled, so what is steep between two samples remains. One that depends
// on time is sampled whenever it is evaluated, if it is steep; and its force on either side is then at most slope*|s|.
Law capped(const Law& law, double slope);

// The steepest |slope| of g at any s, N/m; infinite where g jumps, and where it is not 0 at a surface with edges. For an expression it is an estimate.
double slope_of(const Law& law);

}  // namespace fs
