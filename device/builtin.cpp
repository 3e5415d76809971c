// Hands the drivers of this library to the registry when it is loaded, and the schemes of those that are planned. lib/ does
// not know what stands here.
#include "device/sim/sim.h"
#include "driver/registry.h"

namespace {

[[maybe_unused]] const bool registered = [] {
  try {
    fs::register_driver(fs::sim_driver());
    for (const char* planned : {"falcon", "fidel"}) fs::announce_scheme(planned);
    return true;
  } catch (...) {  // no memory: then opening "sim:" says that there is no such driver
    return false;
  }
}();

}  // namespace
