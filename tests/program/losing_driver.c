/* Loaded before the program, or by it, it adds a driver whose device is lost for ten ticks after a quarter of a second. */
#include <stdlib.h>
#include <string.h>

#include <forceserver/driver.h>

static int ticks;

static fs_status open_device(const char *address, void **self)
{
  (void)address;
  *self = &ticks;
  return FS_OK;
}
static void close_device(void *self) { (void)self; }
static fs_status get_info(void *self, fs_device_info *out)
{
  (void)self;
  out->force_axes = 3;
  out->force_max = 5;
  out->rate = 1000;
  strcpy(out->name, "a device that is lost");
  return FS_OK;
}
static fs_status read_device(void *self, fs_state *out)
{
  const int tick = ++*(int *)self;
  if (tick > 250 && tick <= 260) return FS_ERROR_DISCONNECTED;
  out->flags = FS_STATE_READY;
  return FS_OK;
}
static fs_status write_device(void *self, const fs_wrench *wrench)
{
  (void)self;
  (void)wrench;
  return FS_OK;
}

const fs_driver *fs_driver_entry(void)
{
  static fs_driver driver;
  driver.struct_size = sizeof driver;
  driver.scheme = "losing";
  driver.open = open_device;
  driver.close = close_device;
  driver.get_info = get_info;
  driver.read = read_device;
  driver.write = write_device;
  return &driver;
}

__attribute__((constructor)) static void add_driver(void)
{
  if (getenv("LD_PRELOAD")) fs_driver_register(fs_driver_entry());
}
