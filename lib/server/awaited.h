// Names of new objects, and of those with a new shape, that no tick has used yet: the client gets FS_EVENT_READY for each
// when one has. Few are looked at in each turn, so that very many cost no turn much.
#pragma once

#include <string>

#include "base/name_map.h"

namespace fs {

class Awaited {
 public:
  bool is_empty() const noexcept { return names_.empty(); }
  const NameMap<uint64_t>& names() const noexcept { return names_; }
  NameMap<uint64_t>& names() noexcept { return names_; }  // with the sequence that uses them; 0: it is not posted yet

  // Once a turn, after the scene was posted. newest: sequence of the scene's newest change; used: of the snapshot that the
  // last tick used. Calls f(name) for each that is used by now.
  template <class F>
  void take_used(uint64_t newest, uint64_t used, F&& f) {
    auto next = names_.lower_bound(next_);  // on from where the last turn ended
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
