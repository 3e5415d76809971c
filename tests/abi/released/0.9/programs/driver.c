/* A driver of your own is a table of functions. This "device" has a handle that swings up and down by itself, by 20 mm.
 * So a spring of 200 N/m sends forces of up to 4 N to it. */
#include <math.h>
#include <stdio.h>
#include <forceserver/driver.h>
#include <forceserver/forceserver.h>

static double now, told;  /* s, N; a driver for several devices keeps these for each, behind `self` */
static fs_status swing_open(const char *address, void **self) { (void)address; *self = &now; return FS_OK; }
static void swing_close(void *self) { (void)self; }
static fs_status swing_write(void *self, const fs_wrench *w) { (void)self; told = w->force.z; return FS_OK; }
static fs_status swing_advance(void *self, double time) { (void)self; now = time; return FS_OK; }
static fs_status swing_read(void *self, fs_state *out)
{
  (void)self; out->pose.position.z = 0.02 * sin(6 * now); out->pose.orientation.w = 1;
  out->time = now; out->flags = FS_STATE_READY; return FS_OK;
}
static fs_status swing_get_info(void *self, fs_device_info *out)
{
  (void)self; strcpy(out->name, "swing"); out->force_axes = 3; out->force_max = 10; out->rate = 1000; out->damping = 1;
  out->mass = 0.3; out->workspace_radius = out->workspace_height = 0.1; return FS_OK;
}

int main(void)
{
  const fs_driver driver = {.struct_size = sizeof driver, .scheme = "swing", .open = swing_open, .close = swing_close,
    .get_info = swing_get_info, .read = swing_read, .write = swing_write, .advance = swing_advance};
  fs_scene *scene = NULL; fs_device *device = NULL; fs_servo *servo = NULL;
  fs_servo_options options = fs_servo_options_init();
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 5);
  options.mode = FS_SERVO_VIRTUAL;  /* time advances only when we step the servo */
  int failed = fs_driver_register(&driver) < 0 || fs_scene_create(&scene) < 0 || fs_object_set(scene, &spring) < 0 ||
    fs_device_open("swing:", &device) < 0 || fs_servo_start(scene, device, &options, &servo) < 0;
  for (int i = 0; i < 10 && !failed && !(failed = fs_servo_step(servo, 200) < 0); ++i)
    printf("%.1f s: the driver was told %5.2f N\n", now, told);
  if (failed) fprintf(stderr, "driver: %s\n", fs_last_error());
  fs_servo_stop(servo); fs_device_close(device); fs_scene_destroy(scene);
  return failed;
}
