/* forceserver/scene.h - the set of force-objects of one application. Conventions: forceserver.h.
 *
 * A scene is data: it can be saved, sent to another process, edited and drawn. It lives in this process, or it is
 * connected to a server that several applications share; "Connected:" in a comment is about such a scene.
 *
 * No step in force. Under a servo every object has a weight that goes from 0 to 1 and back, linear in time, over
 * fs_servo_options.fade; it begins at the first tick that uses the change. Whichever calls come in whichever order, a
 * tick changes a weight by its period / fade at most. A removed object is kept without its name until its weight is 0;
 * if its name is set again before that, the object goes on from its weight. An object's primitive, shape or tool_points
 * and a scene's frame or tool cannot be adjusted while they are felt. They have versions: the new one fades in while
 * the old one fades out. A version that comes while another is still fading in waits until that one is felt in full; of
 * several that wait only the newest is kept. So versions that come faster than the fade are felt as a chain of full
 * cross-fades, and some are never felt.
 * What can be adjusted is blended over the much shorter fs_servo_options.blend. A new pose or twist does not begin where
 * it says, but where the object is felt and as fast as that moves; the difference decays within the blend, so neither
 * the place nor the velocity jumps, however fast moves come. New profiles, damping, start or contact make another
 * version, which takes over the weight of the one before at once, however far that has come, and its proxies; the force
 * goes over within the blend. An object that is put farther away than fs_servo_options.speed_limit * blend is another
 * version too, which fades as one of another shape: it does not sweep through the hand. By default that is 40 mm, counted
 * at the device; without a speed limit it is 2 m/s * blend. A turn counts as the way of the object's farthest point, or of
 * a point as far from its origin as the hand, if that is less.
 * Without a servo, and for an application's own tool (evaluate.h), every change is felt in full at once.
 */
#ifndef FORCESERVER_SCENE_H
#define FORCESERVER_SCENE_H

#include <forceserver/object.h>

#ifdef __cplusplus
extern "C" {
#endif

/* An empty scene in this process. */
FS_API fs_status fs_scene_create(fs_scene **out);

/* A scene at a server of this user, "shm:NAME", or of another user, "shm:NAME?user=USER". A program always connects to the
 * server of its own machine: the program forceserver-bridge joins the servers of several machines, so "dds:.." is
 * UNSUPPORTED. Options are joined by '&'. With "timeout=5" the call waits, 5 s at most, for a server that is not there yet or does
 * not answer; without it: NOT_FOUND at once, TIMEOUT after 2 s. client_name follows the rules of an object's name and
 * cannot be "server"; an '@' in it means that the client is at another machine and that a bridge has made the scene
 * for it (server.h); the name is free again as soon as its process is dead. The client's objects live as long as its
 * process, even if it makes no calls. A server that is lost stays lost for this scene: its calls return DISCONNECTED,
 * as they do after this process ran out of memory in the middle of a change. After fork the scene belongs to the
 * parent. Where the process of a server or client becomes another program (exec), the other end sees that only when the
 * processes that it has forked are gone, too. NOT_FOUND, EXISTS, VERSION (another version of the wire), DENIED, FULL,
 * TIMEOUT, IO, UNSUPPORTED. */
FS_API fs_status fs_scene_connect(const char *endpoint, const char *client_name, fs_scene **out);

/* Gives the scene back; null does nothing. A servo or tool that uses it goes on; connected: its objects fade. */
FS_API void fs_scene_destroy(fs_scene *scene);

/* ---- Objects */

/* Adds an object, which fades in under a servo. If the name exists already, it changes the parts that differ:
 * - pose, profiles and contact are blended (top of this file);
 * - `enabled` fades the same object out or in;
 * - a new primitive, shape or tool_points is another version, which cross-fades with the one before (top of this file).
 * A mesh whose search tree is not built yet is built in this call, without holding up the servo. Connected: the object
 * is checked here and sent (forceserver.h, Waiting); a mesh is felt when the server has built it (FS_EVENT_READY,
 * _REFUSED). A scene holds 1,048,576 objects at most, including those still fading out, and a connected one as many as
 * the server's max_objects; beyond: FULL. VERSION. */
FS_API fs_status fs_object_set(fs_scene *scene, const fs_object *object);

/* Parts of an object; bits. */
typedef enum fs_part {
  FS_PART_POSE = 1,             /* pose, twist, time */
  FS_PART_PROFILES = 2,         /* front, back, damping, start */
  FS_PART_CONTACT = 4,          /* contact, surface */
  FS_PART_SHAPE = 8,            /* primitive, shape */
  FS_PART_OTHER = 16,           /* lifetime, tool_points, enabled */
  FS_PART_FORCE_32 = 0x7fffffff
} fs_part;

/* ---- From here on, in a connected scene, a name may also be "client/object": another client's object, in that
 * client's frame. "server/object" is an object of the server's own scene. Such a call asks the server: TIMEOUT (1 s),
 * NOT_FOUND, DENIED (the server is `locked`). After another client has changed one of this scene's own objects, or the
 * server has refused a change of it, the next call about that object asks the server as well. A new object that the
 * server refused stays in this process (FS_OBJECT_REFUSED): it can be set or changed again, which sends all of it, or
 * removed. A refused change of any other object is undone. */

/* Fills out, which fs_object_init made with any name: struct_size is read, and no more than that size is written.
 * Another client's object gets the name of this call, so the result can be passed to fs_object_change as it is. Release
 * it by fs_object_release, also before it is filled again: its handles live until then. NOT_FOUND, VERSION. */
FS_API fs_status fs_object_get(fs_scene *scene, const char *name, fs_object *out);

/* Changes only these parts (fs_part bits) of the object with this name, so that, for example, an editor does not undo
 * the owner's moves. Of the argument only these parts, name and struct_size are read; the result must be a valid object
 * as a whole. parts 0 changes nothing. NOT_FOUND, DENIED, VERSION. */
FS_API fs_status fs_object_change(fs_scene *scene, const fs_object *object, uint32_t parts);

/* Moves an object: it has pose at time (s, scene's clock; FS_NOW) and twist from then on. To put an object somewhere
 * once, give a zero twist. Pass null in a stream of moves only: the twist is then worked out from this move and the last move
 * or set (0 if there was none in the last 0.2 s), and the object goes on with it for twice the time between them at most. Of
 * two moves within 1 ms the later pose replaces the earlier. A move whose time is older than that of the last one is taken
 * with twist 0. Evaluation extrapolates from `time`, never back and for 0.1 s at most. A move is cheap, for meshes too. The
 * next tick feels it; a servo blends it, and fades it if it is a jump (top of this file). Connected: a move of one of the
 * scene's own objects does not wait for the server and normally makes no system call; the server takes it at its rate. It
 * waits for calls of other threads on the same scene, of which a commit takes some microseconds a change: a thread that
 * must be in time connects a scene of its own. NOT_FOUND, DENIED. */
FS_API fs_status fs_object_move(fs_scene *scene, const char *name, const fs_pose *pose, const fs_twist *twist,
                                      double time);

/* Removes an object; under a servo it fades out. NOT_FOUND, DENIED. */
FS_API fs_status fs_object_remove(fs_scene *scene, const char *name);

/* Removes all of the scene's own objects. Frame, clutch and tool stay. MEMORY: some may be gone already. */
FS_API fs_status fs_scene_clear(fs_scene *scene);

/* ---- Groups: several changes that are felt from one tick on. A group belongs to the thread that opens it: what this
 * thread changes joins it, and this thread's getters see it. Other threads neither see it nor wait for it: what they
 * change takes effect at once, and each may have a group of its own. A call that fails adds nothing to the group.
 * Connected: changes, moves and removals of other clients' objects belong to it too; each client feels its part from
 * one tick on. fs_scene_set_accuracy and fs_scene_set_max_stiffness belong to no group. A group holds at most
 * 4 max_objects + 64 changes, where a clear counts as a removal of each object; beyond: FULL. A thread that ends must have
 * closed its group; otherwise the group stays in memory, without effect, until the scene goes. */

/* Opens a group. STATE: this thread has one open already. Connected: where others have changed or removed objects of this
 * scene, or the server has refused a change, it first asks the server for these. It waits 0.1 s at most, and 1 s more for
 * each mesh or curve that it has to fetch; then the group begins with what is known, without an error. What others change
 * in this scene's objects while the group is open, this thread's getters show when it is closed. VERSION. */
FS_API fs_status fs_scene_begin(fs_scene *scene);

/* Closes the group: all of it is felt from one tick on, or none of it. STATE: this thread has none open. FULL: others
 * have added objects since; the group stays open. Connected: it is sent as a whole; if that fails, the group stays open:
 * TIMEOUT. If the server refuses a part (FS_EVENT_REFUSED, fs_scene_sync), it takes nothing, and this process's scene is
 * set back to what the server has; only objects that were new in the group stay in this process, refused. So it does
 * (NOT_FOUND) where the group changes or removes an object of another client that is gone by then. Of an object that
 * somebody else, also another thread, has changed since, only the parts change that the group has changed (with
 * fs_object_set: all); one that somebody else has removed stays removed, unless the group sets it. UNSUPPORTED: with what
 * others have changed since it would be a solid mesh beside a radius of the tool; the group stays open. MEMORY: a part may be
 * felt already, and stays so; the rest is still an open group, which may grow: commit it again, or cancel it. */
FS_API fs_status fs_scene_commit(fs_scene *scene);

/* Closes the group and takes back all of it, but not what a commit that failed has made felt. STATE: this thread has none
 * open. */
FS_API fs_status fs_scene_cancel(fs_scene *scene);

/* Waits, timeout s (>= 0) at most, until a tick has used all changes so far, whether or not they have faded in; those
 * of open groups do not count. Without a servo it returns at once. With FS_SERVO_VIRTUAL another thread must step.
 * TIMEOUT, or the status of the first change that was refused. Connected: when it returns in time, getters show what
 * the server has, and the new objects that it refused. */
FS_API fs_status fs_scene_sync(fs_scene *scene, double timeout);

/* ---- Files. A scene as JSON; its schema is share/forceserver/scene.schema.json:
 *
 *     {"forceserver": "scene", "version": 1,
 *      "shapes": {"part": {"file": "part.ply"}, "line": {"points": [[0, 0, 0], [0.1, 0, 0]]}},
 *      "curves": {"pulse": {"expression": "2*(1+sin(12*t))"}},
 *      "objects": [{"name": "a", "primitive": "mesh", "shape": "part", "pose": {"position": [0, 0, 0.05]},
 *                   "back": {"kind": "linear_increasing", "sense": "attractive", "gain": 500, "limit": 10}}]}
 *
 * The keys are the names of these headers: fields as they are, enum values in lower case without their prefix. A field
 * that is left out is 0, but `enabled` is true, and frame and tool have their defaults. An unknown or repeated key is
 * an error; "$schema", which editors look for, is ignored. A mesh may be OBJ, PLY, STL or OFF; its file is in the
 * folder of the scene file or below. Times are saved as ages (s), the time from them to the moment of saving: that of the
 * pose of an object with a twist as "pose_age", a `start` that was given as "age". Loading sets time = now - pose_age and
 * start = now - age. So an object is felt where it was when it was saved, f(d, t) goes on where it was, and both on another
 * machine too; without "pose_age" an object begins to move when it is loaded. A twist that was worked out (fs_object_move)
 * is saved with the pose of that moment, or as 0 if it was over. A file may have the "start" itself; both together are
 * an error. */

/* Saves the scene's own objects, frame and tool; meshes are written beside the file as PLY, named after the file and
 * their content. Every number comes back bit for bit, except time and start: their ages do, and they are within rounding of
 * the clock (1e-9 s for a clock below 4e6 s). The file is replaced as a whole or not at all. IO, INVALID (a name that is
 * not UTF-8). */
FS_API fs_status fs_scene_save(fs_scene *scene, const char *path);

/* Adds or replaces the objects of a file, and sets frame and tool; all or nothing. Objects with other names stay. Only
 * regular files are read. NOT_FOUND, IO, PARSE, VERSION (a newer file), UNSUPPORTED, FULL. */
FS_API fs_status fs_scene_load(fs_scene *scene, const char *path);

/* ---- Frame, clutch, tool: where the scene's tool is. A new frame or tool puts it elsewhere, and is another version,
 * as for an object: the old force fades out at the old place while the new one fades in, without proxies. The clutch
 * holds the tool where it is, and releases it from there. */

/* Scene to device: x_device = pose * (x_scene / scale), F_device = force_scale * (F_scene rotated by pose.orientation).
 * So a slope k of the scene is scale*force_scale*k at the device. Frozen. */
typedef struct fs_frame {
  fs_pose pose;                 /* scene to device, device metres */
  double scale;                 /* scene metres per device metre, 1e-9..1e9 */
  double force_scale;           /* 0..1e9; 0: not felt. The lever arms of torques are in device metres */
  double reserved[4];           /* 0 */
} fs_frame;

/* The default: scene and device are the same. */
static inline fs_frame fs_frame_init(void)
{ fs_frame f; memset(&f, 0, sizeof f); f.pose.orientation.w = f.scale = f.force_scale = 1.0; return f; }

/* [rt] Sets *out to a pose of the device (m, device frame) in the scene: x_scene = scale * (frame.pose^-1 * x_device),
 * and the orientation is turned back by frame.pose. A servo does the same with the hand (fs_scene_get_hand), with the
 * same bits. out may be pose. A clutch moves the frame of a scene: take that of fs_scene_get_frame. A call that fails
 * allocates memory for its sentence. */
FS_API fs_status fs_frame_to_scene(const fs_frame *frame, const fs_pose *pose, fs_pose *out);

/* [rt] The way back: sets *out to a pose of the scene (m, scene frame) at the device: x_device = frame.pose * (x_scene
 * / scale), and the orientation is turned by frame.pose. A servo does the same with fs_response.proxy, with the same
 * bits. From one client's scene to another's: by the frame of the one to the device, and from there by the frame of the
 * other. out may be pose. A call that fails allocates memory for its sentence. */
FS_API fs_status fs_frame_to_device(const fs_frame *frame, const fs_pose *pose, fs_pose *out);

/* Sets the frame between the scene and the device. It is the servo's: tools of one's own do not see it. */
FS_API fs_status fs_scene_set_frame(fs_scene *scene, const fs_frame *frame);

/* The frame, as a clutch may have moved it. client: in a connected scene, the client whose frame it is; null: this
 * scene's own. NOT_FOUND. */
FS_API fs_status fs_scene_get_frame(fs_scene *scene, const char *client, fs_frame *out);

/* Holds or releases the clutch. While it is held the hand moves, the tool stays, and the force of this scene fades out.
 * On release the frame is moved (not rotated) so that the tool's position does not jump; the tool's orientation is the
 * hand's again, and the force fades in. Setting the present state changes nothing. */
FS_API fs_status fs_scene_set_clutch(fs_scene *scene, bool held);

/* Sets the tool's points: count 1..32, frame of the handle, scene metres; the default is one point, (0, 0, 0). The
 * force of a profile is the mean over the points that feel the object (tool_points), the force of a contact is the sum
 * over them; an object's total force stays within its limit. Several points also give a torque about the handle's
 * origin. */
FS_API fs_status fs_scene_set_tool(fs_scene *scene, const fs_vec3 *points, size_t count);

/* The tool's points, a list. */
FS_API fs_status fs_scene_get_tool(fs_scene *scene, fs_vec3 *out, size_t capacity, size_t *count);

/* Sets the radius of each point of the tool, m of the scene, 0..1e15; 0 (default): the points have no size. With a radius r
 * each is a ball, whose middle is where the point is: a profile is felt at f(max(0, d - r), t), where d is the distance from
 * the middle to the object, and a solid plane holds the ball, so that its middle stays r away from the plane. Its texture is
 * felt where the ball touches the plane. Forces act at the middle, so the radius adds no torque. A solid mesh cannot hold a
 * ball: while the radius is above 0 setting or changing an object to a solid mesh is UNSUPPORTED, and while one is there so is
 * a radius above 0. It holds for all tools of the scene, those of one's own (evaluate.h) too; fields have
 * none. Another radius fades in as another set of points does; a tool of one's own forgets its proxies. */
FS_API fs_status fs_scene_set_tool_radius(fs_scene *scene, double radius);

/* The radius of the tool's points, m. */
FS_API fs_status fs_scene_get_tool_radius(fs_scene *scene, double *out);

/* Where the tool of a scene is, with all that is needed to draw it. Frozen. */
typedef struct fs_view {
  fs_frame frame;               /* as fs_scene_get_frame gives it */
  fs_pose tool;                 /* pose of the handle at the last tick, in that scene's frame: the hand's, or the one at
                                   which the clutch holds it. The identity before the first tick and without a servo */
  fs_vec3 points[FS_TOOL_POINTS_MAX]; /* of the tool, m, frame of the handle: the first point_count; the rest are 0 */
  uint32_t point_count;         /* 1..32 */
  bool held;                    /* the clutch is held */
  bool locked;                  /* connected: the server is `locked`, so other clients' objects cannot be changed */
  uint8_t reserved_8[2];        /* 0 */
  double point_radius;          /* m, of each point */
  double reserved[3];           /* 0 */
} fs_view;

/* Frame, clutch and tool, all of one instant. client: in a connected scene, the client that they belong to ("server":
 * the server's own scene); null: this scene's own, as the thread's group has them. Connected: TIMEOUT. NOT_FOUND. */
FS_API fs_status fs_scene_get_view(fs_scene *scene, const char *client, fs_view *out);

/* ---- Accuracy, slope, clock */

/* The error in the force that evaluation may make in order to be faster, N of the scene, >= 0; 0 (default): exact.
 * fs_response.error_bound is the bound of the error it made. What is left out are the far ends of GAUSSIAN and INVERSE
 * profiles, which otherwise never end: the error is shared out among these objects, and one that gives less than its
 * share is not evaluated. Of meshes nothing is left out: a coarser one would be hardly faster, and a small error in the
 * closest point can turn the force around. */
FS_API fs_status fs_scene_set_accuracy(fs_scene *scene, double newtons);

/* Limit of the summed slope of objects that are felt at the same place, N/m at the device, >= 0. 0 (default): what the
 * servo can render; without a servo no limit. Where fs_servo_options.max_stiffness is none, it bounds each object by itself
 * only, from the next time on that the object is set or changed. The bounds of the objects are fair: where all together want
 * no more, each gets the slope that it wants. Where they want more, those that want least get it, and the others get equal
 * parts of what these leave. So a soft wall stays as it is beside many stiff ones. The bound of an object is what it gets where
 * its force is steep and most is wanted beside it; its profiles and its contact count as two objects. No force is ever raised.
 *
 * - A contact with stiffness 0, and a force that jumps (fs_report), want all that there is. But a force that jumps wants no
 *   more than what spreads its greatest value over 0.1 mm: 10 N/m for each mN.
 * - An object that the hand cannot reach for now does not count, and keeps the bound that it has. It counts before the hand
 *   arrives: from its position and velocity at the last tick, the hand is assumed to accelerate by up to 50 m/s2 during the
 *   40 ms or so until new bounds are felt, but never to be faster than fs_servo_options.speed_limit. Where that is switched
 *   off or another frame or tool fades in, all that lies in the device's workspace counts; while the clutch is held, all
 *   objects do. What the hand has left counts for 1 s.
 * - A new object has at first the bound of one alone; within 0.1 s it counts beside others, and so does one that has moved. A
 *   bound that changes is blended as a profile that changes is. One that grows where the hand is near does so slowly, to twice
 *   as much in a quarter of a second, so that a hand which leans on a wall feels no push.
 * - Connected: the bound holds for the scene's own objects and can only lower what the server gives them. What the servo can
 *   render is split among its clients in the same way: a client wants the largest slope that its objects within the hand's
 *   reach want together at one place, plus a tenth.
 *
 * Not bounded are tools of one's own, fields, and the turn of an attractive force where two parts of a polyline or mesh are
 * equally near: it leads the hand away from there. A repulsive one is blended there, and was up to 2.1 times as steep as the
 * bound in random scenes. Nor is the step beyond the edge of a mesh that is not closed and whose front and back differ: there
 * the hand comes to the other side without a surface in between. Nor is what friction adds: while the proxy slips, the force
 * of a contact of stiffness k has a slope of up to k sqrt(1 + friction^2), of which the part along the surface only takes
 * energy. */
FS_API fs_status fs_scene_set_max_stiffness(fs_scene *scene, double stiffness);

/* [rt] The scene's clock, s: the monotonic clock of the machine that evaluates (the same in every process of that
 * machine), or the servo's virtual time. When a servo's start or stop changes the clock, stored times shift with it, so
 * ages stay. */
FS_API fs_status fs_scene_get_time(const fs_scene *scene, double *out);

/* [rt] Sets the clock to time (> 0), where it stands until the next such call or until a servo starts. For plots and
 * tests. STATE: the scene is not in this process, or has a servo. */
FS_API fs_status fs_scene_set_time(fs_scene *scene, double time);

/* ---- Reports, motions and events */

/* How far an object has come. */
typedef enum fs_object_state {
  FS_OBJECT_PENDING = 0,        /* no tick has used it yet */
  FS_OBJECT_FELT = 1,           /* felt in full; without a servo: it exists */
  FS_OBJECT_FADING = 2,         /* fading in or out; or at weight 0 because its lifetime is over */
  FS_OBJECT_DISABLED = 3,       /* `enabled` is false, and it has faded out */
  FS_OBJECT_REFUSED = 4,        /* connected: the server refused it */
  FS_OBJECT_FORCE_32 = 0x7fffffff
} fs_object_state;

/* [rt] The name of a state, such as "FS_OBJECT_FELT"; static, never null, not even for a number that is no state. */
FS_API const char *fs_object_state_name(fs_object_state state);

/* How an object is felt. Frozen.
 *
 * Where a force jumps, its slope is infinite, and so is the stiffness_wanted of the object. A force jumps
 * - at d = 0 of a point or polyline unless f(0) = 0: it reverses from one side to the other;
 * - at the surface of a plane unless front and back agree there in size and direction;
 * - at the surface of a mesh unless both are 0 there: a force that goes on through it turns at once at an edge;
 * - at `reach` unless f(reach) = 0;
 * - wherever a polyline that is not straight is felt: at every distance there are places that are equally near to two
 *   of its parts, and there the direction changes from one part to the other.
 * For a mesh only the surface is looked at, not the places, mostly deep inside, that are equally near to two of its
 * parts, nor those beyond the edge of one that is not closed, where the hand changes sides. */
typedef struct fs_report {
  char name[FS_NAME_SIZE];      /* for another client's object "client/object" */
  fs_primitive primitive;       /* as set */
  fs_object_state state;        /* how far it has come */
  uint64_t revision;            /* grows with every change except moves */
  double weight;                /* 0..1, of its newest version; in between it is FADING, in or out. What a version takes
                                   over from the one before (top of this file) counts as its own */
  double stiffness_wanted;      /* N/m at the device, the steepest slope of profiles and contact; infinite where the
                                   force jumps (above). For a curve it is worked out once, when the curve is made: for
                                   a table it is never too low, for an expression it is an estimate from some hundred
                                   samples. What friction adds is left out (fs_scene_set_max_stiffness). A contact with
                                   stiffness 0 wants what it gets, so it never shows as capped */
  double stiffness_applied;     /* N/m at the device; less than stiffness_wanted when capped (fs_scene_set_max_stiffness) */
  double distance;              /* m, from the object to the nearest tool point at the last tick; infinite: not near
                                   (beyond its force, weight 0, clutched, no servo); then point and wrench are 0.
                                   The proxies of 64 solid objects that hold the hand are told at most. Where more
                                   hold it, distance, point and wrench of these others are worked out without a
                                   proxy, even where the object is not felt; then the sum of all wrenches is not the
                                   force */
  fs_vec3 point;                /* p, or the proxy; in the frame of the scene that asks */
  fs_wrench wrench;             /* its part of the force, the sum of its versions with their weights, before the guard;
                                   while another frame or tool fades in, only what it gives there; along the axes of
                                   the scene that asks; for another client's object in newtons at the device */
  char shares_with[120];        /* the other objects of its scene that are felt where it gets less than it wants: those
                                   that want most, as many names as fit, such as "a, b and 17 more"; then "other
                                   clients", where some want a part of the same. Empty: it gets all that it wants, is
                                   alone, or out of the hand's reach */
  double texture_lost;          /* 0..1, the part of its texture's heights that cannot be rendered */
  double impact_lost;           /* 0..1, the part of its impact that cannot be rendered when the hand comes at 0.3 m/s at the
                                   device and no other impact is felt */
  double reserved[1];           /* 0 */
} fs_report;

/* The reports of all objects that the scene can see, a list; connected: the objects of all clients, where the client
 * "server" is the server's own scene; TIMEOUT. Without a servo no object is near. */
FS_API fs_status fs_scene_get_reports(fs_scene *scene, fs_report *out, size_t capacity, size_t *count);

/* The report of one object. NOT_FOUND. */
FS_API fs_status fs_scene_get_report(fs_scene *scene, const char *name, fs_report *out);

/* How an object moves, in its owner's scene frame. At time t it is felt at position + dt*linear, with its orientation
 * rotated further by the angle |dt*angular| about the axis `angular`; dt is t - time, but at least 0 and at most
 * horizon. A servo spreads changes of these over fs_servo_options.blend. Frozen. */
typedef struct fs_motion {
  char name[FS_NAME_SIZE];      /* another client's: "client/object" */
  fs_primitive primitive;       /* as set */
  uint32_t reserved_32;         /* 0 */
  uint64_t revision;            /* grows with every change except moves: when it does, call fs_object_get again */
  uint64_t motion_revision;     /* grows with every change and every move, and again when the group that it is in is
                                   committed. While it is the same, nothing in this struct has changed. A later object
                                   with the same name never has an earlier number */
  fs_pose pose;                 /* at `time`, not extrapolated */
  fs_twist twist;               /* from `time` on: m/s, rad/s; given or worked out (fs_object_move) */
  double time;                  /* s, on the scene's clock */
  double horizon;               /* s after `time` for which the twist is used; 0: it stands still */
  double reserved[4];           /* 0 */
} fs_motion;

/* [rt] Sets *out to the pose that an object with this motion has at a time, by the formula of fs_motion. fs_evaluate
 * evaluates the object there, with the same bits; so does a servo, except within fs_servo_options.blend of a change,
 * and of the end of the horizon, which it rounds off. time: s, on the scene's clock, finite; 0 is the time 0 here, not
 * FS_NOW. Of motion only pose, twist, time and horizon (0..0.1 s) are read. A call that fails allocates memory for its
 * sentence. */
FS_API fs_status fs_motion_at(const fs_motion *motion, double time, fs_pose *out);

/* How all objects move, a list: one request for viewers, editors and bridges. It has the objects that fs_object_get
 * finds, as they are at one instant, so a group is in it as a whole or not at all. client: in a connected scene, the
 * client whose objects are listed ("server": the server's own scene); null: all objects, the scene's own first. The
 * scene's own objects are as this process has them: with the changes of the thread's group, and including those that the
 * server has not taken yet or has refused (see fs_report.state); their revisions are counted in this process. A group in
 * which another client changes them may be in the list in part, as this process takes them over one by one. Other
 * clients' objects are as the server has them, without the changes of groups that are open in this process or in the
 * server's own scene. Connected: TIMEOUT, FULL. NOT_FOUND: no such client. */
FS_API fs_status fs_scene_get_motions(fs_scene *scene, const char *client, fs_motion *out, size_t capacity,
                                      size_t *count);

/* Those of them whose motion_revision is above `since`, a list in the order of motion_revision: for a viewer or bridge that
 * looks many times a second. 0: all. Give the largest motion_revision that you were given, for each `client` its own: no change
 * is lost, also when the buffer is small, and none is told twice. client: in a connected scene null means all other clients and
 * the server's own scene, whose revisions are counted in the server; the scene's own name means its own objects, whose
 * revisions are counted in this process, with those that the server has not taken yet or has refused. A scene in this process
 * has only null, its objects. What a group changes, also this thread's, is told when it is committed. That an object is removed
 * is not told: where fs_client.objects is less than the number of names that you have of a client, list them anew by
 * fs_scene_get_motions. Connected: TIMEOUT, FULL. NOT_FOUND: no such client. */
FS_API fs_status fs_scene_get_motions_since(fs_scene *scene, const char *client, uint64_t since, fs_motion *out,
                                            size_t capacity, size_t *count);

/* What happened. */
typedef enum fs_event_kind {
  FS_EVENT_NONE = 0,            /* no event within the timeout */
  FS_EVENT_READY = 1,           /* connected: a pending object is now felt */
  FS_EVENT_REFUSED = 2,         /* the server refused an object: status, text */
  FS_EVENT_CAPPED = 3,          /* stiffness_applied changed by over 10 %: value, N/m at the device; text: also with which
                                   objects it shares; of an object at once, then after 1 s, 2 s, 4 s, up to 32 s, and 20
                                   times a second of a scene at most; what has changed meanwhile is told later */
  FS_EVENT_EDITED = 4,          /* another client (text) changed, moved or removed an object of this scene; several
                                   edits by one client before the object is looked at give one event */
  FS_EVENT_EXPIRED = 5,         /* an object's lifetime is over: it stays, at weight 0, until set, changed or moved */
  FS_EVENT_DEVICE = 6,          /* the device (name) is ready (FS_OK), lost or stopped by a fault: status, text; value:
                                   the new fs_fault bits as a number; 0: ready. A device that stays lost gives another
                                   event for each new reason. A fault that occurs again after
                                   fs_servo_set_enabled gives another event. INVALID: its driver measures nonsense (driver.h,
                                   get_link), which does not count; value: 0 */
  FS_EVENT_DISCONNECTED = 7,    /* the server is gone; this is the last event: make a new scene */
  FS_EVENT_OVERFLOW = 8,        /* `value` older events were dropped before they were fetched: 1024 are kept */
  FS_EVENT_CLIENT = 9,          /* a client (name) stopped all force or let it return (FS_OK); only in the scene whose
                                   servo has the server: it connected or left (FS_OK), or was lost, because its process
                                   was killed or ended without a word, or was disconnected by the server
                                   (DISCONNECTED): status, text; value: its process */
  FS_EVENT_FORCE_32 = 0x7fffffff
} fs_event_kind;

/* [rt] The name of a kind, such as "FS_EVENT_DEVICE"; static, never null, not even for a number that is no kind. */
FS_API const char *fs_event_kind_name(fs_event_kind kind);

/* One event. Frozen; a field that the kind does not use is 0. */
typedef struct fs_event {
  fs_event_kind kind;           /* what happened */
  fs_status status;             /* the status that goes with it */
  double time,                  /* s, when it happened, on the scene's clock */
         value;                 /* see fs_event_kind */
  char name[FS_NAME_SIZE],      /* of the object, the device or the client */
       text[168];               /* a sentence for people */
} fs_event;

/* The oldest event that was not fetched yet; waits for one, timeout s (>= 0) at most; 0: does not wait. If there is
 * none: FS_OK and FS_EVENT_NONE. Events are polled, there are no callbacks; a wait holds up no other call. */
FS_API fs_status fs_scene_next_event(fs_scene *scene, double timeout, fs_event *out);

#ifdef __cplusplus
}
#endif
#endif
