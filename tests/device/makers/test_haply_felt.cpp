// What a hand feels at a wall through the driver haply.
#include <cmath>
#include <cstdio>

#include "device/makers/haply_rig.h"
#include "device/makers/wall.h"
#include "stability/boundary.h"

using namespace scenes;

START_TEST(a_wall_stands_and_shakes) {
  HaplyService service;
  HaplyDevice& arm = *service.devices.front();
  stability::DeviceModel model;
  model.friction = 0.05, model.force_max = 5;
  arm.handle.become(model, stability::light);
  const Device device = opened(service);
  ck_assert(until([&] { return is_ready(device); }));
  double granted = 0, stands = 1;
  for (int i = 0; i < 8 && stands > 0.2e-3; ++i) {  // a busy machine makes states late
    stands = std::fmin(stands, makers::swing_at_wall(device.get(), arm.handle, 1e5, true, &granted));
  }
  const double critical = stability::critical_stiffness({model.mass + stability::light.mass, model.damping + stability::light.damping,
                                                         stability::light.stiffness, 1e-3, 0.5e-3});
  const double shakes = makers::swing_at_wall(device.get(), arm.handle, 3 * critical, false);
  std::printf("  granted %.0f N/m: %.3f mm; %.0f N/m without bounds: %.3f mm\n", granted, 1e3 * stands, 3 * critical, 1e3 * shakes);
  ck_assert_msg(stands < 0.2e-3, "%g m", stands);
  ck_assert_msg(shakes > 0.5e-3, "%g m", shakes);
}
END_TEST

int main() {
  Suite* suite = suite_create("haply felt");
  add_case(suite, "walls", {a_wall_stands_and_shakes});
  return run_suite(suite);
}
