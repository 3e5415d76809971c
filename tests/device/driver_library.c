/* A driver in a library of its own, as fs_driver_load takes it. DRIVER_FAULT: what is wrong with it: 0 nothing, 1 its
 * entry has another name, 2 it gives none, 3 it is newer than the library, 4 it lacks a function, 5 its device is lost for
 * ten ticks after a quarter of a second, and when it is loaded before the program (LD_PRELOAD) it adds itself, 6 it needs
 * a function that nobody has, 7 its entry is no function. */
#include <stdlib.h>
#include <string.h>

#include <forceserver/driver.h>

static fs_wrench written;
static int reads;

static fs_status open_device(const char *address, void **self)
{
  if (strcmp(address, "0") != 0) return fs_fail(FS_ERROR_NOT_FOUND, "there is device 0 only");
  reads = 0;
  *self = &written;
  return FS_OK;
}
static void close_device(void *self) { (void)self; }
static fs_status get_info(void *self, fs_device_info *out)
{
  (void)self;
  out->force_axes = 3;
  out->force_max = 5;
  out->rate = 1000;
  strcpy(out->name, "a device from a library");
  return FS_OK;
}
static fs_status read_device(void *self, fs_state *out)
{
  if (DRIVER_FAULT == 5 && ++reads > 250 && reads <= 260) return FS_ERROR_DISCONNECTED;
  out->pose.position = ((const fs_wrench *)self)->force; /* it is where it was last pushed to */
  out->flags = FS_STATE_READY;
  return FS_OK;
}
static fs_status write_device(void *self, const fs_wrench *wrench)
{
  *(fs_wrench *)self = *wrench;
  return FS_OK;
}

#if DRIVER_FAULT == 7
__attribute__((visibility("default"))) int fs_driver_entry_variable __asm__("fs_driver_entry") = 7;
#  define fs_driver_entry another_name
#endif
#if DRIVER_FAULT == 1
#define fs_driver_entry another_name
#endif
__attribute__((visibility("default"))) const fs_driver *fs_driver_entry(void);
const fs_driver *fs_driver_entry(void)
{
  static struct { fs_driver driver; void (*added)(void *self); } table;
  fs_driver *const driver = &table.driver;
#if DRIVER_FAULT == 6
  extern void a_function_that_nobody_has(void);
  a_function_that_nobody_has();
#endif
  if (DRIVER_FAULT == 3) table.added = close_device;
  driver->struct_size = DRIVER_FAULT == 3 ? sizeof table : sizeof *driver;
  driver->scheme = "library";
  driver->open = open_device;
  driver->close = DRIVER_FAULT == 4 ? NULL : close_device;
  driver->get_info = get_info;
  driver->read = read_device;
  driver->write = write_device;
  return DRIVER_FAULT == 2 ? NULL : driver;
}

#if DRIVER_FAULT == 5
__attribute__((constructor)) static void add_driver(void)
{
  if (getenv("LD_PRELOAD")) fs_driver_register(fs_driver_entry());
}
#endif
