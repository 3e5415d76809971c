/* forceserver/driver.h - for authors of device drivers; forceserver.h does not include it, but has the conventions. */
#ifndef FORCESERVER_DRIVER_H
#define FORCESERVER_DRIVER_H

#include <forceserver/device.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifndef SWIG  /* a language runtime cannot be called at the servo rate, so it cannot write a driver; it can load one */
/* What a driver measures of the way between its device and this process. Growing. */
typedef struct fs_link {
  uint32_t struct_size;         /* sizeof(fs_link) */
  uint32_t reserved;            /* 0 */
  double delay;                 /* s from pose to force, as fs_device_info.delay, 0..10: the median of the last second or so */
  double delay_p99;             /* s, at least delay, at most 10: 99 of 100 are not longer; 0: not known, delay counts */
  double rate;                  /* Hz, 0..1e6: poses that come from the device; 0: not known */
  double loss;                  /* 0..1: the part of poses and forces that is lost; 0 also if it is not known */
} fs_link;

/* A local model, for a remote controller that renders it: at the pose x of the handle the force f0.force + dfdx (x - x0)
 * and the torque f0.torque + dtdr r, where r is the rotation vector (rad) from the orientation of x0 to that of x. All in
 * the device frame. Growing; the library fills it as far as struct_size says. */
typedef struct fs_model {
  uint32_t struct_size;         /* sizeof(fs_model) of the library */
  uint32_t reserved;            /* 0 */
  fs_pose x0;                   /* the pose that it answers, as read gave it; the identity if that was none */
  fs_wrench f0;                 /* the force and torque at x0, finite, within the maxima */
  fs_mat3 dfdx;                 /* N/m, symmetric, without the damping of objects. Its largest eigenvalue is at most
                                   2.5 (damping + controller_damping)/(delay + 1/link_rate), all of fs_device_info: half
                                   of what was measured to shake */
  fs_mat3 dtdr;                 /* N m/rad, symmetric. 0.9: 0 */
  uint64_t number;              /* which state it answers: the first that read gave is 1; 0: none */
  double time;                  /* s, when that state was measured (fs_state.time) */
  double hold;                  /* s for which the model counts from when it comes to the controller, which may let it count
                                   for less; unless another has come by then, the force fades */
} fs_model;

/* Bits of fs_driver.flags. */
enum {
  FS_DRIVER_IN_SERVO = 1        /* receive returns within 20 ms and send within 5 ms, whatever the device and other threads
                                   do: so the servo's own thread calls them, between two ticks, and no time is lost between
                                   threads. Then it ticks when receive returns, so with a slow device less often than at its
                                   rate, and a force stands as long as receive waits. Never set it where they call a maker's
                                   closed library, or for a hidraw node of Linux, whose writes may take seconds */
};

/* A device driver: a table of functions, growing. It knows one kind of device and nothing of scenes, limits or faults:
 * the library scales forces down to the device's maxima, guards them, and checks the age of poses. Report an error by
 * `return fs_fail(status, "why, with the value")`: what receive and send say goes into the event that tells of the loss. From
 * read and write return the status only.
 *
 * There are two kinds of driver. One has `receive` and `send`, which may wait for the device: for nearly all real devices. The
 * library calls them in a thread of its own, again and again: receive, then send with the force for that state, or with 0 when
 * no servo has given a force for 25 ms and a period. A servo's tick begins when receive has given a state, so the force that is sent answers
 * the newest state. Where nothing comes, the servo ticks by its clock. A driver that hangs holds up neither the servo nor its
 * stop; closing its device then takes up to a second, and at the end of the process all hanging devices together take up to a
 * second. As long as it hangs nothing is sent, so only the device's own watchdog ends the force that it has. When receive or
 * send returns DISCONNECTED, the library closes the device and opens it again, at most twice a second, until the same device is
 * back: one with the same serial, name, axes, maxima, rates, mass and damping. Its force begins again by the ramp.
 * The other kind has `read` and `write`, which never wait: for simulators, and for whoever has a thread of his own.
 *
 * receive, send, write_model and close of one device are called by one thread at a time; so are get_info, read and write. */
typedef struct fs_driver {
  uint32_t struct_size;         /* sizeof(fs_driver) */
  uint32_t reserved;            /* 0 */
  const char *scheme;           /* what stands before the ':' of a URI, such as "mine": [a-z0-9]+, at most 31 bytes */

  /* The devices that are present, as for fs_device_list. An error: what the driver itself needs is missing, such as the library of
   * a maker; fs_driver_list tells its sentence. A null pointer: nothing to list. */
  fs_status (*list)(fs_device_entry *out, size_t capacity, size_t *count);

  /* Opens a device; *self becomes the driver's own handle. address: the rest of the URI after "scheme:", with options.
   * May take seconds. */
  fs_status (*open)(const char *address, void **self);

  /* Sets the force to 0, waits until the device has it, then frees self. No other call comes afterwards. Also called
   * when the process ends by exit or by a return from main, if the device was ever given a force; static objects that
   * were constructed after its servo was started may be destroyed by then. */
  void (*close)(void *self);

  /* Fills out, which is all zeros but struct_size; write no more than that size. Called once, after open. A device with
   * n force axes has the first n of x, y, z; rate must be within 100..20000 Hz, and force_max above 0 if there is an
   * axis. */
  fs_status (*get_info)(void *self, fs_device_info *out);

  /* Null where there is a receive. Called at the servo rate: it never waits, allocates or locks.
   * The newest pose, device frame, with its time on the monotonic clock (s; 0: now). out is all zeros before the call.
   * Set FS_STATE_READY only when homed and fresh. The library works out a twist that is left 0, and one that is slower than
   * the poses by more than 1 m/s; give one only if it is measured better than by differences of the poses, as damping makes
   * a force of all that it has. An orientation left 0 is the identity. When the device is not ready, set the FS_STATE_ bit
   * that says why. Return DISCONNECTED when the device is lost; read is still called at each tick. */
  fs_status (*read)(void *self, fs_state *out);

  /* Null where there is a send. Called at the servo rate, as read is. Sends a wrench, device frame, finite, within the
   * maxima. If the device can, the driver has it drop the force 20 ms after the last write: nothing else ends the force of a
   * process that was killed. */
  fs_status (*write)(void *self, const fs_wrench *wrench);

  /* Called instead of write or send where fs_device_info.controller_rate is above 0: for a remote controller that renders the
   * local model at that rate, limits its force, damps with controller_damping, and lets the force fade when nothing
   * comes. Of the model read no more than its struct_size. Without a force it is called with f0, dfdx and dtdr of zeros;
   * write or send is still called with 0 when the force must end. A null pointer: the device takes forces only, and the three
   * controller_ fields count as 0. */
  fs_status (*write_model)(void *self, const fs_model *model);

  /* Called before each read to bring a simulated device to time (s, on the servo's clock, without a servo on the
   * monotonic clock). A null pointer: a real device. */
  fs_status (*advance)(void *self, double time);

  /* Fills out, which is all zeros but struct_size, with what the driver measures at present; write no more than that size.
   * Called 25 times a second while a servo has the device: where there is a receive, by the thread that calls it, just before;
   * otherwise by another thread, also while read or write is under way, or in mode VIRTUAL by fs_servo_step between two ticks.
   * It must return at once. What the loop can render follows (servo.h): a longer delay counts at once, a shorter one when it was
   * told three times. Figures that are not within their ranges are refused with an FS_EVENT_DEVICE, and what was told before
   * stays. UNSUPPORTED: nothing has been measured yet. A null pointer: the driver measures nothing. */
  fs_status (*get_link)(void *self, fs_link *out);

  /* Waits for the next state of the device and gives it as read does (time 0: when receive returned). Returns TIMEOUT when none
   * has come within 20 ms or less, or earlier another status when a device that gave states has fallen silent; DISCONNECTED
   * when the device is lost; another status when what came is of no use. Until a state comes again, a servo's force is 0 when
   * the newest is too old (fs_device_info.delay), and at once after any status but OK and TIMEOUT. */
  fs_status (*receive)(void *self, fs_state *out);

  /* Sends a wrench, as write does; may wait for the device to take it, some milliseconds at most. Also called when the force
   * is 0, after each receive, so that a device's watchdog knows that somebody is there. */
  fs_status (*send)(void *self, const fs_wrench *wrench);

  /* What fs_device_control asks for. The driver writes at most `size` bytes into answer, of which there is at least 1, with a 0 at
   * the end; before the call it is empty. Called by the thread that asks, at any
   * moment, also while receive or send is under way, and by several threads at once. It may take seconds. A null pointer: the
   * device has no requests. */
  fs_status (*control)(void *self, const char *request, char *answer, size_t size);

  uint32_t flags;               /* FS_DRIVER_ bits */
  uint32_t reserved_2;          /* 0 */
} fs_driver;

/* Adds a driver for the whole process. The table is copied; its functions must remain loaded. It has either read and write, or
 * receive and send; the other two are null. With receive and send, advance is null, too; list, write_model, advance, get_link
 * and control may be null. EXISTS: the scheme is taken; VERSION. */
FS_API fs_status fs_driver_register(const fs_driver *driver);

/* The type of the function that a driver's library exports: const fs_driver *fs_driver_entry(void); */
typedef const fs_driver *(*fs_driver_entry_function)(void);
#endif

/* A driver that is known. Frozen. */
typedef struct fs_driver_info {
  char scheme[32],              /* what stands before the ':' of its URIs */
       path[512],               /* of its library; "": it belongs to forceserver or to this program */
       trouble[480];            /* why it cannot be used, in the words of the system's loader or of its own list; "": it can */
} fs_driver_info;

/* The drivers that are known, a list, by scheme: those of forceserver and of this program, and the modules. A module is the
 * library of a driver, forceserver/drivers-1/SCHEME.so in the folder of the library forceserver. It is loaded when a
 * URI of its scheme is first used, or by this call, which loads all and asks each to look for devices, which may take a second. It
 * stays loaded until the process ends. */
FS_API fs_status fs_driver_list(fs_driver_info *out, size_t capacity, size_t *count);

/* Adds the driver of a shared library that exports fs_driver_entry, a fs_driver_entry_function. path: a file; without
 * a '/' it is searched for where the system's loader looks. The library stays loaded until the process ends. Loaded before
 * the first use of its scheme, it takes the place of a module of that scheme. IO (it cannot be loaded, or exports no
 * fs_driver_entry: fs_last_error() has the loader's reason), and as for fs_driver_register EXISTS, VERSION. */
FS_API fs_status fs_driver_load(const char *path);

/* Sets fs_last_error of this thread to message (null: an empty one) and returns status. */
FS_API fs_status fs_fail(fs_status status, const char *message);

#ifdef __cplusplus
}
#endif
#endif
