// A hand that pushes a handle against a wall, under a servo: does the wall stand still, or does it shake?
#pragma once

#include "api/support.h"
#include "device/makers/handle.h"
#include "stability/measure.h"

namespace makers {

// The largest way to and fro (m) of the handle within the last second of three, in which a hand pushes it up by 1 mm against a floor
// of this stiffness (N/m) under the origin. is_bounded: the servo lowers the slope to what its loop can render, and damps.
inline double swing_at_wall(fs_device* device, Handle& handle, double stiffness, bool is_bounded, double* granted = nullptr) {
  using namespace scenes;
  const Scene scene = make_scene();
  fs_object wall = fs_object_init("wall", FS_PRIMITIVE_PLANE);
  wall.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, stiffness, 0, 10);
  require(fs_object_set(scene.get(), &wall), "fs_object_set");
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_THREAD;
  if (!is_bounded) options.max_stiffness = options.damping = options.speed_limit = options.slew_limit = -1;
  const Servo servo = start_servo(scene.get(), device, options);
  handle.with_plant([](stability::Plant& plant) {
    plant.put({0, 0, 0.004});
    plant.target = {0, 0, -0.02};
  });
  std::this_thread::sleep_for(std::chrono::seconds(2));
  stability::Swing swing;
  for (int i = 0; i < 500; ++i) {
    swing.add(handle.position());
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  if (granted) *granted = stats_of(scene.get()).max_stiffness;
  return swing.length();
}

}  // namespace makers
