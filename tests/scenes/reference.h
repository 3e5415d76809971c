// The slow reference: a second implementation of what the headers say, in long double and without shortcuts. It looks
// at every triangle, finds the side of a closed mesh from the winding number, and the stiffness from differences.
#pragma once

#include <vector>

#include "scenes/scenes.h"

namespace scenes {

// f(d, t) of a profile, N, clamped to [0, limit] and 0 beyond its reach. curve: the function of its fs_curve, or null.
long double profile_force(const fs_profile& profile, const Function* curve, long double d, long double t);

struct Felt {
  fs_wrench wrench;
  fs_mat3 stiffness;
  double roughness;  // N/m: the difference of the slopes on both sides of x: large at a kink or a jump
  uint32_t felt_count, faint_count;  // objects that give a force; those that give less than 1e-30 N
};

class Reference {
 public:
  // The objects' time and start must be given (not FS_NOW): a reference has no clock.
  explicit Reference(const Content& content);
  ~Reference();

  // Without a servo: objects that are enabled and have not expired have weight 1. with_stiffness costs six times more.
  // radius: m, of the points.
  Felt evaluate(const fs_state& state, const std::vector<fs_vec3>& tool, bool with_stiffness, double radius = 0) const;

 private:
  struct Solid;
  struct Part;
  std::vector<Part> parts_;
};

}  // namespace scenes
