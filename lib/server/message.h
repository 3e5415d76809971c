// A message of a client, copied from its socket: nobody can change it any more.
#pragma once

#include <memory>
#include <span>

#include "ipc/socket.h"
#include "server/client.h"
#include "transfer/sizes.h"
#include "transfer/wire.h"

namespace fs {

struct Message {
  wire::Type type;
  uint64_t serial;
  std::shared_ptr<std::byte[]> memory;
  std::span<const std::byte> record;  // in memory, of the type's size
  Descriptor data;                    // may be none
};

// buffer: for one message. last_serial: of the one before. sizes: common with the client. May throw BadClient.
Transfer receive(const Descriptor& socket, std::span<std::byte> buffer, uint64_t last_serial, const RecordSizes& sizes,
                 Message& out);

// The batch that a message is: of one change; and of a group, which is taken apart step by step. Both throw BadClient.
ReceivedBatch batch_of(const Client& client, const Message& message);
Task take_apart(Client& client, Message& message, ReceivedBatch& out);

}  // namespace fs
