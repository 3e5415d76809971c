/* A device "calibrated:0" that is calibrated in two steps; the first time the hand moves in the second. */
#include <string.h>

#include <forceserver/driver.h>

static int step, has_moved, device;

static fs_status device_open(const char *address, void **self) {
  (void)address;
  *self = &device;
  return FS_OK;
}
static void device_close(void *self) { (void)self; }
static fs_status get_info(void *self, fs_device_info *out) {
  (void)self;
  strcpy(out->name, "calibrated");
  out->rate = 1000;
  return FS_OK;
}
static fs_status device_read(void *self, fs_state *out) {
  (void)self, (void)out;
  return FS_OK;
}
static fs_status device_write(void *self, const fs_wrench *wrench) {
  (void)self, (void)wrench;
  return FS_OK;
}
static fs_status control(void *self, const char *request, char *answer, size_t size) {
  const char *text = "step 1: put it here";
  (void)self;
  if (strcmp(request, "calibrate=cancel") == 0) text = "as before";
  else if (strcmp(request, "calibrate") != 0) return fs_fail(FS_ERROR_UNSUPPORTED, "the request is: calibrate");
  else if (step == 1 && !has_moved++) return fs_fail(FS_ERROR_STATE, "the hand has moved");
  else if (step++ == 1) text = "done: it is kept";
  if (strlen(text) >= size) return FS_ERROR_INVALID;
  strcpy(answer, text);
  return FS_OK;
}

FS_API const fs_driver *fs_driver_entry(void) {
  static fs_driver driver;
  driver.struct_size = sizeof driver;
  driver.scheme = "calibrated";
  driver.open = device_open;
  driver.close = device_close;
  driver.get_info = get_info;
  driver.read = device_read;
  driver.write = device_write;
  driver.control = control;
  return &driver;
}
