/* forceserver/servo.h - the loop read, evaluate, guard, write. Conventions: forceserver.h.
 *
 * A servo makes a scene felt on a device. Each tick reads the hand, evaluates the scene there, guards the force and
 * writes it. The guard is the last stage and never bypassed: the force is finite, at most force_limit (direction
 * kept), ramped after a stop, and 0 on a fault or for a device that is not ready.
 *
 * However a servo ends, the device has force 0 within two ticks, before anything is waited for: by fs_servo_stop, also
 * while the server or another thread is busy, and when the process ends by exit or by a return from main, from
 * whatever thread. A process that is killed, crashes, calls _exit or exec, or whose thread of CALLER mode stops
 * stepping, can send nothing: there only the device's own watchdog ends the force (driver.h). A forked child has
 * nothing of the servo: its calls do nothing or give STATE, and the device stays the parent's.
 */
#ifndef FORCESERVER_SERVO_H
#define FORCESERVER_SERVO_H

#include <forceserver/device.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Who runs the ticks, and on which clock. */
typedef enum fs_servo_mode {
  FS_SERVO_THREAD = 0,          /* its own real-time thread; the application's signals are blocked there */
  FS_SERVO_CALLER = 1,          /* the caller's loop calls fs_servo_step(servo, 1): a tick now, real clock. Between
                                   ticks the device keeps its force: who stops stepping stops the servo, too */
  FS_SERVO_VIRTUAL = 2,         /* fs_servo_step; tick k = 1, 2.. is at k/rate s: tests, simulations */
  FS_SERVO_FORCE_32 = 0x7fffffff
} fs_servo_mode;

/* Growing; made by fs_servo_options_init; all zeros are the defaults. "none": fs_servo_stats says so. */
typedef struct fs_servo_options {
  uint32_t struct_size;         /* sizeof(fs_servo_options), by fs_servo_options_init */
  fs_servo_mode mode;           /* who runs the ticks */
  double rate;                  /* Hz, 100..20000; 0: the device's */
  double force_limit,           /* N, at most the device's; 0: the device's */
         torque_limit;          /* N m, at most the device's; 0: the device's */
  double slew_limit;            /* N/s of the whole force, against faults only: below what a hard wall needs it makes a
                                   loop unstable; 0: 3 m/s times max_stiffness; negative: none. 0.1: always none,
                                   above 0 UNSUPPORTED */
  double speed_limit;           /* m/s of the hand, a fault above; 0: 2; negative: none */
  double ramp;                  /* s to full force at the start and after a fault; 0: 0.5; negative: none */
  double fade;                  /* s for an object that comes or goes; 0: 1.0; negative: none */
  double blend;                 /* s over which a moved or changed object settles; 0: 0.02; negative: none. 0.1: always
                                   none, above 0 UNSUPPORTED */
  double delay;                 /* s of the loop, beside its period, 0..10; 0: the device's. 0.1: above 0 UNSUPPORTED */
  double damping;               /* N s/m, local, filtered at 100 Hz; 0: 5, or less where the loop cannot carry it;
                                   negative: none. 0.1: always none, above 0 UNSUPPORTED */
  double max_stiffness;         /* N/m shared by all; 0: what the loop can render; negative: none. It and damping as
                                   applied: fs_servo_stats. 0.1: always none, above 0 UNSUPPORTED */
  int32_t priority;             /* THREAD: SCHED_FIFO 1..99; 0: 80; negative: ordinary */
  int32_t cpu;                  /* THREAD: n > 0: processor n-1; 0: any */
} fs_servo_options;
FS_DEFINE_INIT(fs_servo_options)

/* What the system granted to the servo's thread (other modes: NONE). */
typedef enum fs_realtime {
  FS_REALTIME_NONE = 0,         /* an ordinary thread: expect late ticks */
  FS_REALTIME_NICE = 1,         /* a better nice value */
  FS_REALTIME_FIFO = 2,         /* SCHED_FIFO */
  FS_REALTIME_FIFO_LOCKED = 3,  /* SCHED_FIFO, and locked in memory until the stop: the servo with its flight record,
                                   its thread's stack, and this library, the C and the mathematical library; about
                                   5 MB at 1 kHz. Objects, meshes, the driver and the rest of the process are not
                                   locked: a process that wants that calls mlockall */
  FS_REALTIME_FORCE_32 = 0x7fffffff
} fs_realtime;

/* [rt] "FS_REALTIME_FIFO"; static, never null, also for a number that is no value. */
FS_API const char *fs_realtime_name(fs_realtime realtime);

/* Why there is no force; bits. DEVICE ends by itself, through the ramp; the others hold the force at 0 until
 * fs_servo_set_enabled(servo, true). */
typedef enum fs_fault {
  FS_FAULT_DEVICE = 1,          /* not ready, lost, or its pose too old: older than 20 ms and fs_device_info.delay
                                   together, at most 100 ms (its time 0: now). VIRTUAL: a device without `advance`
                                   (driver.h) has no age */
  FS_FAULT_SPEED = 2,           /* the hand above speed_limit */
  FS_FAULT_NUMBER = 4,          /* a pose or force that is not finite */
  FS_FAULT_LATE = 8,            /* 20 ticks in a row, each later than a period. After one stall of 20 ms or more the
                                   force only ramps; VIRTUAL: neither */
  FS_FAULT_FORCE_32 = 0x7fffffff
} fs_fault;

/* [rt] "FS_FAULT_SPEED": the name of the lowest of these fs_fault bits; of 0 "no fault". Static, never null, also for a
 * bit that is no fault. Of all bits: for (; faults; faults &= faults - 1) puts(fs_fault_name(faults)); */
FS_API const char *fs_fault_name(uint32_t faults);

/* What negative options switched off; bits. 0.1: SLEW, STIFFNESS, DAMPING and BLEND always, as they are not there
 * yet. */
enum {
  FS_OFF_SLEW = 1,              /* slew_limit */
  FS_OFF_SPEED = 2,             /* speed_limit */
  FS_OFF_STIFFNESS = 4,         /* max_stiffness */
  FS_OFF_DAMPING = 8,           /* damping */
  FS_OFF_RAMP = 16,             /* ramp */
  FS_OFF_FADE = 32,             /* fade */
  FS_OFF_BLEND = 64             /* blend */
};

/* How a servo does. Growing; made by fs_servo_stats_init. Percentiles are at most 3.2 % too high, maxima exact. */
typedef struct fs_servo_stats {
  uint32_t struct_size;         /* sizeof(fs_servo_stats), by fs_servo_stats_init */
  fs_realtime realtime;         /* what the system granted */
  uint32_t faults,              /* fs_fault bits now */
           protections_off;     /* FS_OFF_ bits */
  double rate;                  /* Hz, reached in the last 10 s */
  double max_stiffness;         /* N/m at the device, the budget in force; infinite: none. 0.1: infinite */
  double damping;               /* N s/m, local, as applied. 0.1: 0 */
  double energy;                /* J given to the hand less J taken since the start; it only reports. 0.1: 0 */
  uint64_t ticks,               /* since the start */
           misses;              /* since the start; a miss is later than a period, and skipped */
  uint64_t device_errors,       /* ticks with a failed read or write */
           guarded;             /* ticks whose force a limit or fault changed (the ramp does not count) */
  uint64_t approximated;        /* ticks with error_bound > 0 */
  double late_p50, late_p99, late_max,            /* s from when a tick was due to its beginning, of the last 10 s */
         compute_p50, compute_p99, compute_max;   /* s that a tick took, of the last 10 s */
} fs_servo_stats;
FS_DEFINE_INIT(fs_servo_stats)

/* One tick as it was. Frozen. */
typedef struct fs_tick {
  fs_state state;               /* device frame; failed read: zeros */
  fs_response response;         /* of all scenes, device frame, before the guard */
  fs_wrench sent;               /* device frame, after the guard */
  double late, compute;         /* s from when it was due to its beginning; s it took */
  fs_status device;             /* of read and write: the first that failed */
  uint32_t faults;              /* fs_fault bits */
} fs_tick;

/* Runs read, evaluate, guard, write, until stopped, also when the caller has let go of scene and device. options
 * null: defaults. Stored times move to the servo's clock, and what fades is brought to its end. A scene or device has
 * one servo at most: STATE. Connected scene, an option that is not there yet: UNSUPPORTED. VERSION; IO: no thread. */
FS_API fs_status fs_servo_start(fs_scene *scene, fs_device *device, const fs_servo_options *options, fs_servo **out);

/* [rt] Runs so many ticks at once, in this thread; never waits. One thread at a time: else STATE. DISCONNECTED: at
 * the last tick the device was lost or not ready (all ticks ran; go on). STATE, too, when another thread stops the
 * servo meanwhile: the other ticks do not run, and no call with this handle may follow. THREAD: UNSUPPORTED. */
FS_API fs_status fs_servo_step(fs_servo *servo, uint64_t ticks);

/* [rt] false: no force, from the next tick on. true: the force ramps up again, also after a latched fault, which it
 * clears; enabled and without one, it changes nothing. What caused the fault and is still there latches it again, and
 * each time there is an FS_EVENT_DEVICE. A servo starts enabled. */
FS_API fs_status fs_servo_set_enabled(fs_servo *servo, bool enabled);

/* Stops the servo; null does nothing. First the force is 0 and no tick comes any more (a device that fails to take it
 * is asked again for 20 ms), then its server's clients are disconnected. Unlike with other handles, a fs_servo_step
 * may be under way in another thread, which ends early, and so may another fs_servo_stop: both return when it is
 * stopped. Scene and device can have another servo afterwards. */
FS_API void fs_servo_stop(fs_servo *servo);

/* [rt] Of the servo that runs this scene, here or at the server; none: STATE. state: the hand, last tick; response:
 * of this scene alone; sent: what the device got of all scenes, after the guard, along this scene's axes. Null: not
 * asked. Before the first tick all are zeros, at the identity. */
FS_API fs_status fs_scene_get_hand(const fs_scene *scene, fs_state *state, fs_response *response, fs_wrench *sent);

/* Fills out, which was made by fs_servo_stats_init, from the servo that runs this scene; none: STATE. VERSION. */
FS_API fs_status fs_scene_get_servo_stats(fs_scene *scene, fs_servo_stats *out);

/* Fills out, which was made by fs_device_info_init, with the device of the servo that runs this scene; none: STATE.
 * VERSION. */
FS_API fs_status fs_scene_get_device_info(fs_scene *scene, fs_device_info *out);

/* The flight record, a list: the newest ticks, oldest first, 2 s at most. A latched fault stops it, that tick being
 * the last, until the servo is enabled again; FS_FAULT_DEVICE does not. Connected: UNSUPPORTED. */
FS_API fs_status fs_servo_get_record(fs_servo *servo, fs_tick *out, size_t capacity, size_t *count);

#ifdef __cplusplus
}
#endif
#endif
