// Answers the requests of a client. A single change of another client's object is a request, too. While it has to wait, the
// session parks it like any other change, so that earlier and later changes of the same object keep their order.
#pragma once

#include "base/error.h"
#include "server/client.h"

namespace fs {

// A request as it came.
struct Request {
  uint64_t serial;
  Change content;  // its type and record
  template <class Record>
  const Record& as() const { return content.as<Record>(); }
};

class Requests {
 public:
  explicit Requests(Client& client) : client_(client) {}

  void handle(const Request& request);
  void refuse(const Request& request, const Error& error);

 private:
  void answer(const Request& request);
  void edit(const Request& request);
  void get(const Request& request);
  void report(const Request& request);
  void pull(const Request& request);
  void tell_object(const std::string& name, wire::Pulled& out);
  void fetch(const Request& request);
  void view(const Request& request);
  void stop_force(const Request& request);
  void resume_force(const Request& request);

  Client& client_;
};

}  // namespace fs
