/* A program that knows the library only at run time, as a plug-in or a foreign runtime does: it makes a force felt, on
 * the clock of its own steps and on the real one. Where the servo has a thread of its own, that is no worse for a host
 * that wants a signal at an underflow: the far flank of a gaussian has many. dlopen LIBRARY */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fenv.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <forceserver/forceserver.h>

static void *library;

/* A host may have much thread-local data, which lies on the stack of each thread: here almost as much as a small stack. */
static _Thread_local volatile char of_each_thread[254000];

static void *need(void *found)
{
  if (found) return found;
  fprintf(stderr, "%s\n", dlerror());
  exit(1);
}

/* The function of the library under its own name. */
#define DECLARE(name) __typeof__(name) *my_##name = (__typeof__(name) *)need(dlsym(library, #name))

static double feel(fs_servo_mode mode)
{
  DECLARE(fs_last_error);
  DECLARE(fs_scene_create);
  DECLARE(fs_scene_destroy);
  DECLARE(fs_object_set);
  DECLARE(fs_device_open);
  DECLARE(fs_device_close);
  DECLARE(fs_servo_start);
  DECLARE(fs_servo_step);
  DECLARE(fs_servo_set_enabled);
  DECLARE(fs_servo_stop);
  DECLARE(fs_scene_get_hand);
  fs_scene *scene = NULL;
  fs_device *device = NULL;
  fs_servo *servo = NULL;
  fs_servo_options options = fs_servo_options_init();
  fs_object wall = fs_object_init("wall", FS_PRIMITIVE_PLANE);
  fs_object faint = fs_object_init("faint", FS_PRIMITIVE_POINT);
  fs_wrench sent = {{0, 0, 0}, {0, 0, 0}};
  int i;

  faint.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 1, 0.001, 1);
  faint.pose.position.x = 0.0385;
  faint.pose.position.z = -0.02;
  wall.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 500, 0, 10);
  options.mode = mode;
  if (my_fs_scene_create(&scene) || my_fs_object_set(scene, &wall) || my_fs_object_set(scene, &faint) ||
      my_fs_device_open("sim:?hold=0,0,-0.02", &device)) {
    fprintf(stderr, "%s\n", my_fs_last_error());
    exit(1);
  }
  if (mode == FS_SERVO_THREAD) feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW | FE_UNDERFLOW);
  if (my_fs_servo_start(scene, device, &options, &servo)) {
    fprintf(stderr, "%s\n", my_fs_last_error());
    exit(1);
  }
  fedisableexcept(FE_ALL_EXCEPT);
  for (i = 0; i < 20000 && !(sent.force.z > 1); ++i) {
    if (mode == FS_SERVO_VIRTUAL) {
      my_fs_servo_step(servo, 100);
    } else {  /* a machine that is too slow stops the force: then once more */
      const struct timespec pause = {0, 2000000};
      nanosleep(&pause, NULL);
      my_fs_servo_set_enabled(servo, true);
    }
    my_fs_scene_get_hand(scene, NULL, NULL, &sent);
  }
  my_fs_servo_stop(servo);
  my_fs_device_close(device);
  my_fs_scene_destroy(scene);
  return sent.force.z;
}

int main(int count, char **arguments)
{
  double virtual_force, real_force;
  if (count != 2) return 2;
  of_each_thread[0] = 1;
  library = need(dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL));
  virtual_force = feel(FS_SERVO_VIRTUAL);
  real_force = feel(FS_SERVO_THREAD);
  printf("%.2f N in virtual time, %.2f N in real time\n", virtual_force, real_force);
  return virtual_force > 1 && real_force > 1 ? 0 : 1;
}
