// The sessions of a server, also of clients that have not said who they are.
#pragma once

#include <memory>
#include <vector>

#include "server/session.h"

namespace fs {

class Sessions {
 public:
  using List = std::vector<std::shared_ptr<Session>>;
  List::const_iterator begin() const noexcept { return all_.begin(); }
  List::const_iterator end() const noexcept { return all_.end(); }
  size_t size() const noexcept { return all_.size(); }
  Session& operator[](size_t i) const noexcept { return *all_[i]; }

  void add(std::shared_ptr<Session> session) { all_.push_back(std::move(session)); }  // ids rise
  std::shared_ptr<Session> find(uint64_t id) const;  // null: there is none, or its client is gone
  List take_gone();                                  // removes those of clients that are gone
  void clear() noexcept { all_.clear(); }

  // Called before one is added: so many may not have said who they are. The one that has waited longest without a word may have
  // to go. is_refused: the new one will be.
  void make_room(bool is_refused);

 private:
  List all_;
};

}  // namespace fs
