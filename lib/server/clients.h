// Keeps the sessions of the server, and finds clients by name and by number.
#pragma once

#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include <forceserver/server.h>

#include "server/client.h"

namespace fs {

class Session;

class Clients {
 public:
  // ---- All sessions, also of clients that have not said who they are.
  const std::vector<std::shared_ptr<Session>>& sessions() const noexcept { return sessions_; }
  void add(std::shared_ptr<Session> session) { sessions_.push_back(std::move(session)); }  // ids rise
  std::shared_ptr<Session> find(uint64_t id) const;            // null: there is none, or it is gone
  Session* find_session(std::string_view name) const;          // null: there is none, or it is gone
  std::vector<std::shared_ptr<Session>> take_gone();           // removes those of clients that are gone
  void clear() noexcept { sessions_.clear(); }

  // ---- The clients that are there and have said who they are.
  Client* find(std::string_view name) const;  // null: none
  std::shared_ptr<Client> share(std::string_view name) const;
  size_t count() const;
  std::vector<fs_client> describe() const;
  bool is_anybody_applying() const;
  void for_each(const std::function<void(const std::shared_ptr<Client>&)>& f) const;

 private:
  std::vector<std::shared_ptr<Session>> sessions_;
};

}  // namespace fs
