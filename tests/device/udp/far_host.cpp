// A host on another machine than its controller, for namespaces.sh: a push is felt, and the link is as bad as was told.
//
//   far_host URI WAY_MS LOSS
#include <cstdio>
#include <cstdlib>

#include "api/support.h"

using namespace scenes;

int main(int count, char** arguments) {
  if (count != 4) return 2;
  const double way = 1e-3 * std::atof(arguments[2]), loss = std::atof(arguments[3]);
  const Scene scene = make_scene();
  const Device device = open_device(arguments[1]);
  const Servo servo = start_servo(scene.get(), device.get(), fs_servo_options_init());
  fs_object push = fs_object_init("push", FS_PRIMITIVE_POINT);
  push.pose.position.x = 10;
  push.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 5, 0, 5);
  require(fs_object_set(scene.get(), &push), "fs_object_set");
  const double pushed = 5.0 / 135;  // m, of the nominal hand
  fs_state hand{};
  bool is_good = false;
  fs_servo_stats stats = fs_servo_stats_init();
  for (Patience patience; patience.lasts() && !is_good;) {
    require(fs_scene_get_hand(scene.get(), &hand, nullptr, nullptr), "fs_scene_get_hand");
    require(fs_scene_get_servo_stats(scene.get(), &stats), "fs_scene_get_servo_stats");
    is_good = std::fabs(hand.pose.position.x - pushed) < 0.2 * pushed && stats.link_delay_p50 > 2 * way &&
              stats.link_delay_p50 < 2 * way + 0.03 && (loss == 0 || (stats.link_loss > loss / 4 && stats.link_loss < 3 * loss));
  }
  std::printf("%g ms each way, loss %g: the hand is at %.1f mm of %.1f; delay p50 %.2f ms, p99 %.2f ms, loss %.3f, %.0f states/s\n",
              1e3 * way, loss, 1e3 * hand.pose.position.x, 1e3 * pushed, 1e3 * stats.link_delay_p50, 1e3 * stats.link_delay_p99,
              stats.link_loss, stats.link_rate);
  return is_good ? 0 : 1;
}
