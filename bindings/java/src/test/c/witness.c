/* A device that writes down every force that it gets: "witness:FILE". The hand is 20 mm behind the plane z = 0. */
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <forceserver/driver.h>

static int file = -1;

static fs_status open_device(const char *address, void **self)
{
  file = open(address, O_WRONLY | O_CREAT | O_APPEND, 0600);
  *self = &file;
  return file < 0 ? FS_ERROR_IO : FS_OK;
}
static void note(const char *text)
{
  if (write(file, text, strlen(text)) < 0) return;
}
static void close_device(void *self) { (void)self; note("closed\n"); }
static fs_status get_info(void *self, fs_device_info *out)
{
  (void)self;
  strcpy(out->name, "witness");
  out->force_axes = 3;
  out->force_max = 10;
  out->rate = 1000;
  return FS_OK;
}
static fs_status read_device(void *self, fs_state *out)
{
  (void)self;
  out->pose.position.z = -0.02;
  out->flags = FS_STATE_READY;
  return FS_OK;
}
static fs_status write_device(void *self, const fs_wrench *wrench)
{
  char text[40];
  (void)self;
  snprintf(text, sizeof text, "%.3f\n", wrench->force.z);
  note(text);
  return FS_OK;
}

__attribute__((visibility("default"))) const fs_driver *fs_driver_entry(void);
const fs_driver *fs_driver_entry(void)
{
  static fs_driver driver = {sizeof driver, 0, "witness", NULL, open_device, close_device, get_info, read_device,
                             write_device, NULL, NULL};
  return &driver;
}
