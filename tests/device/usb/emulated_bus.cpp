#include "device/usb/emulated_bus.h"

#include <fcntl.h>
#include <libusb.h>
#include <umockdev-1.0/umockdev.h>

#include <cerrno>
#include <cstdio>

#include "device/usb/usbfs.h"

namespace scenes {
namespace {

std::string hex(const std::vector<uint8_t>& bytes) {
  std::string text;
  char digits[3];
  for (const uint8_t byte : bytes) {
    std::snprintf(digits, sizeof digits, "%02X", byte);
    text += digits;
  }
  return text;
}

std::string numbered(const char* format, int number) {
  char text[64];
  std::snprintf(text, sizeof text, format, number);
  return text;
}

void add(UMockdevTestbed* testbed, const std::string& text) {
  GError* error = nullptr;
  if (umockdev_testbed_add_from_string(testbed, text.c_str(), &error)) return;
  std::fprintf(stderr, "umockdev: %s\n", error->message);
  std::abort();
}

// What the kernel tells of a device in sysfs. path: below /sys.
std::string described(const std::string& path, int number, UsbModel* model) {
  const std::vector<uint8_t> device = model ? model->device_descriptor() : std::vector<uint8_t>{};
  const auto attribute = [](const char* name, const std::string& value) {
    return value.empty() ? "" : std::string("A: ") + name + "=" + value + "\\n\n";
  };
  std::string text = "P: " + path + "\nN: bus/usb/001/" + numbered("%03d", number) + "\nE: DEVNAME=/dev/bus/usb/001/" +
                     numbered("%03d", number) + "\nE: DEVTYPE=usb_device\nE: SUBSYSTEM=usb\nE: BUSNUM=001\nE: DEVNUM=" +
                     numbered("%03d", number) + "\n" + attribute("busnum", "1") + attribute("devnum", numbered("%d", number)) +
                     attribute("bConfigurationValue", "1") + attribute("speed", model ? "12" : "480");
  if (model) {
    std::vector<uint8_t> all = device;
    const std::vector<uint8_t> configuration = model->configuration_descriptor();
    all.insert(all.end(), configuration.begin(), configuration.end());
    text += attribute("idVendor", numbered("%04x", device[8] | device[9] << 8)) +
            attribute("idProduct", numbered("%04x", device[10] | device[11] << 8)) +
            attribute("product", model->string(device[15])) + attribute("serial", model->string(device[16])) + "H: descriptors=" +
            hex(all) + "\n";
  } else {  // the root hub
    text += "A: idVendor=1d6b\\n\nA: idProduct=0002\\n\nA: product=A root hub\\n\nH: descriptors="
            "12010002090001406B1D020001060302010109021900010100E0000904000001090000000705810304000C\n";
  }
  return text + "\n";
}

}  // namespace

EmulatedBus::EmulatedBus() : usbfs_(std::make_unique<Usbfs>()) {
  usbfs_->testbed = umockdev_testbed_new();
  add(usbfs_->testbed, described("/devices/usb1", 1, nullptr));
  usbfs_->start();
  libusb_init(&context_);
}

EmulatedBus::~EmulatedBus() {
  if (context_) libusb_exit(context_);
  usbfs_->end();
  g_object_unref(usbfs_->testbed);
}

void EmulatedBus::plug(int socket, std::shared_ptr<UsbModel> model) {
  usbfs_->forget_taken_out();
  const std::lock_guard lock(usbfs_->testbed_mutex);
  const int number = usbfs_->next_number();
  UsbModel* const described_model = model.get();
  usbfs_->put(socket, number, std::move(model));
  add(usbfs_->testbed, described("/devices/usb1/1-" + std::to_string(socket), number, described_model));
}

void EmulatedBus::unplug(int socket, Unplug how) {
  usbfs_->take_out(socket, how);
  usbfs_->forget_taken_out();
}

void EmulatedBus::unplug_at(int socket, UsbMoment moment, uint64_t count, Unplug how) {
  usbfs_->take_out_at(socket, moment, count, how);
}

bool EmulatedBus::is_plugged(int socket) const { return usbfs_->is_plugged(socket); }
void EmulatedBus::set(int socket, const UsbFaults& faults) { usbfs_->set(socket, faults); }
UsbCounts EmulatedBus::counts(int socket) const { return usbfs_->counts(socket); }
std::string EmulatedBus::node(int socket) const { return usbfs_->node(socket); }

void EmulatedBus::with_models(const std::function<void()>& look) const {
  const std::lock_guard lock(usbfs_->mutex);
  look();
}

}  // namespace scenes
