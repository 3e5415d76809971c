// The answers to what a client asks, on its socket. A client that does not read its answers is given up: they are not kept
// for it.
#pragma once

#include <span>
#include <string>

#include "ipc/blob.h"
#include "ipc/socket.h"
#include "transfer/wire.h"

namespace fs {

// Thrown where a client breaks the rules of the wire, or cannot be talked to: its session drops it.
struct BadClient {};

class Answers {
 public:
  explicit Answers(const Descriptor& socket) : socket_(socket) {}  // without one nothing is sent

  // May throw BadClient.
  void send(uint64_t serial, std::span<const std::byte> body = {}, int descriptor = -1) const;
  template <class Record>
  void send_record(uint64_t serial, const Record& record, int descriptor = -1) const {
    send(serial, bytes_of(&record, 1), descriptor);
  }
  void refuse(uint64_t serial, fs_status status, const std::string& text) const;

 private:
  void send(uint64_t serial, fs_status status, const std::string& text, std::span<const std::byte> body,
            int descriptor) const;

  const Descriptor& socket_;
};

}  // namespace fs
