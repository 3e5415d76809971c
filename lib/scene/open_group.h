// Changes that belong together and are not felt yet: an open group of the application, or a draft of another client.
#pragma once

#include <vector>

#include "scene/objects.h"
#include "scene/view_rows.h"

namespace fs {

struct OpenGroup {
  NameMap<Known> changes;
  std::vector<const std::string*> order;  // names, as they came
  size_t added = 0;                       // names that the scene has not
  size_t committed = 0;                   // of order, so far
  ViewChange view;
  NameMap<uint32_t> parts;                // of a draft: fs_part bits that are changed

  Known* find(std::string_view name) {
    const auto found = changes.find(name);
    return found == changes.end() ? nullptr : &found->second;
  }
  void put(std::string_view name, const Known& wanted, bool is_new) {
    const auto [made, is_first] = changes.try_emplace(std::string(name), wanted);
    if (!is_first) {
      const bool was_more = made->second.is_more_than_moved;
      made->second = wanted;
      made->second.is_more_than_moved |= was_more;
      return;
    }
    try {
      order.push_back(&made->first);
    } catch (...) {
      changes.erase(made);
      throw;
    }
    added += is_new;
  }
};

}  // namespace fs
