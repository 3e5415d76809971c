// When the library is loaded, registers its drivers and announces the schemes of planned ones. Nothing in lib/ depends
// on this file.
#include "device/sim/sim.h"
#include "driver/registry.h"

namespace {

[[maybe_unused]] const bool registered = [] {
  try {
    fs::register_driver(fs::sim_driver());
    for (const char* planned : {"falcon", "fidel"}) fs::announce_scheme(planned);
    return true;
  } catch (...) {  // out of memory: opening "sim:" will say that there is no such driver
    return false;
  }
}();

}  // namespace
