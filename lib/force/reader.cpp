#include "force/reader.h"

#include <algorithm>
#include <mutex>
#include <vector>

namespace fs {
namespace {

struct Registry {
  std::mutex mutex;
  std::vector<bool> taken;
};

Registry& registry() {
  static Registry& instance = *new Registry;  // never destroyed: a reader may outlive the static objects
  return instance;
}

}  // namespace

ReaderId::ReaderId() {
  Registry& r = registry();
  const std::lock_guard lock(r.mutex);
  const auto free = std::find(r.taken.begin(), r.taken.end(), false);
  id_ = static_cast<unsigned>(free - r.taken.begin());
  if (free == r.taken.end()) {
    r.taken.push_back(true);
  } else {
    *free = true;
  }
}

ReaderId::~ReaderId() {
  Registry& r = registry();
  const std::lock_guard lock(r.mutex);
  r.taken[id_] = false;
}

}  // namespace fs
