/* forceserver/driver.h - for those who write a device driver; not in the umbrella. Conventions: forceserver.h. */
#ifndef FORCESERVER_DRIVER_H
#define FORCESERVER_DRIVER_H

#include <forceserver/device.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifndef SWIG  /* a runtime cannot write a driver, as it may not be called at the servo rate; it can load one */
/* A device driver: a table of functions, growing. It knows one device and nothing of scenes, limits or faults: the
 * library scales forces into the maxima, guards them, and judges the age of poses. get_info, read, write are called
 * by one thread at a time; read and write at the servo rate: they never wait, allocate or lock (USB and sockets live
 * in a thread of the driver). Report with `return fs_fail(status, "why, with the value")`; from read and write the
 * bare status. */
typedef struct fs_driver {
  uint32_t struct_size;         /* sizeof(fs_driver) */
  uint32_t reserved;            /* 0 */
  const char *scheme;           /* "falcon": [a-z0-9]+, at most 31, what stands before the ':' of a URI */

  /* The devices that are there, as fs_device_list. Null: nothing to list. */
  fs_status (*list)(fs_device_entry *out, size_t capacity, size_t *count);

  /* *self becomes the driver's own handle. address: the URI behind "scheme:", with options. May take seconds. */
  fs_status (*open)(const char *address, void **self);

  /* Sets the force to 0, waits until the device has it, then frees. No other call comes afterwards. Also called when
   * the process ends by exit or by a return from main, if the device was ever given a force; what became static only
   * after its servo was started may be destroyed by then. */
  void (*close)(void *self);

  /* out comes as zeros with its struct_size; write no further. Called once, after open. A device with n force axes
   * has the first n of x, y, z; rate must be within 100..20000 Hz, and force_max above 0 where there is an axis. */
  fs_status (*get_info)(void *self, fs_device_info *out);

  /* The newest pose, device frame, its time on the monotonic clock (s; 0: now). out comes as zeros; READY only when
   * homed and fresh; a twist left 0 is worked out; an orientation left 0 is the identity. DISCONNECTED: lost; it is
   * asked again each tick. */
  fs_status (*read)(void *self, fs_state *out);

  /* Sends a wrench, device frame, finite, within the maxima. A driver whose device can lets go 20 ms after the last
   * write: nothing else ends the force of a process that was killed. */
  fs_status (*write)(void *self, const fs_wrench *wrench);

  /* Null: write only. Instead of write, for a far controller that renders f0 + dfdx (x - x0) at its own rate,
   * saturates, damps, and fades when nothing comes. 0.1: never called, write is. */
  fs_status (*write_model)(void *self, const fs_pose *x0, const fs_wrench *f0, const fs_mat3 *dfdx);

  /* Null: a real device. A simulated one is brought to time (s, the servo's; without one the monotonic clock's)
   * before each read. */
  fs_status (*advance)(void *self, double time);
} fs_driver;

/* Adds a driver, copied, for the whole process; its functions must stay. list, write_model and advance may be null.
 * EXISTS: the scheme is taken; VERSION. */
FS_API fs_status fs_driver_register(const fs_driver *driver);

/* What a driver's library exports: const fs_driver *fs_driver_entry(void); */
typedef const fs_driver *(*fs_driver_entry_function)(void);
#endif

/* Adds the driver of a shared library that exports fs_driver_entry, a fs_driver_entry_function. path: a file; without
 * a '/' it is searched for where the system's loader looks. The library stays loaded until the process ends. IO (it
 * cannot be loaded, or exports no fs_driver_entry: the sentence has the loader's reason), and as fs_driver_register:
 * EXISTS, VERSION. */
FS_API fs_status fs_driver_load(const char *path);

/* message (null: none) becomes fs_last_error of this thread; returns status. */
FS_API fs_status fs_fail(fs_status status, const char *message);

#ifdef __cplusplus
}
#endif
#endif
