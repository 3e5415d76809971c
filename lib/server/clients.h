// Keeps the sessions of the server, finds clients by name and by number, and knows whether there is room for another.
#pragma once

#include <functional>
#include <list>
#include <memory>
#include <string_view>
#include <vector>

#include <forceserver/server.h>

#include "server/client.h"

namespace fs {

class Session;

class Clients {
 public:
  Clients(Servo& servo, uint32_t most) : servo_(servo), most_(most) {}

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
  void drop_dead(uid_t user) const noexcept;  // those of the user whose end nobody has looked at yet
  void for_each(const std::function<void(const std::shared_ptr<Client>&)>& f) const;

  // ---- Room. There may be so many clients, a few that have not said who they are, and as many that are gone but still felt.
  // Called before one is added that has not said who it is: the one that has waited longest without a word may have to go.
  void make_room(bool is_refused);  // is_refused: the new one will be
  void require_room();              // for one more client that has said who it is. FULL
  void note_leaving(const Client& client) noexcept;  // it is gone
  void reap_leaving();                               // forgets those that are not felt any more

 private:
  Servo& servo_;
  const uint32_t most_;
  std::vector<std::shared_ptr<Session>> sessions_;
  std::list<Ref<Channel>> leaving_;  // of clients that are gone but can still be felt
};

}  // namespace fs
