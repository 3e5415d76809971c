/* forceserver/evaluate.h - the force that a tool feels in a scene. Conventions: forceserver.h. */
#ifndef FORCESERVER_EVALUATE_H
#define FORCESERVER_EVALUATE_H

#include <forceserver/scene.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { FS_STATE_READY = 1, FS_STATE_CLUTCHED = 2 };     /* READY: connected, homed, fresh; else a servo sends 0 */
typedef struct fs_state {               /* the handle. Frozen; all zeros is a good one */
  fs_pose pose;
  fs_twist twist;
  double time;                          /* s; FS_NOW */
  uint32_t buttons, flags;              /* bit i: button i; FS_STATE_ bits, not used by evaluation */
  double reserved[4];
} fs_state;

enum { FS_RESPONSE_CONTACT = 1, FS_RESPONSE_CAPPED = 2, FS_RESPONSE_FADING = 4, FS_RESPONSE_GUARDED = 8 };
typedef struct fs_response {            /* frozen */
  fs_wrench wrench;
  fs_mat3 stiffness;                    /* dF/dx, N/m, as capped */
  fs_pose proxy;                        /* of the tool: the rigid pose that best fits the proxies of its points */
  uint32_t felt_count, flags;           /* objects with a force; FS_RESPONSE_ bits */
  double error_bound;                   /* N, certified: |force - exact force| as vectors; 0: exact. More than 0 only when
                                           fs_scene_set_accuracy allows, or when a servo's tick ran out of time */
  double reserved[3];
} fs_response;

/* A tool for a loop of one's own: no frame, fade, blend or guard (see FS_SERVO_CALLER). points null, count 0: those of
 * fs_scene_set_tool. One thread at a time a tool; as many tools as one likes. Connected: the scene's own objects,
 * evaluated in this process. */
FS_API fs_status fs_tool_create(fs_scene *scene, const fs_vec3 *points, size_t count, fs_tool **out);
FS_API fs_status fs_evaluate(fs_tool *tool, const fs_state *state, fs_response *out); /* [rt] failed: out is zeros */
FS_API fs_status fs_tool_reset(fs_tool *tool);          /* [rt] forgets its proxies: the hand was put elsewhere */
FS_API void fs_tool_destroy(fs_tool *tool);
/* The field a point without memory feels (KEEP_EITHER: no contact), of one own object or, name null, of all: for
 * plots. time: FS_NOW. NOT_FOUND. */
FS_API fs_status fs_evaluate_field(fs_scene *scene, const char *name, double time, const fs_vec3 *positions,
                                   size_t count, fs_vec3 *forces);

#ifdef __cplusplus
}
#endif
#endif
