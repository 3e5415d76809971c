// The objects of a scene as they are at one moment, whatever is changed later: many can be looked at without keeping
// others waiting for the lock, those of several scenes at one time, and in another thread. Reports are worked out here, by
// whoever asks, for where the tool was at the last tick.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "field/proxies.h"
#include "scene/local_scene.h"

namespace fs {

class Moment {
 public:
  // with_group: as an open group has them; else as they are evaluated.
  // only: of this object alone, NOT_FOUND; null: of all.
  Moment(Ref<LocalScene> scene, bool with_group, const char* only = nullptr);
  ~Moment();
  Moment(const Moment&) = delete;
  Moment& operator=(const Moment&) = delete;

  size_t most() const noexcept { return most_; }  // objects
  const fs_frame& frame() const noexcept { return frame_; }
  // All changes up to this motion_revision are in, and none above.
  uint64_t last_revision() const noexcept { return last_revision_; }

  // Calls f(fs_motion) for each of them; prefix comes before its name.
  template <class F>
  void for_each_motion(const std::string& prefix, F&& f) const {
    for_each([&](const Entry& entry, uint32_t) { f(to_motion(entry, prefix)); });
  }
  // The same, without changes of a group, for those whose motion_revision is above `since` and at most `last`.
  template <class F>
  void for_each_motion_since(const std::string& prefix, uint64_t since, uint64_t last, F&& f) const {
    for_each_since(since, last, [&](uint32_t row) { f(to_motion(entry(row), prefix)); });
  }
  size_t count_since(uint64_t since, uint64_t last) const {  // how many these are
    size_t count = 0;
    for_each_since(since, last, [&](uint32_t) { ++count; });
    return count;
  }
  // Calls f(fs_report) for each.
  template <class F>
  void for_each_report(F&& f) const {
    for_each([&](const Entry& entry, uint32_t row) { f(report(entry, row)); });
  }

 private:
  // Calls f(Entry, number of its newest row; no_row: it is not evaluated yet).
  template <class F>
  void for_each(F&& f) const {
    if (is_only_one_) return f(added_.front(), only_row_);
    chunks_.for_each([&](uint32_t number, const Chunk& chunk) {
      for_each_bit(chunk.used, [&](uint32_t i) {
        if (!chunk.row(i).is_named) return;
        const uint32_t row = number * chunk_size + i;
        const auto changed = changes_.find(chunk.row(i).object->name);
        if (changed == changes_.end()) {
          f(entry(row), row);
        } else if (!changed->second.is_removed) {
          f(changed->second, row);
        }
      });
    });
    for (const Entry& entry : added_) f(entry, no_row);
  }

  template <class F>
  void for_each_since(uint64_t since, uint64_t last, F&& f) const {
    chunks_.for_each([&](uint32_t number, const Chunk& chunk) {
      for_each_bit(chunk.used, [&](uint32_t i) {
        const uint64_t revision = chunk.motion_revision(i);
        if (revision > since && revision <= last && chunk.row(i).is_named) f(number * chunk_size + i);
      });
    });
  }

  const Row& row(uint32_t number) const noexcept { return find_chunk(chunks_, number)->row(number % chunk_size); }
  Entry entry(uint32_t number) const;
  fs_report report(const Entry& entry, uint32_t row) const;
  double weight_of(uint32_t newest) const;
  bool feel(uint32_t number, ObjectForce& out) const;
  static fs_motion to_motion(const Entry& entry, const std::string& prefix) noexcept;

  const Ref<LocalScene> scene_;
  Chunks chunks_;
  NameMap<ObjectState> changes_;    // of an open group, of objects that are evaluated
  std::vector<Entry> added_;  // by an open group
  bool is_only_one_ = false;  // it stands in added_, and is evaluated as
  uint32_t only_row_ = no_row;
  size_t most_ = 0;
  uint64_t last_revision_;

  double time_;    // s, of the last tick; without a servo: now
  fs_frame frame_;
  uint64_t used_ = 0;              // sequence that the servo has used
  Ref<const Memory> memory_;       // of the servo; null: there is none
  FeltSolids solids_;              // at the last tick
  std::shared_ptr<const Sharing> sharing_;  // null: nobody shares
  ImpactLimit impacts_;            // of the servo's loop
  TickSample tick_;
  ToolState tool_;                 // where the last tick had it
};

// So that those that are cut off, where a caller has no room for all, come the next time.
void sort_by_revision(std::vector<fs_motion>& motions);

}  // namespace fs
