// A connection to the Haply Inverse Service: a WebSocket whose operations wait no longer than they are told. One thread uses it
// at a time.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include <forceserver/base.h>

namespace fs::haply {

// The answer to GET /version; "": the service does not tell. Throws a Refusal (NOT_FOUND) where nothing answers at all.
std::string version_answer(const std::string& host, const std::string& port);

class Service {
 public:
  Service(const std::string& host, const std::string& port);  // throws a Refusal
  ~Service();

  // Sends a message. within: s. TIMEOUT: the service takes nothing at present; what was begun still goes. DISCONNECTED.
  fs_status send(std::string_view text, double within);

  // The next message, which text is until the next call. TIMEOUT: none has come; DISCONNECTED.
  fs_status receive(double within, std::string_view& text);

  std::string trouble() const;  // why it is disconnected

 private:
  struct Connection;
  std::unique_ptr<Connection> connection_;
};

}  // namespace fs::haply
