/* forceserver/servo.h - the loop read, evaluate, guard, write. Conventions: forceserver.h.
 *
 * A servo renders a scene on a device. Each tick reads the hand, evaluates the scene there, guards the force and writes
 * it. The guard is the last stage and never bypassed: the force is damped, finite, at most force_limit (direction
 * kept), ramped after a stop, and 0 on a fault or for a device that is not ready.
 *
 * A sampled loop can render only so much stiffness and damping before it shakes a handle that nobody holds. Both limits
 * are worked out from the device's mass, damping and delay and the rate. With lag = period/2 + delay:
 * stiffness up to (damping of the device + local damping)/(2 lag), but at most half of what shakes the released device; and
 * damping, local and of objects together, up to 0.7 mass/lag. fs_servo_stats tells the stiffness and the local damping that
 * are applied; nothing tells yet by how much the damping of an object is lowered. A device that does not tell its mass counts as
 * one of 0.05 kg.
 *
 * Where the driver measures the delay while the servo runs (driver.h, get_link), both limits follow within 0.2 s, and with
 * them the local damping, the slew limit, the local models of a remote controller and the age at which a pose is too old.
 * The force makes no step: other bounds are blended as a profile that changes is, and so are damping and models. The delay
 * that counts is the longest of three looks, 40 ms apart, and stays while it becomes shorter by less than a tenth.
 *
 * When a servo ends, the device has force 0 within two ticks, before anything is waited for. This holds for
 * fs_servo_stop, also while the server or another thread is busy, and when the process ends by exit or by a return from
 * main, from whatever thread. A process that is killed, crashes, calls _exit or exec, or stops stepping a servo of mode
 * CALLER, cannot send anything: there only the device's own watchdog ends the force (driver.h). A forked child does not
 * have the servo: its calls do nothing or return STATE, and the device stays with the parent.
 */
#ifndef FORCESERVER_SERVO_H
#define FORCESERVER_SERVO_H

#include <forceserver/device.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Who runs the ticks, and on which clock. */
typedef enum fs_servo_mode {
  FS_SERVO_THREAD = 0,          /* its own real-time thread; the application's signals are blocked there. A tick begins when a
                                   device that paces the servo (driver.h, receive) has given a state, otherwise by the
                                   clock */
  FS_SERVO_CALLER = 1,          /* the caller's loop calls fs_servo_step(servo, 1): a tick now, on the real clock.
                                   Between ticks the device keeps its force: stop the servo when you stop stepping */
  FS_SERVO_VIRTUAL = 2,         /* fs_servo_step; tick k = 1, 2.. is at k/rate s: for tests and simulations */
  FS_SERVO_FORCE_32 = 0x7fffffff
} fs_servo_mode;

/* Growing; made by fs_servo_options_init; all zeros are the defaults. "none" switches a protection off, and
 * fs_servo_stats.protections_off reports it. */
typedef struct fs_servo_options {
  uint32_t struct_size;         /* sizeof(fs_servo_options), by fs_servo_options_init */
  fs_servo_mode mode;           /* who runs the ticks */
  double rate;                  /* Hz, 100..20000; 0: the device's */
  double force_limit,           /* N, at most the device's; 0: the device's */
         torque_limit;          /* N m, at most the device's; 0: the device's */
  double slew_limit;            /* N/s of the whole force, a protection against faults only; 0: 3 m/s times the
                                   stiffness that the loop can render; negative: none. A limit below what a hard wall
                                   needs would make the loop unstable: below 3 m/s times max_stiffness as applied it is
                                   INVALID, and max_stiffness never rises above what the limit allows. Where max_stiffness
                                   is none, 0 means none too, and any limit is taken */
  double speed_limit;           /* m/s of the hand; a higher speed is a fault; 0: 2; negative: none */
  double ramp;                  /* s to full force at the start and after a fault; 0: 0.5; negative: none */
  double fade;                  /* s in which an object fades in or out; 0: 1.0; negative: none */
  double blend;                 /* s over which the change of a moved or changed object is spread (scene.h); 0: 0.02;
                                   negative: none. An object that is moved farther than speed_limit * blend fades */
  double delay;                 /* s of delay in the loop, in addition to its period, 0..10; 0: the device's, as it says
                                   or measures it. With a remote controller (fs_device_info.controller_rate): that of the
                                   link to it */
  double damping;               /* N s/m, local, filtered at 100 Hz, and 0.4 of it at rest, where the hand moves by 2 encoder
                                   steps or less within 50 ms; 0: 5; more than the loop can render is lowered to
                                   that; negative: none. A remote controller damps by itself, whatever this says */
  double max_stiffness;         /* N/m, the total of all objects; 0: what the loop can render, and more than that is
                                   lowered to it; negative: none. fs_servo_stats has this value and damping as applied.
                                   INVALID: 0 or more where there is no damping, neither the device's own nor local, as
                                   nothing can be rendered then */
  int32_t priority;             /* THREAD: of SCHED_FIFO, 1..99; 0: 80; negative: an ordinary thread */
  int32_t cpu;                  /* THREAD: n > 0: processor n-1; 0: any */
} fs_servo_options;
FS_DEFINE_INIT(fs_servo_options)

/* What the system granted to the servo's thread (other modes: NONE). */
typedef enum fs_realtime {
  FS_REALTIME_NONE = 0,         /* an ordinary thread: expect late ticks */
  FS_REALTIME_NICE = 1,         /* a better nice value */
  FS_REALTIME_FIFO = 2,         /* SCHED_FIFO */
  FS_REALTIME_FIFO_LOCKED = 3,  /* SCHED_FIFO, and these are locked in memory until the stop: the servo with its flight
                                   record, its thread's stack, this library, the C library and the mathematical
                                   library; about 5 MB at 1 kHz. Objects, meshes, the driver and the rest of the process
                                   are not locked: a process that wants that calls mlockall */
  FS_REALTIME_FORCE_32 = 0x7fffffff
} fs_realtime;

/* [rt] The name of a value, such as "FS_REALTIME_FIFO"; static, never null, not even for a number that is no value. */
FS_API const char *fs_realtime_name(fs_realtime realtime);

/* Why there is no force; bits. FS_FAULT_DEVICE ends by itself, then the force ramps up; the others hold the force at 0
 * until fs_servo_set_enabled(servo, true). */
typedef enum fs_fault {
  FS_FAULT_DEVICE = 1,          /* the device is not ready, lost, or its pose is older than 20 ms +
                                   fs_device_info.delay, or as it is measured, + 1/link_rate (100 ms at most; a time of 0
                                   means now).
                                   VIRTUAL: the pose of a device without `advance` (driver.h) has no age */
  FS_FAULT_SPEED = 2,           /* the hand is faster than speed_limit */
  FS_FAULT_NUMBER = 4,          /* a pose or force is not finite */
  FS_FAULT_LATE = 8,            /* 20 ticks in a row were each later than a period. After a single stall of 20 ms or
                                   more the force only ramps up again. VIRTUAL: neither happens */
  FS_FAULT_FORCE_32 = 0x7fffffff
} fs_fault;

/* [rt] The name of the lowest of these fs_fault bits, such as "FS_FAULT_SPEED"; for 0 "no fault". Static, never null,
 * not even for a bit that is no fault. To print all of them:
 *     for (; faults; faults &= faults - 1) puts(fs_fault_name(faults)); */
FS_API const char *fs_fault_name(uint32_t faults);

/* The protections that negative options switched off; bits. SLEW is also set where no slew_limit follows from a
 * max_stiffness of none. */
enum {
  FS_OFF_SLEW = 1,              /* slew_limit */
  FS_OFF_SPEED = 2,             /* speed_limit */
  FS_OFF_STIFFNESS = 4,         /* max_stiffness */
  FS_OFF_DAMPING = 8,           /* damping */
  FS_OFF_RAMP = 16,             /* ramp */
  FS_OFF_FADE = 32,             /* fade */
  FS_OFF_BLEND = 64             /* blend */
};

/* How well a servo runs. Growing; made by fs_servo_stats_init. Percentiles are at most 3.2 % too high, maxima are
 * exact. */
typedef struct fs_servo_stats {
  uint32_t struct_size;         /* sizeof(fs_servo_stats), by fs_servo_stats_init */
  fs_realtime realtime;         /* what the system granted */
  uint32_t faults,              /* present fs_fault bits */
           protections_off;     /* FS_OFF_ bits */
  double rate;                  /* Hz, achieved in the last 10 s */
  double max_stiffness;         /* N/m at the device, the bound that is applied; infinite: none */
  double damping;               /* N s/m, local, as applied: by the servo, or by the device's remote controller */
  double energy;                /* J given to the hand minus J taken from it since the start: each tick's wrench times
                                   the way until the next; for information only */
  uint64_t ticks,               /* since the start */
           misses;              /* since the start; a miss is a tick later than a period, which is skipped */
  uint64_t device_errors,       /* ticks with a failed read or write */
           guarded;             /* ticks whose force was changed by a limit or a fault, or because the servo was not
                                   enabled (the ramp does not count) */
  uint64_t approximated;        /* ticks with error_bound > 0 */
  double late_p50, late_p99, late_max,            /* s from a tick's due time to its beginning, of the last 10 s */
         compute_p50, compute_p99, compute_max;   /* s that a tick took, of the last 10 s */
  uint32_t enabled,             /* 1; 0: fs_servo_set_enabled(servo, false) holds the force at 0. No event tells it, and
                                   it is no fault; a fault leaves it as it is */
           reserved;            /* 0 */
  double delay;                 /* s, for which max_stiffness and damping are worked out: as fs_servo_options.delay says, as
                                   the driver measures it, or else fs_device_info.delay */
  double link_delay_p50, link_delay_p99,          /* s from pose to force, as the driver measures it; 0: it does not */
         link_rate,             /* Hz, poses that come from the device, measured; 0: not known */
         link_loss;             /* 0..1, the part of poses and forces that is lost, measured */
} fs_servo_stats;
FS_DEFINE_INIT(fs_servo_stats)

/* The record of one tick. Frozen. */
typedef struct fs_tick {
  fs_state state;               /* device frame; all zeros if the read failed */
  fs_response response;         /* of all scenes, device frame, before the guard; proxy: of the scene in which it is
                                   farthest from the hand */
  fs_wrench sent;               /* device frame, after the guard; of a local model f0 */
  double late, compute;         /* s from its due time to its beginning; s it took */
  fs_status device;             /* the status of read or write: of the first that failed */
  uint32_t faults;              /* fs_fault bits */
} fs_tick;

/* Runs read, evaluate, guard, write until stopped, even when the caller has given back scene and device. options null:
 * defaults. Stored times are converted to the servo's clock, and fades that are under way end at once. A scene or
 * device has one servo at most: STATE. A connected scene, or an option that does not exist yet: UNSUPPORTED. VERSION;
 * IO: no thread. */
FS_API fs_status fs_servo_start(fs_scene *scene, fs_device *device, const fs_servo_options *options, fs_servo **out);

/* [rt] Runs this number of ticks at once, in this thread; never waits. In VIRTUAL mode, for which no device waits, it also
 * works out the bounds of objects between ticks, and allocates for that. Only one thread may step at a time: STATE.
 * DISCONNECTED: at the last tick the device was lost or not ready (all ticks ran; you may go on). STATE is also
 * returned when another thread stops the servo meanwhile: the remaining ticks do not run, and no call with this handle
 * may follow. Mode THREAD: UNSUPPORTED. */
FS_API fs_status fs_servo_step(fs_servo *servo, uint64_t ticks);

/* [rt] false: no force, from the next tick on (fs_servo_stats.enabled tells it). true: clears a latched fault, and
 * the force ramps up again; it changes nothing if the servo is enabled and has no such fault. If the cause of the
 * fault persists, the fault latches again, each time with an FS_EVENT_DEVICE. A servo starts enabled. */
FS_API fs_status fs_servo_set_enabled(fs_servo *servo, bool enabled);

/* Ends the force at once, as fs_servo_set_enabled(servo, false) of the servo that runs this scene, in this process or at
 * the server: what the stop button of an editor calls. Only the user of the servo lets the force return. When it
 * returns, the server has done it; the next tick sends force 0. No servo: STATE. Connected: DENIED (the server's
 * no_stop), TIMEOUT (1 s); it overtakes the changes of a group that is open. */
FS_API fs_status fs_scene_stop_force(fs_scene *scene);

/* Lets the force return, as fs_servo_set_enabled(servo, true) of the servo that runs this scene, in this process or at the
 * server: it also clears a latched fault, and the force ramps up. Call it when a person who sees the device says so, as
 * `forceserver resume` does. No servo: STATE. Connected: DENIED (the server is another user's; root may),
 * TIMEOUT (1 s); it overtakes the changes of a group that is open. */
FS_API fs_status fs_scene_resume_force(fs_scene *scene);

/* Stops the servo; null does nothing. First the force is set to 0 and the ticks end (if the device fails to take the
 * force, it is tried again for 20 ms), then the clients of its server are disconnected. Unlike with other handles,
 * another thread may be in fs_servo_step, which then ends early, or in another fs_servo_stop: both return when the
 * servo is stopped. Scene and device can have another servo afterwards; but where a driver with FS_DRIVER_IN_SERVO hangs, this
 * returns after a second, and the device stays with this servo, silent, until the process ends. */
FS_API void fs_servo_stop(fs_servo *servo);

/* [rt] The last tick of the servo that runs this scene, in this process or at the server; no servo: STATE. state: the
 * hand; response: of this scene alone; sent: what the device got from all scenes, after the guard, along this scene's
 * axes. Each of the three may be null. Before the first tick all values are 0, and poses are the identity. */
FS_API fs_status fs_scene_get_hand(const fs_scene *scene, fs_state *state, fs_response *response, fs_wrench *sent);

/* Fills out, which fs_servo_stats_init made, from the servo that runs this scene; no servo: STATE. VERSION. */
FS_API fs_status fs_scene_get_servo_stats(fs_scene *scene, fs_servo_stats *out);

/* Fills out, which fs_device_info_init made, with the device of the servo that runs this scene; no servo: STATE.
 * VERSION. */
FS_API fs_status fs_scene_get_device_info(fs_scene *scene, fs_device_info *out);

/* The flight record, a list: the newest ticks, oldest first, 2 s at most; a buffer that is too small gets the newest. A
 * latched fault stops the record, with the tick of the fault as the last, until the servo is enabled again;
 * FS_FAULT_DEVICE does not stop it. */
FS_API fs_status fs_servo_get_record(fs_servo *servo, fs_tick *out, size_t capacity, size_t *count);

/* A tick of the flight record, with its number. Frozen. */
typedef struct fs_recorded_tick {
  uint64_t number;              /* of the recorded ticks, from 1 on; those that come while a fault stops the record
                                   have none. A new servo begins at 1: ask it with after = 0 */
  fs_tick tick;                 /* in the device frame, whatever the frame of the scene */
} fs_recorded_tick;

/* The flight record of the servo that runs this scene, in this process or at the server: a list of its ticks with numbers
 * above `after`, oldest first; 0: all. To log or draw every tick, call it some times a second with the last number that
 * you have. A buffer that is too small gets the oldest ones, and the next call gives the rest. A gap in the numbers:
 * those ticks were too old to be kept; a tick that the servo missed (fs_servo_stats.misses) has no number, and shows in
 * the times. No servo: STATE. TIMEOUT: the next call gives them. FULL, IO. */
FS_API fs_status fs_scene_get_record(fs_scene *scene, uint64_t after, fs_recorded_tick *out, size_t capacity,
                                     size_t *count);

#ifdef __cplusplus
}
#endif
#endif
