// Sends the answers to a client's requests on its socket. Answers are not queued: a client that does not read them, so that
// the socket is full, is dropped; but an answer with a descriptor is refused then (FULL).
#pragma once

#include <span>
#include <string>

#include "ipc/blob.h"
#include "ipc/socket.h"
#include "transfer/sizes.h"

namespace fs {

// Thrown when a client breaks the rules of the wire, or takes no more answers: its session drops it.
struct BadClient {};

class Answers {
 public:
  // While the socket is closed, nothing is sent. sizes: common with the client.
  Answers(const Descriptor& socket, const RecordSizes& sizes) : socket_(socket), sizes_(sizes) {}

  // May throw BadClient.
  void send(uint64_t serial, std::span<const std::byte> body = {}, int descriptor = -1) const;
  template <class Record>
  void send_record(uint64_t serial, const Record& record, int descriptor = -1) const {
    send(serial, sent_part(record, sizes_), descriptor);
  }
  void refuse(uint64_t serial, fs_status status, const std::string& text, wire::ReplyReason reason = wire::reason_none) const;

 private:
  void send(uint64_t serial, const wire::Reply& reply, std::span<const std::byte> body, int descriptor) const;

  const Descriptor& socket_;
  const RecordSizes& sizes_;
};

}  // namespace fs
