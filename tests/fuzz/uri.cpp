// The addresses that people type: of devices, of servers, of a controller on the network. Nothing is opened but the simulator:
// beside this program there are no modules, and the addresses of other devices are only taken apart.
#include <forceserver/device.h>

#include "base/error.h"
#include "device/fidel/udp/socket.h"
#include "device/support/address.h"
#include "device/support/refusal.h"
#include "fuzz/fuzz.h"
#include "ipc/socket.h"

using fuzz::require;

namespace {

// A path may be the name of any file of this machine, and a pipe or a terminal is no input of a fuzzer.
bool names_a_file(const std::string& text) {
  for (size_t at = text.find("path="); at != std::string::npos; at = text.find("path=", at + 1)) {
    const std::string value = text.substr(at + 5, text.find('&', at) - at - 5);
    if (value != "figure8" && value != "sweep" && value != "touch") return true;
  }
  return false;
}

void open_device(const std::string& uri) {
  if (names_a_file(uri)) return;
  fs_device* device = nullptr;
  const fs_status status = fs_device_open(uri.c_str(), &device);
  if (status != FS_OK) {
    const bool is_expected = status == FS_ERROR_INVALID || status == FS_ERROR_NOT_FOUND || status == FS_ERROR_UNSUPPORTED;
    require(is_expected && *fs_last_error() && std::strlen(fs_last_error()) < 1200, "a refusal:", fs_last_error());
    return;
  }
  fs_state state{};
  fs_wrench push{{1, 0, 0}, {}};
  for (int i = 0; i < 3; ++i) {
    require(fs_device_read(device, &state) == FS_OK, "read:", fs_last_error());
    require(std::isfinite(state.pose.position.x) && std::isfinite(state.twist.linear.x), "a state that is not finite");
    require(fs_device_write(device, &push) == FS_OK, "written:", fs_last_error());
  }
  fs_device_close(device);
}

void take_apart(const std::string& text) {  // as the drivers do
  try {
    const fs::Address address(text, {"library", "home", "rate", "falcon", "host", "port", "grip", "force", "dialect", "firmware",
                                     "motor", "calibration", "render", "hz", "hold"});
    static_cast<void>(address.text("library"));
    static_cast<void>(address.text("grip"));
    if (const auto port = address.whole("port", 1, 65535)) require(*port >= 1 && *port <= 65535, "a port");
    if (const auto force = address.number("force", 0.1, 20)) require(*force >= 0.1 && *force <= 20, "a force");
    if (const auto hold = address.vector("hold", -1, 1)) require(std::fabs((*hold)[2]) <= 1, "a place");
    if (const auto dialect = address.choice("dialect", {"3.4", "3.5"})) require(*dialect < 2, "a choice");
    const fs::udp::HostPort place = fs::udp::parse_host_port(address.place(), "address", 1);
    require(!place.host.empty() && place.port > 0, "a host");
  } catch (const fs::Refusal& refusal) {
    require(refusal.status == FS_ERROR_INVALID && !refusal.text.empty(), "a refusal:", refusal.text.c_str());
  }
}

void find_server(const std::string& text, bool is_server) {
  try {
    const fs::Endpoint place = fs::parse_endpoint(text.c_str(), is_server);
    require(!place.name.empty() && place.name.size() <= 64 && place.name.find('/') == std::string::npos, "a name");
    require(place.timeout <= 1e6 && (!is_server || place.is_own_user), "an option");
  } catch (const fs::Error& error) {
    const bool is_expected = error.status == FS_ERROR_INVALID || error.status == FS_ERROR_UNSUPPORTED;
    require(is_expected && error.text.size() < 600, "a refusal:", error.text.c_str());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), strnlen(reinterpret_cast<const char*>(data), size));
  open_device(text);
  const size_t colon = text.find(':');
  take_apart(colon == std::string::npos ? text : text.substr(colon + 1));
  find_server(text, false);
  find_server(text, true);
  return 0;
}
