/* forceserver/object.h - force-objects: primitive, profiles, contact, shapes, curves, surfaces. Conventions: forceserver.h.
 *
 * For a position x of the hand a primitive gives its closest point p, the distance d = |x - p|, the direction from p
 * to x and, for a plane or mesh, the side that x is on. The profile of that side gives the intensity f(d, t) >= 0 in
 * newtons, and its sense says whether the force points to p or away from it. The forces of all objects add.
 */
#ifndef FORCESERVER_OBJECT_H
#define FORCESERVER_OBJECT_H

#include <math.h>

#include <forceserver/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The geometry of an object: Table 1 of the paper. The closest point is exact in double precision; of triangles or
 * segments that are equally near, the one with the lowest index counts. At d = 0 (within 2 units in the last place of
 * the coordinates) the hand counts as on the front of a plane or mesh, in the direction of its normal there; the force
 * of a point or polyline is 0 there, as its direction is undefined. */
typedef enum fs_primitive {
  FS_PRIMITIVE_POINT = 0,       /* the origin of the object frame */
  FS_PRIMITIVE_POLYLINE = 1,    /* the segments of its shape; a closed one is its line, not the area inside */
  FS_PRIMITIVE_PLANE = 2,       /* z = 0 of the object frame; the front is z > 0 */
  FS_PRIMITIVE_MESH = 3,        /* the triangles of its shape; seen from the front they run counter-clockwise. Where
                                   an edge or vertex is nearest, its angle-weighted pseudonormal gives the side
                                   (Baerentzen & Aanaes 2005), which is exact where the mesh is closed; an open edge
                                   has the normal of its triangle. Parts of a closed mesh (a part is what edges join)
                                   that cross or lie in one another are one body: inside is where the winding number of
                                   all of them is not 0, so a hollow is outside, and surface that has an inside on both
                                   sides is not there for profiles. A contact holds at all surface, also inside. Not decided:
                                   where a mesh is not closed, a part crosses itself, or a part is turned inside out and
                                   lies within no other, the side is that of the nearest triangle */
  FS_PRIMITIVE_FORCE_32 = 0x7fffffff
} fs_primitive;

/* The intensity f(d, t): Table 2 of the paper. d: distance, m; t: s since the object's start; the result is in N,
 * before it is clamped to [0, limit]. Each formula names the fields of fs_profile that its kind uses, with their units
 * and ranges. With gain 0 the force is the offset; for CONSTANT, GAUSSIAN and CUSTOM, which have no offset, it is 0. */
typedef enum fs_profile_kind {
  FS_PROFILE_NONE = 0,                  /* no force */
  FS_PROFILE_CONSTANT = 1,              /* gain (N, >= 0) */
  FS_PROFILE_LINEAR_INCREASING = 2,     /* gain*d + offset (N/m, >= 0; N) */
  FS_PROFILE_LINEAR_DECREASING = 3,     /* gain*d + offset (N/m, <= 0; N) */
  FS_PROFILE_GAUSSIAN = 4,              /* gain*exp(-(d/width)^2/2) (N, >= 0; m, > 0) */
  FS_PROFILE_QUADRATIC = 5,             /* gain*d^2 + offset (N/m^2; N) */
  FS_PROFILE_INVERSE = 6,               /* gain/d + offset (N m, >= 0; N) */
  FS_PROFILE_CUSTOM = 7,                /* gain*curve(d, t) (a factor, >= 0; the curve is in N) */
  FS_PROFILE_FORCE_32 = 0x7fffffff
} fs_profile_kind;

/* A curve depends only on d and t. Use the gain for anything else that the force depends on, such as the charge of a
 * battery. The gain may change at any rate while the object is felt. The curve stays the same and is not sent again,
 * and t goes on, as `start` 0 keeps the start:
 *
 *     scout.front.gain = battery_charge();                        0: no force
 *     fs_object_change(scene, &scout, FS_PART_PROFILES);
 */

/* Where the force points. */
typedef enum fs_sense {
  FS_SENSE_ATTRACTIVE = 0,      /* the hand is drawn towards p: also how a plane's back pushes it out */
  FS_SENSE_REPULSIVE = 1,       /* the hand is driven away from p */
  FS_SENSE_FORCE_32 = 0x7fffffff
} fs_sense;

/* [rt] The name of a value, such as "FS_PRIMITIVE_POINT", "FS_PROFILE_GAUSSIAN", "FS_SENSE_REPULSIVE"; static, never
 * null, not even for a number that is no value. */
FS_API const char *fs_primitive_name(fs_primitive primitive);
FS_API const char *fs_profile_kind_name(fs_profile_kind kind);
FS_API const char *fs_sense_name(fs_sense sense);

/* The function f(d, t), N, clamped to [0, limit]. Frozen. A field that the kind does not use is 0; all zeros: no force.
 * Fill it by fs_profile_init or field by field. */
typedef struct fs_profile {
  fs_profile_kind kind;         /* the formula */
  fs_sense sense;               /* to p or away from it */
  double gain, offset, width;   /* see fs_profile_kind */
  double limit;                 /* N, > 0 and at most 1e9, unless kind is NONE: the threshold of the paper */
  double reach;                 /* m, >= 0: no force beyond this distance; 0: unlimited */
  fs_curve *curve;              /* for CUSTOM; otherwise null */
  double reserved[4];           /* 0 */
} fs_profile;

/* The side of a plane or mesh that the hand cannot leave. */
typedef enum fs_keep {
  FS_KEEP_NONE = 0,             /* not solid */
  FS_KEEP_FRONT = 1,            /* an obstacle */
  FS_KEEP_BACK = 2,             /* an envelope: the hand stays within a closed mesh, such as a robot's reach */
  FS_KEEP_EITHER = 3,           /* a sheet: the hand stays on the side it came from */
  FS_KEEP_FORCE_32 = 0x7fffffff
} fs_keep;

/* Makes a plane or mesh solid: a proxy of each tool point stays on the kept side (Zilles & Salisbury 1995) and draws
 * the point with min(stiffness*|hand - proxy|, limit). This object's profiles are then evaluated at the proxy; where
 * the proxy lies on the surface they act along the kept side's normal. Those of a plane are evaluated where the proxy would
 * be if only this plane held it, so that they give no energy on a closed path while other objects hold the proxy; those of a
 * mesh may then give some. With keep NONE the other fields are checked and stored, but have no effect. Frozen.
 *
 * - Objects of equal limit and equal stiffness, as it is applied (fs_report), share a proxy: where several meet, the spring
 *   to it acts once, and the limit is that of their sum. Other objects have proxies of their own, and the forces add.
 * - An object that moves pushes a proxy that is in its way; with friction it also carries one that rests on it. In a corner
 *   between several objects the proxy goes to the nearest place that all of them allow.
 * - If there is no such place within twice the distance that the objects have moved, the hand is crushed: each object that
 *   contradicts the first gets a proxy of its own, and their forces add. An object that no longer holds the hand shares the
 *   proxy of the others again as soon as the way to it is free.
 * - While an object fades in or out, the force is weight times the force with it plus (1 - weight) times the force without
 *   it, each with proxies of its own. So what it holds passes to the others, or from them, as slowly as it fades.
 * - A hand that is on the wrong side of a plane or closed mesh (fs_shape_info.has_inside) when both meet for the first time, or
 *   when another side is to be kept, is led to the nearest place of the right side, from however far; on the wrong side of an
 *   open mesh it is free until it has come round it. An open mesh that replaces one which the hand touches takes the hand
 *   over, on the side that is kept.
 * - If the spring's force changes in one tick by more than twice the stiffness times the distance that hand and objects have
 *   moved, the rest of the change is spread over 20 ms (of state.time), as when a proxy slips over the edge of a shelf.
 * - limit also bounds the force of the object on all points of a tool together; its direction stays. In a corner between
 *   objects that share a proxy, a tool of several points that are held to the limit may gain energy on its way round; a
 *   tool of one point does not.
 * - Near a tool 256 solid objects are felt, first of all those that hold the hand, and 2048 pairs of a solid object and a tool
 *   point; a solid plane is near everywhere. Objects that fade at different times can be told apart as long as the pairs,
 *   times the number of these objects plus one, are 4096 at most, and 7 objects at most; beyond that what they hold is
 *   spread over 20 ms instead.
 * - A servo's tick tests ways among solid meshes for two periods at most. Where that does not suffice, as for many thousand
 *   triangles on a way of a millimetre, the proxy stays where it is until the next tick. */
typedef struct fs_contact {
  fs_keep keep;                 /* POINT, POLYLINE: NONE */
  uint32_t reserved_32;         /* 0 */
  double stiffness;             /* N/m, 0..1e9, of each tool point: n points that rest on it are n times as stiff. 0: as
                                   stiff as can be rendered. Without a bound (fs_scene_set_max_stiffness) that is 1000;
                                   with one, those that want less at the same places get that first, and all others
                                   equal parts of the rest */
  double limit;                 /* N, > 0 and at most 1e9, unless keep is NONE */
  double damping;               /* N s/m, 0..1e9, along the normal, only while the hand approaches; from the first touch on */
  double friction;              /* Coulomb coefficient, 0..2: within the cone of friction the proxy does not move at all */
  double reserved[8];           /* 0 */
} fs_contact;

/* A force-object. Growing; made by fs_object_init. */
typedef struct fs_object {
  uint32_t struct_size;         /* sizeof(fs_object), by fs_object_init */
  fs_primitive primitive;       /* its geometry */
  char name[FS_NAME_SIZE];      /* UTF-8, 1..63 bytes and a 0, no '/', no control character; unique in its scene */
  fs_pose pose;                 /* object to scene, at `time` */
  fs_twist twist;               /* its motion from then on, for 0.1 s at most; then it stands still */
  double time;                  /* s, on the scene's clock; FS_NOW */
  double start;                 /* s, t = 0 of f(d, t); 0: when this name was first set, kept by later sets */
  fs_profile front;             /* PLANE, MESH: on the front side; POINT, POLYLINE: the only profile */
  fs_profile back;              /* PLANE, MESH: on the back side; otherwise of kind NONE */
  double damping;               /* N s/m, 0..1e9: where f(d, t) > 0, adds -damping times (velocity of the tool point
                                   minus that of the object there); the sum stays within the limit of the profile. So a
                                   hand that moves feels it begin and end at once where f does.
                                   Where a servo works the velocity out from poses, a hand that has moved by less than 2
                                   encoder steps within 50 ms counts as at rest; from 3 steps on it is damped in full,
                                   here as in a contact */
  fs_contact contact;           /* PLANE, MESH: whether it is solid */
  fs_shape *shape;              /* POLYLINE, MESH: a shape of that primitive; otherwise null */
  void *owner;                  /* for the library's use; null except in an object that fs_object_get filled */
  uint32_t tool_points;         /* bit i: point i of the tool feels it; 0: all */
  bool enabled;                 /* false: kept but not felt; a change fades the object out or in */
  uint8_t reserved[3];          /* 0 */
  double lifetime;              /* s, 0..1e12: it fades unless set, changed or moved within this time; 0: it lives as
                                   long as its client */
  fs_surface *surface;          /* PLANE, MESH: what its surface does while it is solid; null: nothing but contact.friction */
} fs_object;

/* A profile from the three components of the paper: gain, offset (GAUSSIAN: width), limit. No reach, no curve. */
static inline fs_profile fs_profile_init(fs_profile_kind kind, fs_sense sense, double gain, double offset_or_width,
                                         double limit)
{
  fs_profile p;
  memset(&p, 0, sizeof p);
  p.kind = kind; p.sense = sense; p.gain = gain; p.limit = limit;
  if (kind == FS_PROFILE_GAUSSIAN) p.width = offset_or_width; else p.offset = offset_or_width;
  return p;
}

/* An object that is enabled, at the origin, without profile, not solid. name is copied; null: no name. fs_object_set
 * refuses a bad name. */
static inline fs_object fs_object_init(const char *name, fs_primitive primitive)
{
  fs_object o;
  size_t i;
  memset(&o, 0, sizeof o);
  o.struct_size = (uint32_t)sizeof o;
  o.primitive = primitive;
  o.enabled = true;
  for (i = 0; name && i < FS_NAME_SIZE && name[i]; ++i) o.name[i] = name[i];
  return o;
}

/* Front, back and sense: the force F on the hand h, and the closest point p of a plane or mesh. Each side has its own
 * profile, and so its own sense.
 *
 *                      front.sense = ATTRACTIVE        front.sense = REPULSIVE
 *                      it holds the hand at it         it keeps the hand away
 *
 *        normal                                               ^ F
 *           ^                     h                           |
 *           |                     | F                         h
 *     front |                     v
 *     ======+=====================p===========================p======================
 *     back                        ^
 *                                 | F                         h
 *                                 h                           | F
 *                                                             v
 *                      back.sense = ATTRACTIVE         back.sense = REPULSIVE
 *                      a wall: pushes out what         it drives the hand deeper
 *                      is in it, towards the front
 */

/* A wall: a plane without force in front; it pushes a hand behind it out with min(stiffness*depth, limit). point: any
 * point of the plane, m; normal: towards the free side, of any length > 0; stiffness: N/m, >= 0; limit: N, > 0.
 * fs_object_set refuses a bad value; until then pose.orientation holds (NaN, normal) for a normal that is 0 or not
 * finite. */
static inline fs_object fs_wall_init(const char *name, fs_vec3 point, fs_vec3 normal, double stiffness, double limit)
{
  fs_object o = fs_object_init(name, FS_PRIMITIVE_PLANE);
  o.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, stiffness, 0, limit);
  if (fs_pose_from_z(point, normal, &o.pose) != FS_OK) {
    o.pose.position = point;
    o.pose.orientation.w = NAN;
    o.pose.orientation.x = normal.x;
    o.pose.orientation.y = normal.y;
    o.pose.orientation.z = normal.z;
  }
  return o;
}

/* Releases an object that fs_object_get filled: gives back the handles (shape, curves, surface) that fs_object_get put there,
 * whatever the fields hold by now; the caller's own references keep them alive. For any other object, or null, it does
 * nothing. */
FS_API void fs_object_release(fs_object *object);

/* Sets forces[i] to the force (N) of the profile at distances[i] (m, >= 0) and time t (s since the start), as a point or
 * polyline has it, with slopes limited to max_stiffness (N/m, >= 0; 0: no limit): the largest function that is
 * nowhere above f and nowhere steeper, and at most max_stiffness*d, as the force turns over at d = 0. It falls to 0
 * before the reach as steeply. Exact but for an expression, which is sampled: what is steep only between two samples
 * stays. Both arrays have count entries; with count 0 they may be null. */
FS_API fs_status fs_profile_evaluate(const fs_profile *profile, double max_stiffness, double t,
                                     const double *distances, size_t count, double *forces);

/* The same for both sides of an object: sets forces[i] to the force along its normal (N, > 0 towards the front) of its
 * profiles at the signed distance distances[i] (m, > 0 in front) and time t (s since the start). For a point or
 * polyline, to the force on a straight line through it, which turns over at 0 and is 0 there. Where both sides push
 * the same way, the limit max_stiffness lets each differ from the other only by max_stiffness times the distance; where
 * they do not, both begin at 0. Contact and damping are not regarded, nor is the frame: a slope k of the scene is
 * scale*force_scale*k at the device. The object must be one that fs_object_set takes, or another client's as
 * fs_object_get gives it. INVALID, VERSION. */
FS_API fs_status fs_object_evaluate_law(const fs_object *object, double max_stiffness, double t,
                                        const double *distances, size_t count, double *forces);

/* ---- Shapes are cheap to make: they are copied and checked. The search tree is built by fs_shape_build, or by the
 * first scene of this process that uses the shape, in the calling thread; a server builds its own. A million triangles
 * take 1 s, or 2 s where neighbours are far apart in the list; more where parts of a closed mesh meet, as the triangles
 * there are cut into pieces. A mesh may be open, non-manifold or degenerate. To find its front and back, corners at the
 * same coordinates count as one, whatever their indices. A shape lives as long as the caller's reference or an object
 * needs it. */

/* A polyline through count (>= 2) points, m, object frame. closed: the last point is joined to the first. */
FS_API fs_status fs_shape_create_polyline(const fs_vec3 *points, size_t count, bool closed, fs_shape **out);

/* A mesh of 1 to 5e8 triangles. points: m, object frame, at most 4e9 of them; triangles: three indices of points per triangle,
 * counter-clockwise as seen from the front. */
FS_API fs_status fs_shape_create_mesh(const fs_vec3 *points, size_t point_count, const uint32_t *triangles,
                                      size_t triangle_count, fs_shape **out);

/* A mesh from a file whose name ends in .obj, .ply, .stl or .off. A face with n corners, convex or not, is cut into
 * n - 2 triangles in its own plane; equal points of an STL file are merged. scale: m per file unit, > 0. NOT_FOUND, IO,
 * PARSE, UNSUPPORTED (another ending, a variant that is not read, or a face too entangled to be cut: fs_last_error()
 * has which). */
FS_API fs_status fs_shape_load(const char *path, double scale, fs_shape **out);

/* Builds the search tree now, in this thread, rather than at the first use. Does nothing if the tree is built already,
 * as that of a polyline always is. STATE: the process is ending. */
FS_API fs_status fs_shape_build(fs_shape *shape);

/* [rt] How much of the search tree is built, 0..1, also while another thread builds it; it only grows, unless a build
 * fails. 1: the tree is built. */
FS_API fs_status fs_shape_get_progress(const fs_shape *shape, double *out);

/* One more reference; returns shape; null gives null. */
FS_API fs_shape *fs_shape_retain(fs_shape *shape);

/* Gives one reference back; null does nothing. */
FS_API void fs_shape_destroy(fs_shape *shape);

/* The points, as given, with their count; they live as long as the shape. With a null argument it returns null and sets
 * fs_last_error. */
FS_API const fs_vec3 *fs_shape_get_points(const fs_shape *shape, size_t *count);

/* Three indices per triangle, as given; *count becomes the number of triangles. They live as long as the shape. For a
 * polyline: null, 0. With a null argument it returns null and sets fs_last_error. */
FS_API const uint32_t *fs_shape_get_triangles(const fs_shape *shape, size_t *count);

/* What a shape is, and what is irregular in it. Growing. Two triangles share an edge if they share its two indices. */
typedef struct fs_shape_info {
  uint32_t struct_size;         /* sizeof(fs_shape_info), by fs_shape_info_init */
  fs_primitive primitive;       /* POLYLINE or MESH */
  uint64_t open_edges,          /* mesh: edges of only one triangle */
           odd_edges;           /* mesh: edges of three or more triangles, or of two that disagree about the front */
  uint64_t degenerate;          /* mesh: triangles without area; they are kept */
  fs_vec3 lower, upper;         /* m, bounds of all points, object frame */
  bool closed,                  /* polyline: as created; mesh: it has edges, and none is open or odd */
       built;                   /* the search tree is built; for a polyline always true */
  bool united;                  /* mesh, built: parts of it cross or touch, or some of its surface lies inside, and its sides
                                   are those of the union of its parts: see FS_PRIMITIVE_MESH. false: no parts meet, or they
                                   cross so often that the union is not worked out */
  bool has_inside;              /* mesh: it is closed, or it is when corners at equal coordinates count as one, as where an
                                   export splits them for flat shading. It is then solid and united as a closed mesh is */
  uint8_t reserved[4];          /* 0 */
  uint64_t content[2];          /* a hash of what the shape was made of: primitive, points, triangles, and of a polyline
                                   closed. Equal content has the same hash on every machine and in every version; other
                                   content most probably has another, but somebody who wants to can find some that has the
                                   same. Points count bit by bit, so 0.0 and -0.0 differ. It is worked out at the first call
                                   that asks for it, 1 GB in less than 1 s */
} fs_shape_info;
FS_DEFINE_INIT(fs_shape_info)

/* Fills out, which fs_shape_info_init made. VERSION. */
FS_API fs_status fs_shape_get_info(const fs_shape *shape, fs_shape_info *out);

/* ---- Curves: the function f(d, t) of a CUSTOM profile, N. A value below 0 or not finite counts as 0. A curve lives as
 * long as the caller's reference or an object needs it. */

/* A table: forces (N) are f(0), f(step), f(2 step)...; count >= 2, step > 0 (m). An entry below 0 or not finite is
 * replaced by 0. Through the entries runs a monotone cubic, which never overshoots (PCHIP: Fritsch & Carlson 1980);
 * beyond the last entry f keeps its value. It does not depend on t. */
FS_API fs_status fs_curve_create_table(const double *forces, size_t count, double step, fs_curve **out);

/* An expression such as "3*(1+sin(12*t))*exp(-d/0.01)": d in m, t in s since the object's start. It has the functions
 * and operators of muParser: log is ln, angles are in rad, a^b is the power, c ? a : b the choice; the error sentence
 * about an unknown name lists all names. No assignment; at most 255 bytes of printable ASCII. A value that changes,
 * such as a battery's charge, belongs in the gain of the profile: see FS_PROFILE_CUSTOM. The slope is the central
 * difference over d - 1e-6 m .. d + 1e-6 m; for d < 1e-6 m that interval begins at 0. PARSE, with the column;
 * UNSUPPORTED where the library was built without expressions. */
FS_API fs_status fs_curve_create_expression(const char *text, fs_curve **out);

/* The text of an expression; it lives as long as the curve. For a table: null. With a null argument it returns null and
 * sets fs_last_error. */
FS_API const char *fs_curve_get_expression(const fs_curve *curve);

/* The entries of a table, as given, with their count and step (m); they live as long as the curve. For an expression:
 * null, 0, 0. With a null argument it returns null and sets fs_last_error. */
FS_API const double *fs_curve_get_table(const fs_curve *curve, size_t *count, double *step);

/* One more reference; returns curve; null gives null. */
FS_API fs_curve *fs_curve_retain(fs_curve *curve);

/* Gives one reference back; null does nothing. */
FS_API void fs_curve_destroy(fs_curve *curve);

/* ---- Surfaces: what a solid object's surface does. A surface lives as long as the caller's reference or an object needs it.
 *
 * Stick and slip. As long as the proxy sticks, friction holds it with static_friction times the normal force F (N), which is
 * the stiffness k of the contact (N/m) times the depth (m). Once it slips the coefficient falls, in proportion to the way of
 * the proxy along the surface, and is dynamic_friction from slip_distance on. The proxy sticks again, with the static coefficient, when the hand has come back so far that friction
 * is less by a tenth of the difference of the two, or when it has left the surface. All of this depends on ways alone, not
 * on speed or time. The proxy is only ever moved towards the hand, so no closed path gains energy, and at rest it does not
 * creep (Hayward & Armstrong, "A new computational model of friction applied to haptic rendering", 2000). A hand of
 * stiffness k_hand (N/m) that is pulled slowly, at v m/s, sticks for 2 (static - dynamic) F (k + k_hand) / (k k_hand v)
 * seconds, and slips for half an oscillation, where k is much larger than k_hand.
 *
 * While it falls friction has a negative slope, of (static - dynamic) F / slip_distance. So that this is at most half of the
 * stiffness of the contact, slip_distance counts as 2 (static - dynamic) times the depth at least. Solid objects that share a
 * proxy have the mean of their coefficients, by how far each pushes.
 *
 * Texture. A grid of heights, none above 0, is projected along an axis of the object and carved into the surface. Between the
 * heights goes a bicubic spline h (Unser, "Splines: a perfect fit for signal and image processing", 1999). At the border of a
 * grid that does not repeat its slope is 0, and beyond the height stays. Where h would rise above 0, all of it is lowered.
 * - The proxy stays on the surface that is not carved. With n the normal there, and s = max(0, depth + h), the spring pushes
 *   with stiffness * s * (n - grad h). That is the gradient of the energy stiffness * s^2 / 2, so no closed path gains any.
 *   Friction acts about the turned normal n - grad h. h is taken where the proxy would be without friction.
 * - This is exact on planes and on a flat part of a mesh, where grad h is the part of it along the surface.
 *   Only a tool of several points may gain a little: its object's limit makes the sum of their forces smaller, not each.
 * - An object with a texture has a proxy of its own. With g the steepest slope of h the force along the normal is limited to
 *   limit / ((g + sqrt(g^2 + 4)) / 2), so that the whole force stays within the limit on each slope.
 * - fs_report.stiffness_wanted is the larger eigenvalue of the matrix (k, k g; k g, k g^2 + limit c), where k is the stiffness
 *   and c the largest curvature of h, 1/m. Where a servo can render less the heights are made smaller, all by the same factor,
 *   and the stiffness keeps at least 0.8 of what it would have without a texture. fs_report.texture_lost tells by how much.
 *
 * Impact. Where a tool point meets the surface at v m/s, along the normal and relative to the object, it also feels
 * impact_gain * v * exp(-impact_decay * t) * sin(2 pi * impact_frequency * t), outwards first (Okamura, Cutkosky & Dennerlein,
 * "Reality-based models for vibration feedback in virtual environments", IEEE/ASME Trans. Mechatronics 6(3), 2001). It goes on
 * until it has decayed, also when the point has left again. Its amplitude is at most contact.limit, and the force of the object
 * stays within that. On a texture it begins where the spring begins to push. A tool of one's own must give fs_state.twist: a
 * hand without a velocity gives no impact. Of the solids near the tool at most 64 give impacts, and at most 128 pairs of a solid
 * and a tool point. A point that comes slower than 20 mm/s at the device gives none, and after each contact the point must have been free for 50 ms, and 1 mm above the surface, before it gives the next. An object
 * that is set where the hand is gives none. With several tool points each gives its part: they share impact_gain.
 * Under a servo all impacts together change by at most a quarter of the slew limit (fs_servo_options.slew), so they never have
 * the guard hold back other forces; the first half wave slows the hand by at most half of v, with the mass that the device tells,
 * and the frequency is at least that of the handle on the spring of the contact: so the hand does not leave faster than it
 * came. The frequency is at most an eighth of the servo's rate. A device that renders local models feels none, because its
 * controller cannot follow them. fs_report.impact_lost tells how much of the amplitude is lost, but not that
 * the frequency is another. */

/* The axis of the object along which a grid of heights is projected. */
typedef enum fs_axis {
  FS_AXIS_Z = 0,                /* columns along x, rows along y */
  FS_AXIS_X = 1,                /* columns along y, rows along z */
  FS_AXIS_Y = 2,                /* columns along z, rows along x */
  FS_AXIS_FORCE_32 = 0x7fffffff
} fs_axis;

/* Growing; made by fs_surface_settings_init. */
typedef struct fs_surface_settings {
  uint32_t struct_size;         /* sizeof(fs_surface_settings), by fs_surface_settings_init */
  uint32_t reserved;            /* 0 */
  double static_friction;       /* Coulomb coefficient, 0..2. Above 0: contact.friction must be 0. 0: that counts */
  double dynamic_friction;      /* static_friction / 10..static_friction */
  double slip_distance;         /* m, 0..1e9 */
  uint32_t columns, rows;       /* of the grid of heights; 0: there is no texture, and the fields from axis to first_row are 0, too */
  fs_axis axis;                 /* along which the grid is projected */
  bool repeats;                 /* the grid is repeated without end; false: it ends with a slope of 0 */
  uint8_t reserved_8[3];        /* 0 */
  double column_width, row_width;    /* m, from one height to the next, 1e-6..1e3; where there is only one height it may be 0 */
  double first_column, first_row;    /* m, the place of the first height, -1e9..1e9 */
  double impact_gain;           /* N s/m, 0..1e6: newtons for each m/s of approach. 0: none, and what follows is 0, too */
  double impact_frequency;      /* Hz, 1..1e5 */
  double impact_decay;          /* 1/s, 1..1e6: after 1 / impact_decay seconds a third of it is left */
} fs_surface_settings;
FS_DEFINE_INIT(fs_surface_settings)

/* How hard a surface sounds when it is hit. The figures are chosen, not measured: nobody has judged them on a device. */
typedef enum fs_impact {
  FS_IMPACT_NONE = 0,
  FS_IMPACT_SOFT = 1,           /* rubber: 4 N s/m, 30 Hz, 60/s */
  FS_IMPACT_MEDIUM = 2,         /* wood: 8 N s/m, 100 Hz, 80/s */
  FS_IMPACT_HARD = 3,           /* metal: 10 N s/m, 250 Hz, 60/s. A servo of 1 kHz plays it at 125 Hz */
  FS_IMPACT_FORCE_32 = 0x7fffffff
} fs_impact;

/* Sets the three impact fields of settings. The settings are those that fs_surface_settings_init made. INVALID, VERSION. */
FS_API fs_status fs_surface_set_impact(fs_surface_settings *settings, fs_impact impact);

/* A surface of these settings. INVALID, VERSION. */
FS_API fs_status fs_surface_create(const fs_surface_settings *settings, fs_surface **out);

/* A surface with a texture. heights: m, -1..0, the first row first, settings.columns in each; count: columns * rows, at most
 * 2^20. They are copied. INVALID, VERSION. */
FS_API fs_status fs_surface_create_texture(const fs_surface_settings *settings, const double *heights, size_t count,
                                           fs_surface **out);

/* A surface with a texture whose heights (m, -1..0) an expression in the place x, y, z (m, object frame) gives at the columns *
 * rows places of the grid; the coordinate along the axis is 0 there. So the grid says how finely it is sampled, and where it is
 * repeated. text: as for fs_curve_create_expression, but for the names d and t; it is not kept. INVALID, PARSE, VERSION;
 * UNSUPPORTED where the library was built without expressions. */
FS_API fs_status fs_surface_create_expression(const fs_surface_settings *settings, const char *text, fs_surface **out);

/* Fills out, which fs_surface_settings_init made, with the settings of a surface. VERSION. */
FS_API fs_status fs_surface_get_settings(const fs_surface *surface, fs_surface_settings *out);

/* The heights, as given, and how many they are; they live as long as the surface. Without a texture: null, 0. With a null
 * argument it returns null and sets fs_last_error. */
FS_API const double *fs_surface_get_heights(const fs_surface *surface, size_t *count);

/* One more reference; returns surface; null gives null. */
FS_API fs_surface *fs_surface_retain(fs_surface *surface);

/* Gives one reference back; null does nothing. */
FS_API void fs_surface_destroy(fs_surface *surface);

#ifdef __cplusplus
}
#endif
#endif
