// The driver falcon through the public C ABI, with the real libusb, on an emulated bus.
#include <cmath>

#include "device/usb/falcon_rig.h"

using namespace scenes;

// A way of the handle in the device frame: the Falcon's z points to who sits before it, its y up.
static fs_vec3 to_device(fs_vec3 v) { return {v.x, -(v.z - 0.125), v.y}; }

START_TEST(positions_come_and_forces_go) {
  FalconRig rig;
  rig.change([](FalconModel& model) {
    model.target = {0.01, -0.015, 0.135};
    model.odd_buttons = 5;
  });
  const Device device = open_device("falcon:0");
  fs_device_info info = fs_device_info_init();
  OK(fs_device_get_info(device.get(), &info));
  ck_assert_str_eq(info.serial, "A1");
  ck_assert_str_eq(info.name, "Novint Falcon");
  std::printf("  force_max %g N, resolution %g m\n", info.force_max, info.resolution);
  ck_assert(until([&] { return is_ready(device.get()); }));
  ck_assert(until([&] {
    const fs_vec3 exact = to_device(rig.see([](FalconModel& model) { return model.position(); }));
    return norm(state_of(device.get()).pose.position - exact) < 2e-4;
  }));
  ck_assert_uint_eq(state_of(device.get()).buttons, 5);

  // A force of 1 N in each direction is felt as such, in spite of the driver's Jacobian and the model's own.
  for (const fs_vec3 wanted : {fs_vec3{1, 0, 0}, fs_vec3{0, 1, 0}, fs_vec3{0, 0, 1}, fs_vec3{-0.5, 0.6, -0.4}}) {
    fs_wrench wrench{};
    wrench.force = wanted;
    OK(fs_device_write(device.get(), &wrench));
    const fs_vec3 in_falcon{wanted.x, wanted.z, -wanted.y};
    ck_assert(until([&] { return norm(rig.see([](FalconModel& model) { return model.force(); }) - in_falcon) < 0.01; }));
  }
}
END_TEST

int main() {
  require(fs_driver_load(FALCON_MODULE), "fs_driver_load");
  Suite* suite = suite_create("usb_falcon");
  add_case(suite, "falcon", {positions_come_and_forces_go});
  return run_suite(suite);
}
