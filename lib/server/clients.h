// The directory of the server's clients: finds them by name, and knows whether there is room for another. Only those are found
// that are there and have said who they are.
#pragma once

#include <functional>
#include <list>
#include <memory>
#include <string_view>
#include <vector>

#include <forceserver/server.h>

#include "server/client.h"

namespace fs {

class Clients {
 public:
  Clients(Servo& servo, uint32_t most) : servo_(servo), most_(most) {}

  void add(std::shared_ptr<Client> client) { all_.push_back(std::move(client)); }  // who may not have said who it is
  void remove_gone() noexcept;

  std::shared_ptr<Client> find(std::string_view name) const;  // null: none
  size_t count() const;
  std::vector<fs_client> describe() const;
  void drop_dead(uid_t user) const noexcept;  // those of the user whose end nobody has looked at yet
  void for_each(const std::function<void(const std::shared_ptr<Client>&)>& f) const;

  // ---- Room. There may be so many clients, and as many that are gone but still felt.
  void require_room();                               // for one more client. FULL
  void note_leaving(const Client& client) noexcept;  // it is gone
  void reap_leaving();                               // forgets those that are not felt any more

 private:
  Servo& servo_;
  const uint32_t most_;
  std::vector<std::shared_ptr<Client>> all_;
  std::list<Ref<Channel>> leaving_;  // of clients that are gone but can still be felt
};

}  // namespace fs
