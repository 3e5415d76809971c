// The impacts of a view (object.h, Surfaces): for each tool point and solid whose surface has one, what is still felt of it, and
// when the next may come.
#pragma once

#include <array>
#include <span>

#include "field/object_force.h"
#include "law/impact.h"

namespace fs {

// What the impacts of all scenes of a servo may have together. The tick's alone.
class ImpactBudget {
 public:
  // [rt] Begins a tick. An impact that rings never becomes steeper by itself. So what was felt in the last tick, plus what strikes in
  // this one, bounds everything.
  void begin(const ImpactLimit& limit) noexcept {
    limit_ = limit;
    slope_ = felt_slope_;
    momentum_ = felt_momentum_;
    felt_slope_ = felt_momentum_ = 0;
  }
  const ImpactLimit& limit() const noexcept { return limit_; }
  // [rt] N, the largest amplitude that an impact after an approach at this speed (m/s) may have.
  double most(const Impact& impact, double speed) const noexcept { return limit_.most(impact, speed, slope_, momentum_); }
  // [rt] Counts an impact of this amplitude (N) that strikes in this tick.
  void strike(const Impact& impact, double amplitude) noexcept {
    slope_ += amplitude * impact.turn();
    momentum_ += amplitude * impact.impulse();
  }
  // [rt] One that is felt in this tick. slope: N/s; momentum: N s, that it has in its first half wave, else 0.
  void feel(double slope, double momentum) noexcept {
    felt_slope_ += slope;
    felt_momentum_ += momentum;
  }

 private:
  ImpactLimit limit_;
  double slope_ = 0, momentum_ = 0, felt_slope_ = 0, felt_momentum_ = 0;
};

// A point that touches a solid.
struct Meeting {
  uint64_t version;
  uint32_t point;
  bool was_free;   // it was near the solid in the last tick, but did not touch it
  Vec3 normal;     // unit, scene frame, outwards
};

class Impacts {
 public:
  // What the solid of an impact is in this tick.
  struct Source {
    uint64_t version;
    uint64_t takes_over;    // see Solid
    const Object* object;
    const Motion* motion;
    Pose pose;
    double weight;
    Wrench* sum;            // N, N m, not weighted: what it gives already, to which its impacts are added
  };
  struct Felt {
    Wrench wrench{};        // N, N m: of impacts whose solids are out of reach
    bool is_bounded = false;  // one is less than was asked for
  };

  // [rt] One tick. last: as they were at the last one; null: nothing was known. step: s, since then. sources: the solids near the
  // tool that have an impact.
  void feel(const Impacts* last, double step, std::span<const Source> sources, std::span<const Meeting> meetings,
            const ToolState& tool, Felt& out) noexcept;
  void forget() noexcept { count_ = 0; }
  bool is_empty() const noexcept { return count_ == 0; }

  static constexpr uint32_t most = 128, most_sources = 64;

 private:
  struct One {
    uint64_t version = 0;
    uint32_t point = 0;
    bool is_armed = false;    // the next contact is another impact
    bool is_bounded = false;  // it is less than was asked for
    double free = 0;          // s, since it was touched last
    double age = 0;           // s, since it was struck last
    double momentum = 0;      // N s at the device, of its first half wave
    double weight = 1;        // of its solid
    Impact impact{};          // as it is felt
    Oscillator now{};
  };

  One* find(uint64_t version, uint32_t point) noexcept;
  void meet(const Source& source, double weight, const Meeting& meeting, const ToolState& tool) noexcept;

  std::array<One, most> all_;
  uint32_t count_ = 0;
};

}  // namespace fs
