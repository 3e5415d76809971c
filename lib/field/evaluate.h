// The force of a snapshot's objects on a tool. Pure but for the reader's own memory: the same input gives the same bits.
#pragma once

#include <forceserver/evaluate.h>

#include "field/memory.h"
#include "field/object_force.h"

namespace fs {

// What a reader needs to evaluate a row: the parsers of its custom profiles, and hints for each point of a tool. Made by
// whoever posts the row; only the reader uses it.
struct Scratch : LocalCounted<Scratch> {
  uint64_t sequence = 0;
  Law::Parsers parsers;
  std::unique_ptr<Hint[]> hints;  // of a mesh that is not small; else null

  static bool is_needed(const Object& object) { return object.law.has_curves() || has_hints(object); }
  // Null where none is needed.
  static Ref<Scratch> of(const Object& object) {
    if (!is_needed(object)) return nullptr;
    Ref<Scratch> out = make_ref<Scratch>();
    out->parsers = object.law.make_parsers();
    if (has_hints(object)) out->hints = std::make_unique<Hint[]>(FS_TOOL_POINTS_MAX);
    return out;
  }

 private:
  static bool has_hints(const Object& object) {
    constexpr size_t small = 64;  // triangles
    return object.primitive == FS_PRIMITIVE_MESH && object.shape->triangles.size() > 3 * small;
  }
};
using Scratches = Table<Scratch, 6>;  // by row

// What is posted to a reader.
struct Posting {
  Ref<const Snapshot> snapshot;
  Scratches scratches;  // this reader's own
  friend bool operator==(const Posting& a, const Posting& b) noexcept { return a.snapshot == b.snapshot; }
};

// [rt] The sum of what can be felt of the snapshot that `memory` has absorbed, each object with its weight, seen through a
// view. `what`: see Memory::look. effort: null: searches are not cut short.
fs_response evaluate_near(const Scratches& scratches, Memory& memory, uint32_t view, uint64_t what, const ToolPoints& points,
                          const ToolState& tool, Effort* effort = nullptr) noexcept;

// [rt] A state that can be evaluated: finite, within bounds, a unit orientation (made so in place).
fs_status check_state(fs_state& state) noexcept;

}  // namespace fs
