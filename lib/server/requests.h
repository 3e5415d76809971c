// Answers the requests of a client. A single change of another client's object is a request, too. While it has to wait, the
// session parks it like any other change, so that earlier and later changes of the same object keep their order.
#pragma once

#include "base/error.h"
#include "server/claims.h"
#include "server/client.h"
#include "server/syncs.h"

namespace fs {

// A request as it came.
struct Request {
  uint64_t serial;
  Change content;  // its type and record
  template <class Record>
  const Record& as() const {
    return content.as<Record>();
  }
};

class Requests {
 public:
  Requests(Client& client, Syncs& syncs) : client_(client), syncs_(syncs) {}

  static void add_to(Claim& claim, const Change& request);  // the scenes that the request is about
  void handle(const Request& request);
  void refuse(const Request& request, const Error& error);

 private:
  void answer(const Request& request);
  void change_foreign(const Request& request);
  void get(const Request& request);
  void report(const Request& request);
  void pull(const Request& request);
  void tell_object(const std::string& name, wire::PullAnswer& out);
  void fetch(const Request& request);
  void view(const Request& request);
  void stop_force(const Request& request);
  void resume_force(const Request& request);
  void tell_all(const char* text) const noexcept;  // what the client has done to the force

  Client& client_;
  Syncs& syncs_;
  uint64_t told_ = 0;  // Outbox::news as far as the client has been told
};

}  // namespace fs
