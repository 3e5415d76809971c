/* forceserver/driver.h - for those who write a device driver; not in the umbrella. Conventions: forceserver.h. */
#ifndef FORCESERVER_DRIVER_H
#define FORCESERVER_DRIVER_H

#include <forceserver/device.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifndef SWIG
/* A device driver: a table of functions, growing. get_info, read, write are called by one thread at a time; read and
 * write at the servo rate: they never wait, allocate or lock (USB and sockets live in a thread of the driver). Report
 * with `return fs_fail(status, "why, with the value")`; from read and write the bare status. */
typedef struct fs_driver {
  uint32_t struct_size;                 /* sizeof(fs_driver) */
  uint32_t reserved;
  const char *scheme;                   /* "falcon": [a-z0-9]+, what stands before the ':' of a URI */
  fs_status (*list)(fs_device_entry *out, size_t capacity, size_t *count);  /* null: nothing to list */
  fs_status (*open)(const char *address, void **self);      /* the URI behind "scheme:", with options; may take seconds */
  void (*close)(void *self);                                /* force to 0, then free */
  fs_status (*get_info)(void *self, fs_device_info *out);   /* out->struct_size is set; write no further */
  fs_status (*read)(void *self, fs_state *out);             /* newest pose, device frame, its time on the monotonic clock;
                     out comes as zeros; READY only when homed and fresh; a twist left 0 is worked out; DISCONNECTED */
  fs_status (*write)(void *self, const fs_wrench *wrench);  /* finite, within the maxima. A driver whose device can
                                                               lets go 20 ms after the last write */
  fs_status (*write_model)(void *self, const fs_pose *x0, const fs_wrench *f0, const fs_mat3 *dfdx);  /* null: write only.
                     Instead of write, for a far controller that renders f0 + dfdx (x - x0) at its own rate, saturates,
                     damps, and fades when nothing comes */
  fs_status (*advance)(void *self, double time);            /* null: a real device. A simulated one is brought to time (s,
                     the servo's; without one the monotonic clock's) before each read */
} fs_driver;
FS_API fs_status fs_driver_register(const fs_driver *driver);       /* copied; for the whole process; EXISTS, VERSION */
FS_API fs_status fs_driver_load(const char *path);                  /* a library that exports fs_driver_entry: IO, VERSION */
FS_API fs_status fs_fail(fs_status status, const char *message);    /* becomes fs_last_error here; returns status */
typedef const fs_driver *(*fs_driver_entry_function)(void);         /* const fs_driver *fs_driver_entry(void); */
#endif

#ifdef __cplusplus
}
#endif
#endif
