// Hello: a spring to the centre, which a real-time servo renders to a simulated hand that draws an eight. The force is
// 5 N at most, from 25 mm from the centre on.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <thread>

#include <forceserver/forceserver.hpp>

using namespace forceserver;

int main() try {
  const Scene scene = Scene::create();
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);  // at the origin: 200 N/m, 5 N at most
  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 5);
  scene.object_set(spring);

  const Device device = Device::open("sim:?path=figure8");
  const Servo servo = Servo::start(scene, device);
  for (int i = 0; i < 10; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    fs_state hand;
    fs_wrench sent;
    scene.get_hand(&hand, nullptr, &sent);
    const fs_vec3 x = hand.pose.position, f = sent.force;
    std::printf("the hand is %5.1f mm from the centre and feels %.2f N\n", std::hypot(x.x, x.y, x.z) * 1e3,
                std::hypot(f.x, f.y, f.z));
  }
} catch (const Error& error) {
  std::fprintf(stderr, "hello: %s\n", error.what());
  return 1;
}
