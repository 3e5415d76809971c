// The views that a scene posts: where its tool stands. Another frame or tool is another version, which cross-fades with
// the one before (field/weight.h). The clutch holds and lets go of a view without making another. Every call needs the
// scene's lock.
#pragma once

#include <optional>

#include "field/servo_output.h"
#include "scene/versions.h"

namespace fs {

// What is to change about a view; what is not given stays.
struct ViewChange {
  std::optional<fs_frame> frame{};
  std::optional<std::vector<Vec3>> points{};
  std::optional<bool> held{};
  std::optional<double> point_radius{};

  void add(ViewChange later);  // where both have a value, the later one counts
};

class ViewRows : Versions<ViewRows> {
 public:
  explicit ViewRows(const ServoOutput& output) : output_(output) {}

  const Ref<Views>& views() const noexcept { return views_; }
  const View& now() const noexcept { return views_->now(); }
  void set_next_sequence(uint64_t sequence) noexcept { sequence_ = sequence; }

  void change(const ViewChange& change);  // when it throws, all is as before
  // Lets go of what has faded out, which would go on to count as where the tool may be. True: something is to be posted.
  bool tidy() { return servo_ && tidy_older(views_->newest); }
  fs_frame frame() const noexcept;        // as a clutch may have moved it
  bool get_held(Pose& tool) const noexcept;  // where the clutch holds the tool, scene frame; false: it does not, or no tick knows

  void attach_servo(Reader& reader) noexcept;
  void detach_servo() noexcept { servo_ = nullptr; }
  Ref<Views> settled() const;  // without anything that fades, as the clutch has left it; to be swapped in by take
  void take(Ref<Views>& settled) noexcept { std::swap(views_, settled); }

 private:
  friend Versions<ViewRows>;
  uint64_t sequence() const noexcept { return sequence_; }
  const View& row(uint32_t i) const noexcept { return views_->rows[i]; }
  View& edit(uint32_t i) noexcept { return views_->rows[i]; }
  Weight* weight(uint32_t i) const noexcept { return servo_ ? &servo_->memory->views.weight(i) : nullptr; }
  void own(uint32_t i);
  void drop(uint32_t i) noexcept;

  bool find(uint32_t i, FoundView& out) const noexcept;
  // Rows that no tick can use. Where `reserve` or fewer are left, a posted view is taken back if no tick has it yet. Views that a
  // tick uses already cannot be taken back; at most two come before rows are free again, so three are enough.
  std::vector<uint32_t> free_rows() const;
  static constexpr size_t reserve = 3;
  uint64_t used() const noexcept { return output_.used.load(std::memory_order_acquire); }

  const ServoOutput& output_;
  Ref<Views> views_ = first();
  static Ref<Views> first();
  uint64_t sequence_ = 1, last_version_ = 1;
  uint64_t free_at_[Views::size] = {};  // sequence of the first snapshot without the row
  Reader* servo_ = nullptr;
};

}  // namespace fs
