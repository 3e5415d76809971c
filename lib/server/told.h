// What a client has to be told: the names of its objects whose state the client may have wrong, with who changed them, and
// its view. The client asks for these one by one (a pull), until it has been told as far as Outbox::news counts. A name that is held up by a parked change is told only after that change was applied or refused.
#pragma once

#include <string>
#include <utility>

#include "base/name_map.h"
#include "server/parked.h"

namespace fs {

class Told {
 public:
  const NameMap<std::string>& names() const noexcept { return names_; }  // with who changed them
  NameMap<std::string>& names() noexcept { return names_; }
  bool is_empty() const noexcept { return names_.empty() && !is_view_due_; }
  void note_view() noexcept { is_view_due_ = true; }

  // True: the view is told next, and is told then.
  bool takes_view(const Parked& parked) noexcept {
    return !parked.holds_up_view() && std::exchange(is_view_due_, false);
  }
  const std::string* next_name(const Parked& parked) const {  // that is told next; null: none
    for (const auto& [name, editor] : names_) {
      if (!parked.holds_up(name)) return &name;
    }
    return nullptr;
  }
  bool is_all_told(const Parked& parked) const {
    return (!is_view_due_ || parked.holds_up_view()) && !next_name(parked);
  }

  uint64_t news = 0;   // Outbox::news as far as it has been told

 private:
  NameMap<std::string> names_;
  bool is_view_due_ = false;
};

}  // namespace fs
