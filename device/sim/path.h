// The path of the target towards which the simulated hand pulls.
#pragma once

#include <string>
#include <vector>

#include "math/vec3.h"

namespace fs {

class HandPath {
 public:
  struct Target {
    Vec3 position, velocity;  // m, m/s, device frame
  };

  static HandPath hold(Vec3 position);
  // "figure8", "sweep" or "touch" (parameters.h); any other name is that of a file with lines "t x y z" (s, m). t must
  // increase; the target moves straight from line to line and rests before the first and after the last. '#' begins a
  // comment. The file must be regular and at most 64 MB. Throws a Refusal: NOT_FOUND, IO,
  // PARSE with the line.
  static HandPath named(const std::string& name);

  // [rt] time: s, never earlier than in the last call.
  Target at(double time) noexcept;

 private:
  enum class Kind { POINTS, FIGURE8, SWEEP, TOUCH };
  struct Point {
    double time;
    Vec3 position;
  };
  static HandPath read_file(const std::string& name);

  Kind kind_ = Kind::POINTS;
  std::vector<Point> points_;
  size_t next_ = 0;  // index of the first point still ahead
};

}  // namespace fs
