// The slow reference: what the header says, written down once more, in long double and without a single shortcut. Every
// triangle is looked at; the side of a closed mesh comes from its winding number, the stiffness from differences.
#pragma once

#include <vector>

#include "scenes/scenes.h"

namespace scenes {

// f(d, t) of a profile, N, clamped to [0, limit] and 0 beyond its reach. curve: what its fs_curve stands for, or null.
long double profile_force(const fs_profile& profile, const Function* curve, long double d, long double t);

struct Felt {
  fs_wrench wrench;
  fs_mat3 stiffness;
  double roughness;  // N/m: how far the slopes just before and just behind x differ: large at a kink or a jump
  uint32_t felt_count, faint_count;  // objects that give a force; those that give less than 1e-30 N
};

class Reference {
 public:
  // The objects' time and start must be given (not FS_NOW): a reference has no clock.
  explicit Reference(const Content& content);
  ~Reference();

  // Without a servo: what is enabled and has not expired is felt in full. with_stiffness costs six times more.
  Felt evaluate(const fs_state& state, const std::vector<fs_vec3>& tool, bool with_stiffness) const;

 private:
  struct Solid;
  struct Part;
  std::vector<Part> parts_;
};

}  // namespace scenes
