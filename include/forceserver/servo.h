/* forceserver/servo.h - the loop read, evaluate, guard, write. Conventions: forceserver.h. */
#ifndef FORCESERVER_SERVO_H
#define FORCESERVER_SERVO_H

#include <forceserver/device.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum fs_servo_mode {
  FS_SERVO_THREAD = 0,                  /* its own real-time thread */
  FS_SERVO_CALLER = 1,                  /* the caller's loop calls fs_servo_step(servo, 1): a tick now, real clock */
  FS_SERVO_VIRTUAL = 2,                 /* fs_servo_step; tick k = 1, 2.. is at k/rate s: tests, simulations */
  FS_SERVO_FORCE_32 = 0x7fffffff
} fs_servo_mode;
typedef struct fs_servo_options {       /* growing; all zeros are the defaults; "none": fs_servo_stats says so */
  uint32_t struct_size;
  fs_servo_mode mode;
  double rate;                          /* Hz, 100..20000; 0: the device's */
  double force_limit, torque_limit;     /* N, N m, at most the device's; 0: the device's */
  double slew_limit;                    /* N/s of the whole force, against faults only: below what a hard wall needs it
                                           makes a loop unstable; 0: 3 m/s times max_stiffness; negative: none */
  double speed_limit;                   /* m/s of the hand, a fault above; 0: 2; negative: none */
  double ramp;                          /* s to full force at the start and after a fault; 0: 0.5; negative: none */
  double fade;                          /* s for an object that comes or goes; 0: 1.0; negative: none */
  double blend;                         /* s over which a moved or changed object settles; 0: 0.02; negative: none */
  double delay;                         /* s of the loop, beside its period; 0: the device's */
  double damping;                       /* N s/m, local, filtered at 100 Hz; 0: 5, or less where the loop cannot carry
                                           it; negative: none */
  double max_stiffness;                 /* N/m shared by all; 0: what the loop can render; negative: none. Both as
                                           applied: fs_servo_stats */
  int32_t priority;                     /* SCHED_FIFO 1..99; 0: 80; negative: ordinary */
  int32_t cpu;                          /* n > 0: processor n-1; 0: any */
} fs_servo_options;
FS_DEFINE_INIT(fs_servo_options)

typedef enum fs_realtime {              /* what the system granted */
  FS_REALTIME_NONE = 0, FS_REALTIME_NICE = 1, FS_REALTIME_FIFO = 2, FS_REALTIME_FIFO_LOCKED = 3,
  FS_REALTIME_FORCE_32 = 0x7fffffff
} fs_realtime;
typedef enum fs_fault {                 /* bits. DEVICE ends by itself, through the ramp; the others hold the force at 0
                                           until fs_servo_set_enabled(servo, true) */
  FS_FAULT_DEVICE = 1,                  /* not ready, lost, or its pose older than 20 ms (its time 0: now) */
  FS_FAULT_SPEED = 2,                   /* the hand above speed_limit */
  FS_FAULT_NUMBER = 4,                  /* a pose or force that is not finite */
  FS_FAULT_LATE = 8,                    /* 20 ticks in a row, each later than a period; after one stall of 20 ms or
                                           more the force only ramps */
  FS_FAULT_FORCE_32 = 0x7fffffff
} fs_fault;
enum {                                  /* what negative options switched off */
  FS_OFF_SLEW = 1, FS_OFF_SPEED = 2, FS_OFF_STIFFNESS = 4, FS_OFF_DAMPING = 8, FS_OFF_RAMP = 16, FS_OFF_FADE = 32,
  FS_OFF_BLEND = 64
};
typedef struct fs_servo_stats {         /* growing */
  uint32_t struct_size;
  fs_realtime realtime;
  uint32_t faults, protections_off;     /* fs_fault bits now; FS_OFF_ bits */
  double rate;                          /* Hz, reached */
  double max_stiffness;                 /* N/m at the device, the budget in force; infinite: none */
  double damping;                       /* N s/m, local, as applied */
  double energy;                        /* J given to the hand less J taken since the start; it only reports */
  uint64_t ticks, misses;               /* since the start; a miss is later than a period, and skipped */
  uint64_t device_errors, guarded;      /* ticks with a failed read or write; whose force a limit or fault changed */
  uint64_t approximated;                /* ticks with error_bound > 0 */
  double late_p50, late_p99, late_max, compute_p50, compute_p99, compute_max;   /* s, of the last 10 s */
} fs_servo_stats;
FS_DEFINE_INIT(fs_servo_stats)
typedef struct fs_tick {                /* one tick as it was. Frozen */
  fs_state state;                       /* device frame */
  fs_response response;                 /* of all scenes, device frame, before the guard */
  fs_wrench sent;
  double late, compute;                 /* s */
  fs_status device;                     /* of read and write */
  uint32_t faults;                      /* fs_fault bits */
} fs_tick;

/* Runs read, evaluate, guard, write, until stopped, also when the caller has let go of scene and device. options null:
 * defaults. A scene or device has one servo at most: STATE. Connected scene: UNSUPPORTED. */
FS_API fs_status fs_servo_start(fs_scene *scene, fs_device *device, const fs_servo_options *options, fs_servo **out);
/* [rt] Never waits. DISCONNECTED: at the last tick the device was lost (all ticks ran; go on). THREAD: UNSUPPORTED. */
FS_API fs_status fs_servo_step(fs_servo *servo, uint64_t ticks);
FS_API fs_status fs_servo_set_enabled(fs_servo *servo, bool enabled);   /* [rt] false: no force at once; true: ramps */
FS_API void fs_servo_stop(fs_servo *servo);             /* force to 0 first; its server's clients are disconnected */

/* [rt] Of the servo that runs this scene, here or at the server; none: STATE. state: the hand, last tick; response: of
 * this scene alone; sent: what the device got of all scenes, after the guard, along this scene's axes. Null: not asked */
FS_API fs_status fs_scene_get_hand(const fs_scene *scene, fs_state *state, fs_response *response, fs_wrench *sent);
FS_API fs_status fs_scene_get_servo_stats(fs_scene *scene, fs_servo_stats *out);
FS_API fs_status fs_scene_get_device_info(fs_scene *scene, fs_device_info *out);
/* The flight record: the newest ticks, oldest first, 2 s at most; a fault stops it until the servo is enabled again.
 * Connected: UNSUPPORTED. */
FS_API fs_status fs_servo_get_record(fs_servo *servo, fs_tick *out, size_t capacity, size_t *count);

#ifdef __cplusplus
}
#endif
#endif
