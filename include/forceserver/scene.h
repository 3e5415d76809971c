/* forceserver/scene.h - the set of force-objects of one application. Conventions: forceserver.h. */
#ifndef FORCESERVER_SCENE_H
#define FORCESERVER_SCENE_H

#include <forceserver/object.h>

#ifdef __cplusplus
extern "C" {
#endif

FS_API fs_status fs_scene_create(fs_scene **out);       /* in this process */
/* To a server of this user: "shm:NAME" or "dds:DOMAIN", then "?timeout=2"; of another one: "shm:NAME?user=USER".
 * client_name: as an object's, but not "server"; free again as soon as its process is dead. Its objects live as long as
 * the process, silent or not. NOT_FOUND, EXISTS, VERSION, DENIED, FULL, TIMEOUT, UNSUPPORTED. */
FS_API fs_status fs_scene_connect(const char *endpoint, const char *client_name, fs_scene **out);
FS_API void fs_scene_destroy(fs_scene *scene);          /* connected: its objects fade */

/* Adds, under a servo fading in; of a name that exists it changes the parts that differ (pose, profiles and contact as
 * fs_object_change does; for the rest the old object fades out while the new one fades in). Connected: checked here, sent
 * without waiting; a mesh is felt when the server has built it (FS_EVENT_READY, _REFUSED). FULL. */
FS_API fs_status fs_object_set(fs_scene *scene, const fs_object *object);

typedef enum fs_part {                  /* bits */
  FS_PART_POSE = 1,                     /* pose, twist, time */
  FS_PART_PROFILES = 2,                 /* front, back, damping, start */
  FS_PART_CONTACT = 4,
  FS_PART_SHAPE = 8,
  FS_PART_OTHER = 16,                   /* lifetime, tool_points, enabled */
  FS_PART_FORCE_32 = 0x7fffffff
} fs_part;
/* From here on a name may also be "client/object": another client's, in that client's frame. NOT_FOUND, DENIED. get: out
 * made by fs_object_init, any name: struct_size is read, no more than that is written. Release it. TIMEOUT (1 s). */
FS_API fs_status fs_object_get(fs_scene *scene, const char *name, fs_object *out);
FS_API fs_status fs_object_change(fs_scene *scene, const fs_object *object, uint32_t parts);  /* only these parts:
                                                     an editor does not undo the owner's moves */
/* Cheap, for meshes too. The next tick feels it; connected (own objects), no system call, and the server takes it at the
 * servo's rate. twist null: worked out from this and the last move or set (none in the last 0.2 s: 0) and used for at most
 * twice the time between them; of two within 1 ms the later pose replaces the earlier. An older time than the last one
 * is taken with twist 0. Evaluation extrapolates from `time`, never back and for 0.1 s at most. */
FS_API fs_status fs_object_move(fs_scene *scene, const char *name, const fs_pose *pose, const fs_twist *twist,
                                      double time);
FS_API fs_status fs_object_remove(fs_scene *scene, const char *name);
FS_API fs_status fs_scene_clear(fs_scene *scene);       /* its own objects */

/* Several changes, one tick. A call that fails adds nothing; commit applies all or nothing. Getters see the group,
 * evaluation does not; calls of other threads join it. A second begin, or nothing begun: STATE. */
FS_API fs_status fs_scene_begin(fs_scene *scene);
FS_API fs_status fs_scene_commit(fs_scene *scene);
FS_API fs_status fs_scene_cancel(fs_scene *scene);
/* Waits (timeout s) until a tick has used all changes so far, faded in or not (no servo: at once; VIRTUAL: another thread
 * must step): TIMEOUT, or the status of the first one refused. */
FS_API fs_status fs_scene_sync(fs_scene *scene, double timeout);

/* Its own objects, frame and tool, as JSON; meshes beside it as PLY. Load adds or replaces, all or nothing. IO, PARSE. */
FS_API fs_status fs_scene_save(fs_scene *scene, const char *path);
FS_API fs_status fs_scene_load(fs_scene *scene, const char *path);

typedef struct fs_frame {               /* x_device = pose * (x_scene / scale), F_device = force_scale * (the orientation
                                           of pose turns F): a slope k is scale*force_scale*k at the device. Frozen */
  fs_pose pose;                         /* scene to device, device metres */
  double scale;                         /* scene metres a device metre, > 0 */
  double force_scale;                   /* >= 0; 0: not felt. Torque arms count in device metres */
} fs_frame;
static inline fs_frame fs_frame_init(void)
{ fs_frame f; memset(&f, 0, sizeof f); f.pose.orientation.w = f.scale = f.force_scale = 1.0; return f; }
/* A new frame (as a new tool) puts the tool elsewhere: what was felt fades out there while the new fades in, without
 * proxies. */
FS_API fs_status fs_scene_set_frame(fs_scene *scene, const fs_frame *frame);
FS_API fs_status fs_scene_get_frame(fs_scene *scene, const char *client, fs_frame *out);    /* null: its own; NOT_FOUND */
/* held: the hand moves, the tool stays, the force of this scene fades out; let go: the frame is moved (not turned) so that
 * the tool's position does not jump, its orientation is the hand's again, and the force fades in. */
FS_API fs_status fs_scene_set_clutch(fs_scene *scene, bool held);

/* The tool's 1..32 points, frame of the handle, scene metres; by default one, (0, 0, 0). Profiles act as the mean over
 * the points that feel the object (tool_points), contacts as their sum; an object's total force keeps its limit. */
FS_API fs_status fs_scene_set_tool(fs_scene *scene, const fs_vec3 *points, size_t count);
FS_API fs_status fs_scene_get_tool(fs_scene *scene, fs_vec3 *out, size_t capacity, size_t *count);

FS_API fs_status fs_scene_set_accuracy(fs_scene *scene, double newtons);    /* error allowed, >= 0; 0 (default): exact */
/* Bound of the summed slope of overlapping objects, N/m at the device; above it they are scaled together, never the
 * force raised. 0 (default): what the servo can render; no servo: none. Connected: of its own objects; can only lower
 * what the server gives them. */
FS_API fs_status fs_scene_set_max_stiffness(fs_scene *scene, double stiffness);
/* The clock: monotonic, of the machine that evaluates (one machine: the same in every process), or the servo's virtual
 * time: when a servo's start or stop changes it, stored times shift along, so ages stay. set (> 0; in-process, without
 * a servo, else STATE): time is what the caller says, until it says more. */
FS_API fs_status fs_scene_get_time(const fs_scene *scene, double *out);     /* [rt] */
FS_API fs_status fs_scene_set_time(fs_scene *scene, double time);           /* [rt] */

typedef enum fs_object_state {
  FS_OBJECT_PENDING = 0, FS_OBJECT_FELT = 1, FS_OBJECT_FADING = 2, FS_OBJECT_DISABLED = 3, FS_OBJECT_REFUSED = 4,
  FS_OBJECT_FORCE_32 = 0x7fffffff
} fs_object_state;
typedef struct fs_report {              /* what became of an object. Frozen */
  char name[FS_NAME_SIZE];              /* another client's: "client/object" */
  fs_primitive primitive;
  fs_object_state state;
  uint64_t revision;                    /* grows with every change but moves */
  double weight;                        /* 0..1; between: FADING, in or out */
  double stiffness_wanted;              /* N/m at the device, steepest slope of profiles and contact; may be infinite */
  double stiffness_applied;             /* N/m at the device; below wanted: capped */
  double distance;                      /* m, at the last tick, as are point and wrench; infinite: not near */
  fs_vec3 point;                        /* p, or the proxy; in the asking scene's frame */
  fs_wrench wrench;                     /* its share, before the guard; in the asking scene's frame */
  double reserved[4];
} fs_report;
/* All objects it can see; connected: of all clients, the server's own scene being "server". Without a servo nothing
 * is near. One: NOT_FOUND. */
FS_API fs_status fs_scene_get_reports(fs_scene *scene, fs_report *out, size_t capacity, size_t *count);
FS_API fs_status fs_scene_get_report(fs_scene *scene, const char *name, fs_report *out);

typedef enum fs_event_kind {
  FS_EVENT_NONE = 0,                    /* nothing within the timeout */
  FS_EVENT_READY = 1,                   /* a pending object is felt */
  FS_EVENT_REFUSED = 2,                 /* the server did not take an object: status, text */
  FS_EVENT_CAPPED = 3,                  /* stiffness_applied changed by over 10 %: value, N/m; at most one a second */
  FS_EVENT_EDITED = 4,                  /* another client (text) changed or removed an object of this one */
  FS_EVENT_EXPIRED = 5,                 /* an object outlived its lifetime: it stays, at weight 0, until set or moved */
  FS_EVENT_DEVICE = 6,                  /* device ready (FS_OK), lost or stopped by a fault: status, text */
  FS_EVENT_DISCONNECTED = 7,            /* server gone; the last event: make a new scene */
  FS_EVENT_OVERFLOW = 8,                /* value older events were dropped, never fetched */
  FS_EVENT_FORCE_32 = 0x7fffffff
} fs_event_kind;
typedef struct fs_event {               /* frozen */
  fs_event_kind kind;
  fs_status status;
  double time, value;
  char name[FS_NAME_SIZE], text[168];
} fs_event;
FS_API fs_status fs_scene_next_event(fs_scene *scene, double timeout, fs_event *out);   /* s; 0: does not wait */

#ifdef __cplusplus
}
#endif
#endif
