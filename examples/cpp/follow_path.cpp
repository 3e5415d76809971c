// A path to follow: a polyline draws the hand towards it. Without the path this hand would go straight, up to 30 mm
// away from the polyline; with it, the hand stays within 9 mm.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <forceserver/forceserver.h>

static void check(fs_status status) {
  if (status >= 0) return;
  std::fprintf(stderr, "follow_path: %s\n", fs_last_error());
  std::exit(1);
}

int main() {
  fs_vec3 points[51];  // a wave, 0.2 m long
  for (int i = 0; i < 51; ++i) points[i] = {-0.1 + 0.004 * i, 0.03 * std::sin(i * 0.125), 0};
  fs_object path = fs_object_init("path", FS_PRIMITIVE_POLYLINE);
  check(fs_shape_create_polyline(points, 51, false, &path.shape));
  path.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 400, 0, 8);  // 400 N/m, 8 N at most

  fs_scene* scene;
  fs_device* device;
  fs_servo* servo;
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;  // time advances only when we step the servo
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &path));
  fs_shape_destroy(path.shape);  // the scene keeps what it needs
  check(fs_device_open("sim:?path=sweep", &device));
  check(fs_servo_start(scene, device, &options, &servo));
  for (int i = 0; i < 8; ++i) {
    check(fs_servo_step(servo, 500));
    fs_report report;
    check(fs_scene_get_report(scene, "path", &report));
    std::printf("the hand is %.1f mm beside the path\n", report.distance * 1e3);
  }
  fs_servo_stop(servo);
  fs_device_close(device);
  fs_scene_destroy(scene);
}
