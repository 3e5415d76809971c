// Hello: a spring to the centre, which a real-time servo renders to a simulated hand that draws an eight. The force is
// 5 N at most, from 25 mm from the centre on.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include <forceserver/forceserver.h>

static void check(fs_status status) {
  if (status >= 0) return;
  std::fprintf(stderr, "hello: %s\n", fs_last_error());
  std::exit(1);
}

int main() {
  fs_scene* scene;
  check(fs_scene_create(&scene));
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);  // at the origin: 200 N/m, 5 N at most
  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 5);
  check(fs_object_set(scene, &spring));

  fs_device* device;
  fs_servo* servo;
  check(fs_device_open("sim:?path=figure8", &device));
  check(fs_servo_start(scene, device, nullptr, &servo));
  fs_wrench sent{};
  for (int i = 0; i < 10; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    fs_state hand;
    check(fs_scene_get_hand(scene, &hand, nullptr, &sent));
    const fs_vec3 x = hand.pose.position, f = sent.force;
    std::printf("the hand is %5.1f mm from the centre and feels %.2f N\n", std::hypot(x.x, x.y, x.z) * 1e3,
                std::hypot(f.x, f.y, f.z));
  }
  fs_servo_stop(servo);
  fs_device_close(device);
  fs_scene_destroy(scene);
}
