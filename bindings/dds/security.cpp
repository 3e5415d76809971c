#include "security.h"

#include <stdexcept>

namespace bridge {

void secure(dds_qos_t&, const std::string&) { throw std::runtime_error("not yet"); }

}  // namespace bridge
