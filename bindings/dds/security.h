// DDS Security: only who has the keys of the room takes part, and what goes over the network is encrypted.
#pragma once

#include <string>

#include <dds/dds.h>

namespace bridge {

// Has a participant of this qos use the six files of a folder that make-keys has made. Throws std::runtime_error, with what is missing.
void secure(dds_qos_t& qos, const std::string& folder);

}  // namespace bridge
