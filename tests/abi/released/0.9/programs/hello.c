/* Hello: a wall that the hand feels. A simulated hand wants to be 20 mm behind the wall, for two seconds. It comes to
 * rest 4.4 mm deep, where the wall pushes back with 500 N/m * 4.4 mm = 2.2 N, as hard as the hand does. */
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
  const fs_vec3 point = {0, 0, 0}, up = {0, 0, 1};
  const fs_object wall = fs_wall_init("wall", point, up, 500, 10);  /* free above z = 0; 500 N/m, 10 N at most */
  fs_state hand;
  fs_wrench sent;
  int i;

  options.mode = FS_SERVO_VIRTUAL;  /* time advances when we step; the default is a real-time thread */
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
  return hand.pose.position.z > -0.005 && sent.force.z > 2 ? 0 : 1;
}
