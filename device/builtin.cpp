// When the library is loaded, registers its drivers. Nothing in lib/ depends on this file.
#include "device/sim/sim.h"
#include "driver/registry.h"

namespace {

[[maybe_unused]] const bool registered = [] {
  try {
    fs::register_driver(fs::sim_driver());
    return true;
  } catch (...) {  // out of memory: opening "sim:" will say that there is no such driver
    return false;
  }
}();

}  // namespace
