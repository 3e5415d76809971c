/* Hello: a wall that the hand feels. A simulated hand presses against it, 20 mm deep, for two seconds. */
#include <stdio.h>
#include <stdlib.h>
#include <forceserver/forceserver.h>

static void check(fs_status status)
{
  if (status >= 0) return;
  fprintf(stderr, "hello: %s\n", fs_last_error());
  exit(1);
}

int main(void)
{
  fs_scene *scene;
  fs_device *device;
  fs_servo *servo;
  fs_servo_options options = fs_servo_options_init();
  fs_object wall = fs_object_init("wall", FS_PRIMITIVE_PLANE);  /* z = 0, its front up */
  fs_state hand;
  fs_wrench sent;
  int i;

  wall.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 500, 0, 10);  /* 500 N/m, 10 N */
  options.mode = FS_SERVO_VIRTUAL;  /* time as we step it; without this line a real-time thread runs the servo */
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &wall));
  check(fs_device_open("sim:?hold=0,0,-0.02", &device));
  check(fs_servo_start(scene, device, &options, &servo));
  for (i = 1; i <= 8; ++i) {
    check(fs_servo_step(servo, 250));
    check(fs_scene_get_hand(scene, &hand, NULL, &sent));
    printf("%.2f s: the hand is at %6.2f mm and feels %.2f N\n", i * 0.25, hand.pose.position.z * 1e3, sent.force.z);
  }
  fs_servo_stop(servo);
  fs_device_close(device);
  fs_scene_destroy(scene);
  return sent.force.z > 1 ? 0 : 1;
}
