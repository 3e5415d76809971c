// The force law of an object: both of its sides as one function g(s) of the signed distance s, positive in front. The
// force on the tool is g along the direction in which s grows, so g > 0 pushes towards the front. A point or polyline
// has a front only.
#pragma once

#include "force/profile.h"

namespace fs {

struct Law {
  Profile front, back;
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

  // [rt] g (N) and its slope (N/m) at s (m) and the profiles' time t (s); parsers: may be null without curves.
  Intensity at(double s, double t, const Parsers* parsers) const noexcept {
    if (!(s < 0)) {
      const Intensity f = evaluate(front, parsers ? parsers->front.get() : nullptr, s, t);
      return front.sense == FS_SENSE_REPULSIVE ? f : Intensity{-f.force, -f.slope};
    }
    const Intensity f = evaluate(back, parsers ? parsers->back.get() : nullptr, -s, t);
    return back.sense == FS_SENSE_REPULSIVE ? Intensity{-f.force, f.slope} : Intensity{f.force, -f.slope};
  }
  double limit(double s) const noexcept { return s < 0 ? back.limit : front.limit; }  // N
};

}  // namespace fs
