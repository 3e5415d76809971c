// From a report of a Falcon to the command that answers it, at the (emulated) bus: by a servo with the driver falcon, and by the
// shortest loop of libusb that does nothing in between. Both take turns in the same run. bench_usb [ROUNDS]
//
// The Falcon is a model; the real libusb talks to it through functions that stand before those of the C library. So this measures
// the software on the way, not the wires.
#include <libusb.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

#include <forceserver/driver.h>

#include "device/falcon/packet.h"
#include "device/usb/emulated_bus.h"
#include "device/usb/falcon_model.h"
#include "scenes/scenes.h"

using namespace scenes;

namespace {

constexpr auto duration = std::chrono::seconds(3);  // of a round
constexpr auto beginning = std::chrono::milliseconds(300);

// measure(true) begins to measure, measure(false) ends it.
template <class Measure>
void with_servo(Measure measure) {
  const Device device = open_device("falcon:0");
  const Scene scene = make_scene();
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 100, 0, 3);
  require(fs_object_set(scene.get(), &spring), "fs_object_set");
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_THREAD;
  const Servo servo = start_servo(scene.get(), device.get(), options);
  std::this_thread::sleep_for(beginning);
  measure(true);
  std::this_thread::sleep_for(duration);
  measure(false);
}

// A thread that sends a command, waits for the report, and so on.
template <class Measure>
void bare(Measure measure) {
  libusb_context* context = nullptr;
  libusb_init(&context);
  libusb_device_handle* const handle = libusb_open_device_with_vid_pid(context, 0x0403, 0xcb48);
  libusb_claim_interface(handle, 0);
  libusb_control_transfer(handle, 0x40, 9, 1, 0, nullptr, 0, 100);  // latency
  libusb_control_transfer(handle, 0x40, 3, 2, 0, nullptr, 0, 100);  // baud
  std::thread([&] {
    fs::falcon::Packet packet = fs::falcon::packet_of({{1, 1, 1}, 0});
    uint8_t answer[64];
    const auto begin = std::chrono::steady_clock::now();
    bool measures = false;
    for (auto now = begin; now < begin + beginning + duration; now = std::chrono::steady_clock::now()) {
      if (!measures && now > begin + beginning) measure(measures = true);
      int count = 0;
      libusb_bulk_transfer(handle, 0x02, packet.data(), static_cast<int>(packet.size()), &count, 20);
      do count = 0;
      while (libusb_bulk_transfer(handle, 0x81, answer, sizeof answer, &count, 20) == 0 && count <= 2);
    }
    measure(false);
  }).join();
  libusb_release_interface(handle, 0);
  libusb_close(handle);
  libusb_exit(context);
}

void print(const char* name, std::vector<double>& times, double seconds) {
  std::sort(times.begin(), times.end());
  const auto at = [&](double part) { return 1e6 * times[static_cast<size_t>(part * static_cast<double>(times.size() - 1))]; };
  std::printf("%-24s %6.0f round trips a second, p50 %6.1f us, p99 %6.1f us, p99.9 %6.1f us\n", name,
              static_cast<double>(times.size()) / seconds, at(0.5), at(0.99), at(0.999));
}

}  // namespace

int main(int count, char** arguments) {
  const int rounds = count > 1 ? std::atoi(arguments[1]) : 5;
  require(fs_driver_load(FALCON_MODULE), "fs_driver_load");
  EmulatedBus bus;
  const auto falcon = std::make_shared<FalconModel>("A1");
  falcon->has_firmware = true;
  bus.plug(1, falcon);
  std::vector<double> servo_times, bare_times;
  for (int i = 0; i < rounds; ++i) {
    with_servo([&](bool measures) { bus.with_models([&] { falcon->turnarounds = measures ? &servo_times : nullptr; }); });
    bare([&](bool measures) { bus.with_models([&] { falcon->turnarounds = measures ? &bare_times : nullptr; }); });
  }
  const double seconds = std::chrono::duration<double>(duration).count() * rounds;
  print("servo and driver", servo_times, seconds);
  print("a bare loop of libusb", bare_times, seconds);
}
