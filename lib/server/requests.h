// Answers the requests of a client. A single change of another client's object is a request, too; it waits while a shape
// that it brings is being built, or while a parked batch of the client is about the same object.
#pragma once

#include <memory>
#include <vector>

#include "server/client.h"

namespace fs {

// A request as it came.
struct Request {
  uint64_t serial;
  Change content;                      // its type and record
  std::shared_ptr<const void> memory;  // that the record lies in
  template <class Record>
  const Record& as() const { return content.as<Record>(); }
};

class Requests {
 public:
  explicit Requests(Client& client) : client_(client) {}

  void handle(const Request& request);
  void retry();  // handles again those that wait
  bool are_waiting() const noexcept { return !waiting_.empty(); }

 private:
  void answer(const Request& request);
  bool must_wait(const Change& edit) const;
  void edit(const Request& request);
  void get(const Request& request);
  void report(const Request& request);
  void pull(const Request& request);
  void tell_object(const std::string& name, wire::Pulled& out);
  void fetch(const Request& request);
  void view(const Request& request);

  Client& client_;
  std::vector<Request> waiting_;
};

}  // namespace fs
