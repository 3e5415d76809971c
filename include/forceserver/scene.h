/* forceserver/scene.h - the set of force-objects of one application. Conventions: forceserver.h.
 *
 * A scene is data: it can be saved, sent to another process, edited and drawn. It lives in this process, or it is
 * connected to a server that several applications share; "connected:" in a comment is about the latter.
 *
 * No step in force. Under a servo every object has a weight that goes from 0 to 1 and back, linear in time, over
 * fs_servo_options.fade; it begins at the first tick that uses the change. Whatever is called in whatever order, a tick
 * moves a weight by its period / fade at most. A removed object is kept, nameless, until its weight is 0; a name set
 * again meanwhile goes on from its weight. What cannot be adjusted while it is felt (an object's primitive, shape or
 * tool points; a scene's frame or tool) has versions: the new one fades in while the old one fades out. A version that
 * comes while another is still fading in waits until that one is felt in full; of several that wait only the newest is
 * kept. So a stream of versions that is faster than the fade is felt as a chain of full cross-fades.
 * Without a servo, and for a tool of one's own (evaluate.h), what is there is felt in full at once.
 */
#ifndef FORCESERVER_SCENE_H
#define FORCESERVER_SCENE_H

#include <forceserver/object.h>

#ifdef __cplusplus
extern "C" {
#endif

/* An empty scene in this process. */
FS_API fs_status fs_scene_create(fs_scene **out);

/* A scene at a server of this user: "shm:NAME" or "dds:DOMAIN"; of another user's: "shm:NAME?user=USER". Options are
 * joined by '&'. "timeout=5": waits for a server that is not there yet or does not answer, 5 s at most; without
 * it: NOT_FOUND at once, TIMEOUT after 2 s. client_name: as an object's, but not "server"; free again as soon as its
 * process is dead. Its objects live as long as the process, silent or not. A server that is lost stays lost for this
 * scene: its calls give DISCONNECTED; so they do after a change amid which this process ran out of memory. After fork
 * the scene is the parent's. NOT_FOUND, EXISTS, VERSION (the sentence has what differs), DENIED, FULL, TIMEOUT, IO,
 * UNSUPPORTED. 0.1: dds is UNSUPPORTED. */
FS_API fs_status fs_scene_connect(const char *endpoint, const char *client_name, fs_scene **out);

/* Gives the scene back; null does nothing. A servo or tool that uses it goes on; connected: its objects fade. */
FS_API void fs_scene_destroy(fs_scene *scene);

/* ---- Objects */

/* Adds an object, under a servo fading in; of a name that exists it changes the parts that differ:
 * - pose, profiles and contact, as fs_object_change does (0.1: at once);
 * - `enabled` fades the same object out or in;
 * - a new primitive, shape or tool_points is another version, which cross-fades with the one before (top of this file).
 * A mesh whose tree is not built yet is built in this call, without holding up the servo. Connected: checked here and
 * sent (forceserver.h, Waiting); a mesh is felt when the server has built it (FS_EVENT_READY, _REFUSED). A scene holds
 * 1,048,576 objects at most, those still fading out included; connected: as many as the server's max_objects: FULL.
 * VERSION. */
FS_API fs_status fs_object_set(fs_scene *scene, const fs_object *object);

/* Parts of an object; bits. */
typedef enum fs_part {
  FS_PART_POSE = 1,             /* pose, twist, time */
  FS_PART_PROFILES = 2,         /* front, back, damping, start */
  FS_PART_CONTACT = 4,          /* contact */
  FS_PART_SHAPE = 8,            /* primitive, shape */
  FS_PART_OTHER = 16,           /* lifetime, tool_points, enabled */
  FS_PART_FORCE_32 = 0x7fffffff
} fs_part;

/* ---- From here on a name may also be "client/object", of a connected scene: another client's, in that client's
 * frame; "server/object": of the server's own scene. Such a call asks the server: TIMEOUT (1 s), NOT_FOUND, DENIED
 * (it is `locked`). After another client has changed an own object, or a change of it was refused, the next call about
 * it asks the server as well. An object that is new and was refused stays here (FS_OBJECT_REFUSED): it can be set or
 * changed again, which sends all of it, or removed. Of any other object the change that was refused is taken back. */

/* Fills out, which was made by fs_object_init with any name: struct_size is read, no more than that is written.
 * Another client's object has the name it was asked by, so it can be changed as it stands. Release it
 * (fs_object_release), also before it is filled again: its handles live until then. NOT_FOUND, VERSION. */
FS_API fs_status fs_object_get(fs_scene *scene, const char *name, fs_object *out);

/* Takes only these parts (fs_part bits) of object, for the one of its name: an editor does not undo the owner's
 * moves. The rest of object is not looked at, but for name and struct_size; the whole must be a good object
 * afterwards. parts 0 changes nothing. NOT_FOUND, DENIED, VERSION. */
FS_API fs_status fs_object_change(fs_scene *scene, const fs_object *object, uint32_t parts);

/* Moves an object: it has pose at time (s, scene's clock; FS_NOW) and twist from then on. Cheap, for meshes too. The
 * next tick feels it. Connected, of an own object: it never waits, normally without a system call, and the server takes
 * it at its rate. To put an object somewhere once, give a zero twist: null is for streams of moves.
 * twist null: worked out from this and the last move or set (none in the last 0.2 s: 0) and used for at most twice
 * the time between them, so the last of a stream comes to rest up to two steps beyond; with a zero twist it stands
 * where it is put. Of two within 1 ms the later pose replaces the earlier. An older time than the last one is taken
 * with twist 0. Evaluation extrapolates from `time`, never back and for 0.1 s at most. NOT_FOUND, DENIED. */
FS_API fs_status fs_object_move(fs_scene *scene, const char *name, const fs_pose *pose, const fs_twist *twist,
                                      double time);

/* Removes an object; under a servo it fades out. NOT_FOUND, DENIED. */
FS_API fs_status fs_object_remove(fs_scene *scene, const char *name);

/* Removes all of the scene's own objects. Frame, clutch and tool stay. */
FS_API fs_status fs_scene_clear(fs_scene *scene);

/* ---- Groups: several changes, one tick. A call that fails adds nothing. Getters see the group, evaluation does not;
 * calls of other threads join it. Connected: changes, moves and removals of other clients' objects belong to it too;
 * each client feels its part from one tick on. At most 4 max_objects + 64 changes: FULL. */

/* Opens a group. STATE: one is open already. */
FS_API fs_status fs_scene_begin(fs_scene *scene);

/* Closes the group: all of it is felt from one tick on, or none of it. STATE: none is open. Connected: it is sent as a
 * whole, else the group stays open: TIMEOUT. If the server refuses a part (FS_EVENT_REFUSED, fs_scene_sync), it takes
 * nothing, and this process's scene is set back to what the server has. */
FS_API fs_status fs_scene_commit(fs_scene *scene);

/* Closes the group and takes back all of it. STATE: none is open. */
FS_API fs_status fs_scene_cancel(fs_scene *scene);

/* Waits, timeout s (>= 0) at most, until a tick has used all changes so far, faded in or not; those of an open group
 * do not count. No servo: at once. VIRTUAL: another thread must step. TIMEOUT, or the status of the first change
 * refused. Connected: when it returns in time, getters show what the server has. */
FS_API fs_status fs_scene_sync(fs_scene *scene, double timeout);

/* ---- Files. A scene as JSON; its schema is share/forceserver/scene.schema.json:
 *
 *     {"forceserver": "scene", "version": 1,
 *      "shapes": {"part": {"file": "part.ply"}, "line": {"points": [[0, 0, 0], [0.1, 0, 0]]}},
 *      "curves": {"pulse": {"expression": "2*(1+sin(12*t))"}},
 *      "objects": [{"name": "a", "primitive": "mesh", "shape": "part", "pose": {"position": [0, 0, 0.05]},
 *                   "back": {"kind": "linear_increasing", "sense": "attractive", "gain": 500, "limit": 10}}]}
 *
 * Names are those of this header: fields as they are, enum values in lower case without their prefix. What is left
 * out is 0, the default frame or tool, and `enabled`; a key that is not known or there twice is an error. A mesh may
 * be OBJ, PLY, STL or OFF, beside the file or below. `time` is not kept: loading is setting now. Of a `start` that was
 * given the file keeps the "age" (s), how long ago it was when saved; loading sets start = now - age, so f(d, t) goes
 * on where it was, on another machine too. A file may instead have the "start" itself; both are an error. */

/* Writes the scene's own objects, frame and tool; meshes beside it as PLY, named after the file and their content.
 * Every number comes back bit for bit, but for start: its age does, and start is within rounding of the clock (1e-9 s
 * for a clock below 4e6 s). The file is replaced as a whole or not at all. IO, INVALID (a name that is not UTF-8). */
FS_API fs_status fs_scene_save(fs_scene *scene, const char *path);

/* Adds or replaces the objects of a file, and sets frame and tool; all or nothing. Objects of other names stay.
 * Only regular files are read. NOT_FOUND, IO, PARSE, VERSION (a newer file), UNSUPPORTED, FULL. */
FS_API fs_status fs_scene_load(fs_scene *scene, const char *path);

/* ---- Frame, clutch, tool: where the scene's tool stands. A new frame or tool puts it elsewhere, and is another
 * version, as of an object: what was felt fades out there while the new fades in, without proxies. The clutch holds the
 * tool where it is, and lets it go from there. */

/* Scene to device: x_device = pose * (x_scene / scale), F_device = force_scale * (the orientation of pose turns F).
 * So a slope k of the scene is scale*force_scale*k at the device. Frozen. */
typedef struct fs_frame {
  fs_pose pose;                 /* scene to device, device metres */
  double scale;                 /* scene metres a device metre, 1e-9..1e9 */
  double force_scale;           /* 0..1e9; 0: not felt. Torque arms count in device metres */
} fs_frame;

/* The default: scene and device are the same. */
static inline fs_frame fs_frame_init(void)
{ fs_frame f; memset(&f, 0, sizeof f); f.pose.orientation.w = f.scale = f.force_scale = 1.0; return f; }

/* Sets the frame between the scene and the device. It is the servo's: tools of one's own do not see it. */
FS_API fs_status fs_scene_set_frame(fs_scene *scene, const fs_frame *frame);

/* The frame, as a clutch may have moved it. client: whose, of a connected scene; null: its own. NOT_FOUND. */
FS_API fs_status fs_scene_get_frame(fs_scene *scene, const char *client, fs_frame *out);

/* held: the hand moves, the tool stays, the force of this scene fades out; let go: the frame is moved (not turned) so
 * that the tool's position does not jump, its orientation is the hand's again, and the force fades in. What it is
 * already changes nothing. */
FS_API fs_status fs_scene_set_clutch(fs_scene *scene, bool held);

/* Sets the tool's points: count 1..32, frame of the handle, scene metres; by default one, (0, 0, 0). Profiles act as
 * the mean over the points that feel the object (tool_points), contacts as their sum; an object's total force keeps
 * its limit. Several points make a torque about the handle's origin too. */
FS_API fs_status fs_scene_set_tool(fs_scene *scene, const fs_vec3 *points, size_t count);

/* The tool's points, a list. */
FS_API fs_status fs_scene_get_tool(fs_scene *scene, fs_vec3 *out, size_t capacity, size_t *count);

/* Where the tool of a scene stands: all that is needed to draw it. Frozen. */
typedef struct fs_view {
  fs_frame frame;               /* as fs_scene_get_frame gives it */
  fs_pose tool;                 /* of the handle at the last tick, in that scene's frame: the hand's, or the one at
                                   which the clutch holds it. The identity before the first tick and without a servo */
  fs_vec3 points[FS_TOOL_POINTS_MAX]; /* of the tool, m, frame of the handle: the first point_count; the rest 0 */
  uint32_t point_count;         /* 1..32 */
  bool held;                    /* the clutch */
  uint8_t reserved_8[3];        /* 0 */
  double reserved[4];           /* 0 */
} fs_view;

/* Frame, clutch and tool, all of one instant. client: whose, of a connected scene ("server": of the server's own
 * scene); null: its own, as an open group has them. Connected: TIMEOUT. NOT_FOUND. */
FS_API fs_status fs_scene_get_view(fs_scene *scene, const char *client, fs_view *out);

/* ---- Accuracy, slope, clock */

/* The error in the force that evaluation may make to be faster, N, >= 0; 0 (default): exact. fs_response.error_bound
 * is what it made. 0.1: always exact. */
FS_API fs_status fs_scene_set_accuracy(fs_scene *scene, double newtons);

/* Bound of the summed slope of overlapping objects, N/m at the device, >= 0; above it they are scaled together, never
 * the force raised. 0 (default): what the servo can render; no servo: none. Connected: of its own objects; can only
 * lower what the server gives them. 0.1: above 0 is UNSUPPORTED, and 0 is no bound under a servo either. */
FS_API fs_status fs_scene_set_max_stiffness(fs_scene *scene, double stiffness);

/* [rt] The clock, s: monotonic, of the machine that evaluates (one machine: the same in every process), or the
 * servo's virtual time: when a servo's start or stop changes it, stored times shift along, so ages stay. */
FS_API fs_status fs_scene_get_time(const fs_scene *scene, double *out);

/* [rt] From now on the clock is what the caller says, until it says more or a servo starts; > 0. For plots and tests.
 * STATE: not in this process, or with a servo. */
FS_API fs_status fs_scene_set_time(fs_scene *scene, double time);

/* ---- What became of it */

/* How far an object has come. */
typedef enum fs_object_state {
  FS_OBJECT_PENDING = 0,        /* no tick has used it yet */
  FS_OBJECT_FELT = 1,           /* in full; without a servo: there */
  FS_OBJECT_FADING = 2,         /* on its way in or out; or at weight 0, its lifetime being over */
  FS_OBJECT_DISABLED = 3,       /* `enabled` is false, and it has faded out */
  FS_OBJECT_REFUSED = 4,        /* connected: the server did not take it */
  FS_OBJECT_FORCE_32 = 0x7fffffff
} fs_object_state;

/* [rt] "FS_OBJECT_FELT"; static, never null, also for a number that is no state. */
FS_API const char *fs_object_state_name(fs_object_state state);

/* What became of an object. Frozen.
 *
 * A force jumps, and so asks for an infinite stiffness:
 * - of a point or polyline, at d = 0 unless f(0) = 0: it reverses from one side to the other;
 * - of a plane or mesh, at the surface unless front and back agree there in size and direction;
 * - at `reach` unless f(reach) = 0;
 * - of a polyline that is not straight, wherever it is felt: at every distance there are places that are equally near
 *   to two of its parts, and from one to the other the direction changes.
 * Of a mesh only the surface is looked at: the places, mostly deep inside, that are equally near to two of its parts
 * are not. */
typedef struct fs_report {
  char name[FS_NAME_SIZE];      /* another client's: "client/object" */
  fs_primitive primitive;       /* as set */
  fs_object_state state;        /* how far it has come */
  uint64_t revision;            /* grows with every change but moves */
  double weight;                /* 0..1; between: FADING, in or out */
  double stiffness_wanted;      /* N/m at the device, steepest slope of profiles and contact; infinite where the force
                                   jumps (above). Worked out once for a curve, when it is made: of a table
                                   it is never too low, of an expression an estimate by some hundred samples */
  double stiffness_applied;     /* N/m at the device; below wanted: capped. 0.1: as wanted */
  double distance;              /* m, at the last tick, of the tool point nearest to it; infinite: not near (beyond its
                                   force, weight 0, clutched, no servo), then point and wrench are 0 */
  fs_vec3 point;                /* p, or the proxy; in the asking scene's frame */
  fs_wrench wrench;             /* its share, with its weight, before the guard; along the asking scene's axes,
                                   another client's in newtons at the device */
  double reserved[4];           /* 0 */
} fs_report;

/* All objects it can see, a list; connected: of all clients, the server's own scene being "server"; TIMEOUT. Without
 * a servo nothing is near. */
FS_API fs_status fs_scene_get_reports(fs_scene *scene, fs_report *out, size_t capacity, size_t *count);

/* One object. NOT_FOUND. */
FS_API fs_status fs_scene_get_report(fs_scene *scene, const char *name, fs_report *out);

/* How an object moves, in its owner's scene frame. At time t it is felt at position + dt*linear, and its orientation is
 * turned further by the angle |dt*angular| about the axis `angular`; dt is t - time, but at least 0 and at most
 * horizon. Frozen. */
typedef struct fs_motion {
  char name[FS_NAME_SIZE];      /* another client's: "client/object" */
  fs_primitive primitive;       /* as set */
  uint32_t reserved_32;         /* 0 */
  uint64_t revision;            /* grows with every change but moves: then the object is to be got again */
  uint64_t motion_revision;     /* grows with every change and every move. While it stays, nothing here has changed.
                                   Another object of the same name never has an old number */
  fs_pose pose;                 /* at `time`, not extrapolated */
  fs_twist twist;               /* from then on: m/s, rad/s; given or worked out (fs_object_move) */
  double time;                  /* s, on the scene's clock */
  double horizon;               /* s, for which the twist is used; 0: it stands */
  double reserved[4];           /* 0 */
} fs_motion;

/* How all objects move, a list: one request for viewers, editors and bridges. It has the objects that fs_object_get
 * has, as they are at one instant, so a group is in it as a whole or not at all. client: only the objects of this one,
 * of a connected scene ("server": the server's own scene); null: all, its own first. The scene's own objects are as
 * this process has them: as an open group has them, and those too that the server has not taken yet or has refused
 * (fs_report.state tells); their revisions are counted in this process. Those of others are as the server has them;
 * what an open group, here or of the server's own scene, does to them is not in it. Connected: TIMEOUT, FULL.
 * NOT_FOUND: no such client. */
FS_API fs_status fs_scene_get_motions(fs_scene *scene, const char *client, fs_motion *out, size_t capacity,
                                      size_t *count);

/* What happened. */
typedef enum fs_event_kind {
  FS_EVENT_NONE = 0,            /* nothing within the timeout */
  FS_EVENT_READY = 1,           /* connected: a pending object is felt */
  FS_EVENT_REFUSED = 2,         /* the server did not take an object: status, text */
  FS_EVENT_CAPPED = 3,          /* stiffness_applied changed by over 10 %: value, N/m; at most one a second.
                                   0.1: never */
  FS_EVENT_EDITED = 4,          /* another client (text) changed, moved or removed an object of this one; of several
                                   by one client, not yet looked at, one is told */
  FS_EVENT_EXPIRED = 5,         /* an object outlived its lifetime: it stays, at weight 0, until set, changed or
                                   moved */
  FS_EVENT_DEVICE = 6,          /* device (name) ready (FS_OK), lost or stopped by a fault: status, text; value: the
                                   fs_fault bits that came, as a number; 0: ready. A fault that comes again after
                                   fs_servo_set_enabled is told again */
  FS_EVENT_DISCONNECTED = 7,    /* server gone; the last event: make a new scene */
  FS_EVENT_OVERFLOW = 8,        /* value older events were dropped, never fetched: 1024 are kept */
  FS_EVENT_FORCE_32 = 0x7fffffff
} fs_event_kind;

/* [rt] "FS_EVENT_DEVICE"; static, never null, also for a number that is no kind. */
FS_API const char *fs_event_kind_name(fs_event_kind kind);

/* One event. Frozen; what a kind does not use is 0. */
typedef struct fs_event {
  fs_event_kind kind;           /* what happened */
  fs_status status;             /* of what happened */
  double time,                  /* s, when, on the scene's clock */
         value;                 /* see the kind */
  char name[FS_NAME_SIZE],      /* of the object, or of the device */
       text[168];               /* a sentence for people */
} fs_event;

/* The oldest event that was not fetched yet; waits for one, timeout s (>= 0) at most; 0: does not wait. None: FS_OK
 * and FS_EVENT_NONE. Events are polled, never called back; a wait holds up no other call. */
FS_API fs_status fs_scene_next_event(fs_scene *scene, double timeout, fs_event *out);

#ifdef __cplusplus
}
#endif
#endif
