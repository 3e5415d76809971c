// A path to follow: a polyline draws the hand towards it. Without the path this hand would go straight, up to 30 mm
// away from the polyline; with it, the hand stays within 9 mm.
#include <cmath>
#include <cstdio>

#include <forceserver/forceserver.hpp>

using namespace forceserver;

int main() try {
  fs_vec3 points[51];  // a wave, 0.2 m long
  for (int i = 0; i < 51; ++i) points[i] = {-0.1 + 0.004 * i, 0.03 * std::sin(i * 0.125), 0};
  const Shape wave = Shape::create_polyline(points, 51, false);
  fs_object path = fs_object_init("path", FS_PRIMITIVE_POLYLINE);
  path.shape = wave.get();
  path.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 400, 0, 8);  // 400 N/m, 8 N at most

  const Scene scene = Scene::create();
  scene.object_set(path);
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;  // time advances only when we step the servo
  const Device device = Device::open("sim:?path=sweep");
  const Servo servo = Servo::start(scene, device, &options);
  for (int i = 0; i < 8; ++i) {
    servo.step(500);
    std::printf("the hand is %.1f mm beside the path\n", scene.get_report("path").distance * 1e3);
  }
} catch (const Error& error) {
  std::fprintf(stderr, "follow_path: %s\n", error.what());
  return 1;
}
