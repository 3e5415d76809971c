// From a report of a Falcon to the command that answers it, at the (emulated) bus: by a servo with the driver falcon, and by the
// shortest loop of libusb that does nothing in between. bench_usb [ROUNDS]
//
// The Falcon is a model; the real libusb talks to it through functions that stand before those of the C library. So this measures
// the software on the way, not the wires.
#include <libusb.h>

#include <cstdlib>

#include <forceserver/driver.h>

#include "device/falcon/packet.h"
#include "device/usb/emulated_bus.h"
#include "device/usb/falcon_model.h"
#include "turnarounds.h"

using namespace scenes;

namespace {

// A loop that sends a command, waits for the report, and so on.
template <class Set>
void run_bare(bench::Turnarounds& out, Set set) {
  libusb_context* context = nullptr;
  libusb_init(&context);
  libusb_device_handle* const handle = libusb_open_device_with_vid_pid(context, 0x0403, 0xcb48);
  libusb_claim_interface(handle, 0);
  libusb_control_transfer(handle, 0x40, 9, 1, 0, nullptr, 0, 100);  // latency
  libusb_control_transfer(handle, 0x40, 3, 2, 0, nullptr, 0, 100);  // baud
  fs::falcon::Packet packet = fs::falcon::packet_of({{1, 1, 1}, 0});
  uint8_t answer[64];
  bench::run_plain(out, set, [&] {
    int count = 0;
    libusb_bulk_transfer(handle, 0x02, packet.data(), static_cast<int>(packet.size()), &count, 20);
    do count = 0;
    while (libusb_bulk_transfer(handle, 0x81, answer, sizeof answer, &count, 20) == 0 && count <= 2);
  });
  libusb_release_interface(handle, 0);
  libusb_close(handle);
  libusb_exit(context);
}

}  // namespace

int main(int count, char** arguments) {
  const int rounds = count > 1 ? std::atoi(arguments[1]) : 5;
  require(fs_driver_load(FALCON_MODULE), "fs_driver_load");
  EmulatedBus bus;
  const auto falcon = std::make_shared<FalconModel>("A1");
  falcon->has_firmware = true;
  bus.plug(1, falcon);
  bench::Turnarounds servo("servo and driver"), bare("a bare loop of libusb");
  const auto set = [&](std::vector<double>* times) { bus.with_models([&] { falcon->turnarounds = times; }); };
  for (int i = 0; i < rounds; ++i) {
    bench::run_servo(open_device("falcon:0").get(), servo, set);
    run_bare(bare, set);
  }
  servo.print();
  bare.print();
}
