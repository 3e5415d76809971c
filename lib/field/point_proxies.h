// The proxies of one tool point among the solids of one layer, and what they give to these solids.
//
// Objects of the same stiffness and limit share a proxy, which stays on the kept side of all of them: where several meet, the
// spring to it acts once, within the limit. Objects that contradict one another (proxy.h), or whose stiffness and limit have
// only just become the same, get proxies of their own until sharing one would change no force. All other objects have proxies
// of their own. So the force of each spring is the gradient of one energy, and it gives back no more than was put into it.
#pragma once

#include <span>

#include "field/touches.h"

namespace fs {

// Whether a contact keeps the tool on this side.
inline bool keeps(const fs_contact& contact, Side side) noexcept {
  return contact.keep == FS_KEEP_EITHER || (contact.keep == FS_KEEP_BACK) == (side == Side::back);
}
// How much of a force of this size is within a limit.
inline double part_within(double limit, double size) noexcept { return size > limit ? limit / size : 1; }
// How much of the damping may act beside a spring that is within the limit: the sum has to be, too.
double part_beside(double limit, Vec3 spring, Vec3 damping) noexcept;
// Projects on the directions across a way.
Mat3 across(Vec3 way) noexcept;

class PointProxies {
 public:
  // What is the same for all points and layers of a tick.
  struct Tick {
    std::span<Solid> solids;
    Touches& touches;
    const ToolState& tool;
    const Touches::View* last;  // null: nothing is known
    double now, step;           // s; step: since the last tick
    Effort* effort;             // of the profiles; null: without end
  };
  // What the proxies of a point give besides what they add to the solids. All but `reach`, a maximum, are sums, so that
  // one Gain collects those of several points.
  struct Gain {
    Vec3 pull{};                // m N/m, of the springs, and
    double stiffness = 0;       // N/m, their stiffnesses
    double reach = 0;           // m, how far a proxy was from the point at most
    double error = 0;           // N, of the profiles: a bound
    // N, by how much the forces of springs and of profiles can have changed by the ways of hand and objects.
    double spring_change = 0, profile_change = 0;
  };

  // [rt] before: the layer of the last tick that this one goes on from; null where last is.
  void feel(const Tick& tick, uint32_t point, const Layer* before, Layer& layer, Gain& out) noexcept;

 private:
  struct Before {
    const Touch* touch;  // in the last tick; null: there was none
    Touch* left;  // its touch of this tick, if it left a proxy because it contradicted the others there; null: it did not
    bool is_done;  // it has its proxy
  };
  struct Point {
    const Tick& tick;
    uint32_t number;
    const Layer* before;
    Layer& layer;
    const ToolState::Point& at() const noexcept { return tick.tool.points[number]; }
  };

  const Touch* last_touch(const Point& point, uint64_t version) const noexcept;
  const Touch* replaced(const Point& point, const Solid& solid) const noexcept;
  bool begin_touch(const Point& point, Member& member) noexcept;
  bool gather(const Point& point) noexcept;
  void feel_proxy(const Point& point, Gain& out) noexcept;
  struct Spring {
    Vec3 pull;     // m, from the hand to the proxy
    Vec3 way;      // m, of the force: as pull, but with the texture
    double size;   // m, whose energy it is the gradient of: stiffness * size^2 / 2
    double limit;  // N, for stiffness * size
    Press press;   // of a texture
  };
  Spring spring(Vec3 hand) const noexcept;
  Mat3 change(const Spring& spring, double part) const noexcept;
  void push(const Point& point, Gain& out) noexcept;
  double explained_change(const Point& point, const Member& member) const noexcept;
  void add_profiles(const Point& point, Gain& out) noexcept;

  std::array<Before, most_solids> before_;  // of the solids
  Proxy proxy_;  // the one that is worked on
};

}  // namespace fs
