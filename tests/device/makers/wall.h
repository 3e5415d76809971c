// A hand that pushes a handle against a wall, under a servo: does the wall stand still, or does it shake?
#pragma once

#include <cmath>
#include <cstdio>

#include "api/support.h"
#include "device/makers/handle.h"
#include "stability/boundary.h"
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

// A wall of the stiffness that the servo grants stands, and one of twice the critical stiffness shakes, which the exact boundary of the
// sampled loop gives for the model, a light hand and this delay (s).
inline void expect_wall_stands_and_shakes(fs_device* device, Handle& handle, const stability::DeviceModel& model, double delay) {
  double granted = 0, stands = 1;
  for (int i = 0; i < 8 && stands > 0.2e-3; ++i) {  // a busy machine makes states late
    stands = std::fmin(stands, swing_at_wall(device, handle, 1e5, true, &granted));
  }
  const stability::HandModel& hand = stability::light;
  const double critical =
      stability::critical_stiffness({model.mass + hand.mass, model.damping + hand.damping, hand.stiffness, 1 / model.rate, delay});
  const double shakes = swing_at_wall(device, handle, 2 * critical, false);
  std::printf("  granted %.0f N/m: %.3f mm; %.0f N/m without bounds: %.3f mm\n", granted, 1e3 * stands, 2 * critical, 1e3 * shakes);
  ck_assert_msg(stands < 0.2e-3, "%g m", stands);
  ck_assert_msg(shakes > 0.4e-3, "%g m", shakes);
}

}  // namespace makers
