#include "device/support/usb.h"

#include <dirent.h>
#include <libusb.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "device/support/refusal.h"
#include "device/support/usb_seen.h"

namespace fs {
namespace {

constexpr double control_within = 1;  // s

// At least 1: 0 would be for ever.
unsigned milliseconds(double time) { return std::max(1u, static_cast<unsigned>(time * 1e3 + 0.5)); }

std::string id_text(uint16_t vendor, uint16_t product) {
  char text[16];
  std::snprintf(text, sizeof text, "%04x:%04x", vendor, product);
  return text;
}

// The first line of a file; "" where there is none.
std::string line_of(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

std::string place_of(libusb_device* device) {
  std::array<uint8_t, 8> ports{};
  const int count = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  const std::string bus = std::to_string(libusb_get_bus_number(device));
  if (count <= 0) return "usb" + bus;  // a root hub
  std::string place = bus + "-";
  for (int i = 0; i < count; ++i) place += (i ? "." : "") + std::to_string(ports[static_cast<size_t>(i)]);
  return place;
}

UsbFound found_at(libusb_device* device) {
  libusb_device_descriptor descriptor{};
  libusb_get_device_descriptor(device, &descriptor);  // kept since the device was found; it cannot fail
  char node[64];
  std::snprintf(node, sizeof node, "/dev/bus/usb/%03u/%03u", libusb_get_bus_number(device), libusb_get_device_address(device));
  UsbFound found{descriptor.idVendor, descriptor.idProduct, place_of(device), node, "", ""};
  // The kernel has read the strings, and lets everybody see them; libusb would have to open the device.
  const std::string folder = "/sys/bus/usb/devices/" + found.place + "/";
  found.serial = line_of(folder + "serial");
  found.text = line_of(folder + "product");
  return found;
}

bool is_of(const UsbKind& kind, const UsbFound& found) {
  return found.vendor == kind.vendor && found.product == kind.product && (!kind.product_text || found.text == kind.product_text);
}

// Ports as numbers: "1-10" comes after "1-9", and "2-1" after "1-1.1".
bool is_before(const UsbFound& a, const UsbFound& b) { return strverscmp(a.place.c_str(), b.place.c_str()) < 0; }

class DeviceList {
 public:
  explicit DeviceList(libusb_context* context) : count_(libusb_get_device_list(context, &list_)) {}
  ~DeviceList() {
    if (list_) libusb_free_device_list(list_, 1);
  }
  DeviceList(const DeviceList&) = delete;
  DeviceList& operator=(const DeviceList&) = delete;
  libusb_device** begin() const { return list_; }
  libusb_device** end() const { return list_ + std::max<ssize_t>(count_, 0); }

 private:
  libusb_device** list_ = nullptr;
  ssize_t count_;
};

std::vector<UsbFound> found_in(libusb_context* context, const UsbKind* kind) {
  std::vector<UsbFound> all;
  for (libusb_device* device : DeviceList(context)) {
    UsbFound found = found_at(device);
    if (!kind || is_of(*kind, found)) all.push_back(std::move(found));
  }
  std::sort(all.begin(), all.end(), is_before);
  return all;
}

std::string all_on_the_bus() {
  constexpr size_t most = 8;
  std::string text;
  size_t count = 0;
  for (const UsbFound& found : usb_devices(nullptr)) {
    if (found.place.rfind("usb", 0) == 0) continue;  // a root hub belongs to the computer
    if (count++ < most)
      text += (text.empty() ? "" : ", ") + id_text(found.vendor, found.product) + (found.text.empty() ? "" : " " + found.text);
  }
  if (count > most) text += ", and " + std::to_string(count - most) + " more";
  if (text.empty() && access("/sys/bus/usb", F_OK) != 0) return "this machine or container has no USB";
  return text.empty() ? "nothing is on the USB" : "on the USB are: " + text;
}

std::string match_of(const UsbKind& kind) {
  char ids[64];
  std::snprintf(ids, sizeof ids, "ATTR{idVendor}==\"%04x\", ATTR{idProduct}==\"%04x\"", kind.vendor, kind.product);
  return ids + (kind.product_text ? std::string(", ATTR{product}==\"") + kind.product_text + "\"" : "");
}

std::string serials_of(const std::vector<UsbFound>& found) {
  std::string text;
  for (const UsbFound& each : found) text += (text.empty() ? "'" : ", '") + each.serial + "'";
  return text;
}

}  // namespace

std::vector<UsbFound> usb_devices(const UsbKind* kind) {
  libusb_context* context = nullptr;
  if (libusb_init(&context) != LIBUSB_SUCCESS) return {};
  const std::unique_ptr<libusb_context, void (*)(libusb_context*)> owner(context, libusb_exit);
  return found_in(context, kind);
}

void usb_entries(const UsbKind& kind, const char* scheme, fs_device_entry* out, size_t capacity, size_t* count) {
  const std::vector<UsbFound> found = usb_devices(&kind);
  *count = found.size();
  for (size_t i = 0; i < std::min(capacity, found.size()); ++i) {
    const UsbFound& each = found[i];
    const bool is_allowed = access(each.node.c_str(), R_OK | W_OK) == 0;
    out[i] = {};
    std::snprintf(out[i].uri, sizeof out[i].uri, "%s%s", scheme,
                  each.serial.empty() ? std::to_string(i).c_str() : each.serial.c_str());
    std::snprintf(out[i].label, sizeof out[i].label, "%s%s%s%s", kind.name, each.serial.empty() ? "" : ", serial number ",
                  each.serial.c_str(), is_allowed ? "" : " (this user may not open it: 60-forceserver.rules)");
  }
}

const UsbFound& usb_choice(const UsbKind& kind, const std::vector<UsbFound>& found, const std::string& which) {
  if (found.empty()) {
    refuse(FS_ERROR_NOT_FOUND, "no %s (%s%s%s) is on the USB; %s", kind.name, id_text(kind.vendor, kind.product).c_str(),
           kind.product_text ? " " : "", kind.product_text ? kind.product_text : "", all_on_the_bus().c_str());
  }
  for (const UsbFound& each : found) {
    if (!each.serial.empty() && each.serial == which) return each;
  }
  size_t index = 0;
  const auto [end, error] = std::from_chars(which.data(), which.data() + which.size(), index);
  if (error != std::errc() || end != which.data() + which.size()) {
    refuse(FS_ERROR_NOT_FOUND, "no %s has the serial number '%s'; on the USB are those with %s", kind.name,
           shortened(which).c_str(), serials_of(found).c_str());
  }
  if (index >= found.size()) {
    refuse(FS_ERROR_NOT_FOUND, "there is no %s %zu; counted from 0, there %s %zu, with the serial number%s %s", kind.name, index,
           found.size() == 1 ? "is" : "are", found.size(), found.size() == 1 ? "" : "s", serials_of(found).c_str());
  }
  return found[index];
}

std::string programs_that_use(const std::string& file, int own) {
  std::string programs;
  char real[PATH_MAX];
  const std::string wanted = realpath(file.c_str(), real) ? real : file;
  DIR* const processes = opendir("/proc");
  if (!processes) return "";
  while (const dirent* process = readdir(processes)) {
    const std::string folder = std::string("/proc/") + process->d_name;
    if (process->d_name[0] < '0' || process->d_name[0] > '9') continue;
    DIR* const files = opendir((folder + "/fd").c_str());  // null: of another user
    const bool is_this = std::atoi(process->d_name) == getpid();
    int uses = is_this ? -own : 0;
    while (const dirent* each = files ? readdir(files) : nullptr) {
      char target[PATH_MAX];
      const ssize_t length = readlink((folder + "/fd/" + each->d_name).c_str(), target, sizeof target);
      uses += length > 0 && std::string(target, static_cast<size_t>(length)) == wanted;
    }
    if (files) closedir(files);
    if (uses <= 0) continue;
    programs += (programs.empty() ? "" : ", ") + (is_this ? "this program" : line_of(folder + "/comm")) + " (pid " +
                process->d_name + ")";
  }
  closedir(processes);
  return programs;
}

UsbDevice::UsbDevice(const UsbKind& kind, const std::string& which, int interface) : kind_(kind), interface_(interface) {
  if (const int error = libusb_init(&context_); error != LIBUSB_SUCCESS) {
    context_ = nullptr;
    refuse(FS_ERROR_NOT_FOUND, "no %s can be found: %s (libusb: %s)", kind.name,
           access("/dev/bus/usb", F_OK) == 0 ? "the USB of this machine cannot be used"
                                             : "this machine or container has no USB, as /dev/bus/usb is not there",
           libusb_error_name(error));
  }
  try {
    found_ = usb_choice(kind, found_in(context_, &kind), which);
    open();
    claim();
  } catch (...) {
    release();
    throw;
  }
}

UsbDevice::~UsbDevice() { release(); }

void UsbDevice::release() noexcept {
  if (is_abandoned_) return;
  if (is_claimed_) libusb_release_interface(handle_, interface_);
  if (handle_) libusb_close(handle_);
  if (context_) libusb_exit(context_);
}

void UsbDevice::open() {
  int error = LIBUSB_ERROR_NO_DEVICE;
  for (libusb_device* device : DeviceList(context_)) {
    if (found_at(device).node == found_.node) error = libusb_open(device, &handle_);
  }
  if (error == LIBUSB_SUCCESS) return;
  handle_ = nullptr;
  if (error != LIBUSB_ERROR_ACCESS) fail(error, "opening it");
  refuse(FS_ERROR_DENIED, "%s '%s' is there, but this user may not open %s: %s", kind_.name, found_.serial.c_str(),
         found_.node.c_str(), usb_rule_advice(match_of(kind_)).c_str());
}

void UsbDevice::claim() {
  libusb_set_auto_detach_kernel_driver(handle_, 1);  // such as ftdi_sio
  const int error = libusb_claim_interface(handle_, interface_);
  is_claimed_ = error == LIBUSB_SUCCESS;
  if (is_claimed_) return;
  if (error != LIBUSB_ERROR_BUSY) fail(error, "claiming its interface");
  const std::string users = programs_that_use(found_.node, 1);
  refuse(FS_ERROR_IO, "%s '%s' is in use: %s has %s open. End that program, or close the device there", kind_.name,
         found_.serial.c_str(), users.empty() ? "a program that this user cannot see" : users.c_str(), found_.node.c_str());
}

void UsbDevice::fail(int error, const char* what) const {
  const std::string device = std::string(kind_.name) + " '" + found_.serial + "' on " + found_.node;
  switch (error) {
    case LIBUSB_ERROR_NO_DEVICE: refuse(FS_ERROR_DISCONNECTED, "%s was unplugged (while %s)", device.c_str(), what);
    case LIBUSB_ERROR_TIMEOUT: refuse(FS_ERROR_TIMEOUT, "%s does not answer (while %s)", device.c_str(), what);
    case LIBUSB_ERROR_PIPE: refuse(FS_ERROR_IO, "%s refuses the request (while %s: stall)", device.c_str(), what);
    case LIBUSB_ERROR_NO_MEM: refuse(FS_ERROR_MEMORY, "no memory for %s (while %s)", device.c_str(), what);
    default: refuse(FS_ERROR_IO, "%s has failed (while %s: %s)", device.c_str(), what, libusb_error_name(error));
  }
}

void UsbDevice::control(uint8_t type, uint8_t request, uint16_t value, uint16_t index) {
  const int count = libusb_control_transfer(handle_, type, request, value, index, nullptr, 0, milliseconds(control_within));
  if (count < 0) fail(count, "setting it up");
}

std::vector<uint8_t> UsbDevice::control_answer(uint8_t type, uint8_t request, uint16_t value, uint16_t index, size_t size) {
  std::vector<uint8_t> answer(size);
  const int count = libusb_control_transfer(handle_, static_cast<uint8_t>(type | LIBUSB_ENDPOINT_IN), request, value, index,
                                            answer.data(), static_cast<uint16_t>(size), milliseconds(control_within));
  if (count < 0) fail(count, "asking it");
  answer.resize(static_cast<size_t>(count));
  return answer;
}

void UsbDevice::write(uint8_t endpoint, std::span<const uint8_t> data, double within) {
  std::vector<uint8_t> copy(data.begin(), data.end());
  int count = 0;
  const int error =
      libusb_bulk_transfer(handle_, endpoint, copy.data(), static_cast<int>(copy.size()), &count, milliseconds(within));
  if (error != LIBUSB_SUCCESS) fail(error, "writing to it");
  if (static_cast<size_t>(count) != copy.size()) {
    refuse(FS_ERROR_IO, "%s '%s' took %d of %zu bytes", kind_.name, found_.serial.c_str(), count, copy.size());
  }
}

std::vector<uint8_t> UsbDevice::read(uint8_t endpoint, size_t size, double within) {
  std::vector<uint8_t> data(size);
  int count = 0;
  const int error = libusb_bulk_transfer(handle_, endpoint, data.data(), static_cast<int>(size), &count, milliseconds(within));
  if (error != LIBUSB_SUCCESS && error != LIBUSB_ERROR_TIMEOUT) fail(error, "reading from it");
  data.resize(static_cast<size_t>(std::max(count, 0)));
  return data;
}

}  // namespace fs
