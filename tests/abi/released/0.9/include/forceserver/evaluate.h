/* forceserver/evaluate.h - the force that a tool feels in a scene, for your own loop. Conventions: forceserver.h.
 *
 * Here the application is responsible for time, device and safety: frame, fade, blend and guard belong to the servo
 * (servo.h). For your own loop with all of them see FS_SERVO_CALLER.
 */
#ifndef FORCESERVER_EVALUATE_H
#define FORCESERVER_EVALUATE_H

#include <forceserver/scene.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Bits of fs_state.flags; evaluation does not look at them. */
enum {
  FS_STATE_READY = 1,           /* connected, homed, fresh; without this flag a servo sends 0. Until a device first sets it
                                   the servo knows no hand: nothing is felt, and no solid holds it.
                                   After a gap of up to 0.1 s solids hold the hand as before; after a
                                   longer one it begins anew where it is */
  FS_STATE_CLUTCHED = 2,        /* from fs_scene_get_hand: the clutch is held, the tool does not follow the hand */
  /* Why a device is not ready: */
  FS_STATE_CONNECTING = 4,      /* it does not answer yet */
  FS_STATE_FIRMWARE_MISSING = 8,/* it must be given its firmware first */
  FS_STATE_NOT_HOMED = 16,      /* it does not know where its handle is */
  FS_STATE_IN_HOLDER = 32,      /* its handle is in its holder or inkwell */
  FS_STATE_STOPPED = 64,        /* its motors are off: an emergency stop, a force switch, a dead man's switch, no
                                   power, or they are too warm */
  FS_STATE_TOO_FAST = 128       /* it has switched its motors off, because the handle was too fast */
};

/* [rt] Why a device in a state with these flags is not ready, in a sentence without a full stop, of the lowest bit from
 * FS_STATE_CONNECTING on; "" if none of them is set. Static, never null. */
FS_API const char *fs_state_reason(uint32_t flags);

/* The state of the handle. Frozen; all zeros is a valid one. In the scene frame for a tool, in the device frame for a
 * device. */
typedef struct fs_state {
  fs_pose pose;                 /* of the handle */
  fs_twist twist;               /* its motion; the damping of objects needs it */
  double time;                  /* s, when the pose was measured; the scene is evaluated for this time; FS_NOW */
  uint32_t buttons,             /* bit i: button i is down */
           flags;               /* FS_STATE_ bits */
  double grip;                  /* 0..1, how far a gripper is open; 0 also without one */
  double reserved[3];           /* 0 */
} fs_state;

/* Bits of fs_response.flags. */
enum {
  FS_RESPONSE_CONTACT = 1,      /* a point of the tool touches a solid object */
  FS_RESPONSE_CAPPED = 2,       /* an object with a force has a bounded slope; only under a servo */
  FS_RESPONSE_FADING = 4,       /* an object with a force fades, or its profile is blended */
  FS_RESPONSE_GUARDED = 8       /* the servo changed the force that was sent: a limit, a fault, or it is not enabled */
};

/* What a tool feels. Frozen. */
typedef struct fs_response {
  fs_wrench wrench;             /* N; N m about the origin of the handle */
  fs_mat3 stiffness;            /* dF/dx, N/m, as capped, without the damping */
  fs_pose proxy;                /* of the tool: the rigid pose that best fits the proxies of its points; where it
                                   touches nothing, the tool's own. A point that is held by several proxies (object.h)
                                   counts with their mean, by stiffness */
  uint32_t felt_count,          /* number of objects with a force */
           flags;               /* FS_RESPONSE_ bits */
  double error_bound;           /* N, a certified bound of |force - exact force| (vectors); 0: exact. Above 0 only when
                                   fs_scene_set_accuracy allows it, or when the search of a mesh takes more than a
                                   servo's tick allows (a hand equally near to all of a large mesh) */
  double reserved[3];           /* 0 */
} fs_response;

/* A tool for your own loop, without frame, fade, blend or guard: it feels every object that is enabled and within its
 * lifetime in full, at once. points: count 1..32, frame of the handle, scene metres; null and 0: those of
 * fs_scene_set_tool, also when they change later. A scene can have any number of tools; each is used by one thread at a
 * time. Connected: it feels the scene's own objects, evaluated in this process. */
FS_API fs_status fs_tool_create(fs_scene *scene, const fs_vec3 *points, size_t count, fs_tool **out);

/* [rt] What the tool feels at state, with all changes made before the call (groups: once committed). If the call fails,
 * out is all zeros. The same input gives the same bits. */
FS_API fs_status fs_evaluate(fs_tool *tool, const fs_state *state, fs_response *out);

/* [rt] Forgets the tool's proxies. Call it when the hand was put elsewhere. */
FS_API fs_status fs_tool_reset(fs_tool *tool);

/* Gives the tool back; null does nothing. */
FS_API void fs_tool_destroy(fs_tool *tool);

/* The force field, for plots: forces[i] (N) is the force on a point that rests at positions[i] (m) and has no memory
 * (so FS_KEEP_EITHER gives no contact). It is that of the scene's own object `name` or, with name null, of all its own
 * objects, within the accuracy of the scene; disabled objects give 0. tool_points are ignored: the point feels every
 * object. time: s, scene's clock; FS_NOW. With count 0 the arrays may be null. Runs on all processors when there are
 * many positions. NOT_FOUND. */
FS_API fs_status fs_evaluate_field(fs_scene *scene, const char *name, double time, const fs_vec3 *positions,
                                   size_t count, fs_vec3 *forces);

#ifdef __cplusplus
}
#endif
#endif
