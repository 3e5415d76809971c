// The names of new objects, and of objects with a new shape, that no tick has used yet. The client gets FS_EVENT_READY for
// each of them when a tick has used it. A turn looks at some of them only, so that no turn takes long.
#pragma once

#include <string>

#include "base/name_map.h"

namespace fs {

class Awaited {
 public:
  bool is_empty() const noexcept { return names_.empty(); }
  const NameMap<uint64_t>& names() const noexcept { return names_; }
  NameMap<uint64_t>& names() noexcept { return names_; }  // with the sequence of the snapshot that has them; 0: not posted yet

  // Called once a turn, after the scene was posted. newest: the sequence of the scene's newest change; used: the sequence
  // that the last tick used. Calls f(name) for each that is used by now, and removes it.
  template <class F>
  void take_used(uint64_t newest, uint64_t used, F&& f) {
    auto next = names_.lower_bound(next_);  // goes on where the last turn ended
    next_.clear();
    for (int i = 0; next != names_.end(); ++i) {
      if (i == most_each_turn) {
        next_ = next->first;
        break;
      }
      auto& [name, sequence] = *next;
      if (sequence == 0) sequence = newest;
      if (used < sequence) {
        ++next;
        continue;
      }
      f(name);
      next = names_.erase(next);
    }
  }

 private:
  static constexpr int most_each_turn = 128;
  NameMap<uint64_t> names_;
  std::string next_;
};

}  // namespace fs
