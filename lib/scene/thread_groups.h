// The groups of changes that threads have open, at most one each. What a thread has open no other thread sees, joins or ends.
// Every call needs the lock of whoever has this.
#pragma once

#include <cassert>
#include <cstdint>
#include <map>
#include <memory>

#include "base/process.h"

namespace fs {

template <class Group>
class ThreadGroups {
 public:
  Group* mine() const noexcept {  // of the calling thread; null: it has none open
    if (groups_.empty()) return nullptr;
    const auto found = groups_.find(this_thread());
    return found == groups_.end() ? nullptr : found->second.get();
  }
  void open(std::unique_ptr<Group> group) {
    assert(!mine());
    groups_[this_thread()] = std::move(group);
  }
  void close() noexcept { groups_.erase(this_thread()); }

  template <class F>
  void for_each(F&& f) const {
    for (const auto& [thread, group] : groups_) f(*group);
  }

 private:
  std::map<uint64_t, std::unique_ptr<Group>> groups_;
};

}  // namespace fs
