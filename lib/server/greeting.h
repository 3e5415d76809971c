// The first message of a client and the answer to it. They say who the client is, and whether both ends have the same wire;
// then the client gets its memory, its scene and a channel of the servo.
#pragma once

#include <span>

#include "server/client.h"

namespace fs {

// Answers a client's first message. refusal: FS_OK, or why it is not let in, whoever it is. False: it is not let in.
bool greet(Client& client, std::span<const std::byte> message, fs_status refusal);

}  // namespace fs
