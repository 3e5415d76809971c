#include "device/dhd/session.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <set>

#include "device/support/clock.h"
#include "device/support/refusal.h"
#include "device/support/usb_seen.h"

namespace fs::dhd {
namespace {

constexpr uint16_t usb_vendor = 0x1451;
constexpr int most_devices = 32;
constexpr double opens_within = 2;  // s, when the SDK is about to open or close another device

std::mutex mutex;             // while the SDK opens or closes a device
std::set<char>& open_ids() {  // those that this process has; never destroyed, as devices may be closed when the process ends
  static auto* const ids = new std::set<char>;
  return *ids;
}

int count_devices(const Api& api) { return std::clamp(api.dhdGetDeviceCount(), 0, most_devices); }

// Why the SDK finds no device.
[[noreturn]] void refuse_none(const Api& api) {
  const std::vector<UsbSeen> seen = usb_seen(usb_vendor);
  if (seen.empty()) {
    refuse(FS_ERROR_NOT_FOUND, "the Force Dimension SDK %s finds no device, and none is on the USB (vendor %04x)",
           api.version.c_str(), usb_vendor);
  }
  const UsbSeen& first = seen.front();
  if (!first.may_open) {
    refuse(FS_ERROR_DENIED, "%s may not be opened by this user: %s", first.node.c_str(),
           usb_rule_advice("ATTR{idVendor}==\"1451\"").c_str());
  }
  refuse(FS_ERROR_NOT_FOUND, "the Force Dimension SDK %s finds no device, although one is on the USB at %s: has it power?",
         api.version.c_str(), first.node.c_str());
}

// The place as an index; -1: it is none that the SDK counts.
int index_of(const std::string& place, int count) {
  int index = -1;
  const auto [end, error] = std::from_chars(place.data(), place.data() + place.size(), index);
  return error == std::errc() && end == place.data() + place.size() && index < count ? index : -1;
}

}  // namespace

Session::Session(const Api& api, const std::string& place, bool takes_falcon) : api_(api) {
  std::unique_lock lock(mutex, std::defer_lock);
  for (const double latest = steady_now() + opens_within; !lock.try_lock(); pause(1e-3)) {
    if (steady_now() > latest) {
      refuse(FS_ERROR_TIMEOUT, "the Force Dimension SDK has been opening or closing another device for more than %g s",
             opens_within);
    }
  }
  const int count = count_devices(api);
  if (count == 0) refuse_none(api);
  std::string seen, busy;  // serial numbers of those that are free, and why others are not, for the refusal
  const int index = index_of(place, count);
  for (int i = index < 0 ? 0 : index; i < (index < 0 ? count : index + 1); ++i) {
    if (!open(i, busy)) continue;
    const bool is_meant = index >= 0 || serial_ == place;
    if (is_meant && type_ == falcon_type && !takes_falcon) {
      close();
      refuse(FS_ERROR_UNSUPPORTED, "dhd:%s is a Novint Falcon: open it as falcon:0, or add the option falcon=yes", place.c_str());
    }
    if (is_meant) {
      open_ids().insert(id_);
      return;
    }
    seen += (seen.empty() ? "" : ", ") + serial_;
    close();
  }
  if (!busy.empty()) {
    refuse(FS_ERROR_IO, "device '%s' of Force Dimension cannot be opened; free are: %s; others are in use: %s", place.c_str(),
           seen.empty() ? "none" : seen.c_str(), busy.c_str());
  }
  refuse(FS_ERROR_NOT_FOUND, "there is no device '%s' of Force Dimension; there %s, with the serial numbers: %s", place.c_str(),
         count == 1 ? "is one" : ("are " + std::to_string(count)).c_str(), seen.c_str());
}

// The device of this index; false, and why not: it is in use. Of one that this process has open already the SDK gives the ID that it
// has.
bool Session::open(int index, std::string& busy) {
  const int id = api_.drdOpenID(static_cast<char>(index));
  if (id < 0) return busy = "perhaps by another program (" + api_.last_error() + ")", false;
  if (open_ids().count(static_cast<char>(id)) > 0) return busy = "by this program", false;
  id_ = static_cast<char>(id);
  unsigned short serial = 0;
  const bool has_serial = api_.dhdGetSerialNumber(&serial, id_) >= 0;
  serial_ = has_serial ? std::to_string(serial) : "";
  type_ = api_.dhdGetSystemType(id_);
  return true;
}

void Session::close() noexcept { api_.drdClose(id_); }

Session::~Session() {
  const std::lock_guard lock(mutex);
  close();
  open_ids().erase(id_);
}

void list_arms(fs_device_entry* out, size_t capacity, size_t* count) {
  const Api& api = load_api({});
  *count = static_cast<size_t>(count_devices(api));
  for (size_t i = 0; i < std::min(capacity, *count); ++i) {
    std::snprintf(out[i].uri, sizeof out[i].uri, "dhd:%zu", i);
    std::snprintf(out[i].label, sizeof out[i].label, "device %zu of Force Dimension", i);
  }
}

}  // namespace fs::dhd
