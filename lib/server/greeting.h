// Answers the first message of a client. It says who the client is, which version of the wire it speaks
// and how much it knows of the records that grow; a client that is let
// in gets its shared memory, its scene, and a channel of the servo.
#pragma once

#include <span>

#include "server/client.h"

namespace fs {

// refusal: FS_OK, or why the client is refused anyway. False: it is not let in, and has to be dropped.
bool greet(Client& client, std::span<const std::byte> message, fs_status refusal);

}  // namespace fs
