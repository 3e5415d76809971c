// The files that devices read: the calibration of a FIDEL, and the path of a simulated hand. The first byte says which.
#include "base/error.h"
#include "device/fidel/usb/calibration.h"
#include "device/sim/options.h"
#include "device/support/refusal.h"
#include "fuzz/fuzz.h"

using fuzz::require;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  namespace usb = fs::fidel_usb;
  static const fuzz::MemoryFile& file = *new fuzz::MemoryFile;
  fuzz::Input input(data, size);
  const bool is_path = input.coin();
  file.put(input.text_to_end());
  try {
    if (is_path) {
      fs::HandPath path = fs::parse_sim_options(("path=" + file.name()).insert(0, "?").c_str()).path;
      for (const double time : {-1.0, 0.0, 0.5, 1e3, 1e300}) {
        const auto target = path.at(time);
        require(fs::norm(target.position) < 2, "a target beyond an arm's length");
      }
    } else if (const auto calibration = usb::read_calibration(file.name(), "F1")) {
      for (const double offset : calibration->offsets) require(std::fabs(offset) <= usb::offset_max, "an offset");
      require(calibration->scale >= usb::scale_min && calibration->scale <= usb::scale_max, "a scale");
    }
  } catch (const fs::Refusal& refusal) {
    const bool is_expected = refusal.status == FS_ERROR_INVALID || refusal.status == FS_ERROR_PARSE;
    require(is_expected && refusal.text.find(file.name()) != std::string::npos, "a refusal:", refusal.text.c_str());
    require(refusal.text.size() < 1000, "a long sentence:", refusal.text.c_str());
  }
  return 0;
}
