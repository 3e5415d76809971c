/* forceserver/object.h - force-objects: primitive, profiles, contact, shapes and curves. Conventions: forceserver.h. */
#ifndef FORCESERVER_OBJECT_H
#define FORCESERVER_OBJECT_H

#include <forceserver/base.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum fs_primitive {             /* Table 1 of the paper; p is the closest point, d = |hand - p| >= 0 */
  FS_PRIMITIVE_POINT = 0,               /* the origin of the object frame */
  FS_PRIMITIVE_POLYLINE = 1,            /* of its shape: the curve, not the area a closed one surrounds */
  FS_PRIMITIVE_PLANE = 2,               /* z = 0 of the object frame; the front is z > 0 */
  FS_PRIMITIVE_MESH = 3,                /* of its shape; the front is where triangles run counter-clockwise */
  FS_PRIMITIVE_FORCE_32 = 0x7fffffff    /* d = 0: a plane or mesh counts as front, along its normal; others give 0 */
} fs_primitive;

typedef enum fs_profile_kind {          /* Table 2 of the paper, with the components each one uses */
  FS_PROFILE_NONE = 0,
  FS_PROFILE_CONSTANT = 1,              /* gain (N, > 0) */
  FS_PROFILE_LINEAR_INCREASING = 2,     /* gain*d + offset (N/m, > 0; N) */
  FS_PROFILE_LINEAR_DECREASING = 3,     /* gain*d + offset (N/m, < 0; N) */
  FS_PROFILE_GAUSSIAN = 4,              /* gain*exp(-(d/width)^2/2) (N, > 0; m, > 0) */
  FS_PROFILE_QUADRATIC = 5,             /* gain*d^2 + offset (N/m^2; N) */
  FS_PROFILE_INVERSE = 6,               /* gain/d + offset (N m, > 0; N) */
  FS_PROFILE_CUSTOM = 7,                /* gain*curve(d, t) (a factor, > 0; the curve is in N) */
  FS_PROFILE_FORCE_32 = 0x7fffffff
} fs_profile_kind;

typedef enum fs_sense {
  FS_SENSE_ATTRACTIVE = 0,              /* the hand is drawn towards p: also how a plane's back pushes it out */
  FS_SENSE_REPULSIVE = 1,               /* the hand is driven away from p */
  FS_SENSE_FORCE_32 = 0x7fffffff
} fs_sense;

typedef struct fs_profile {             /* f(d, t), N, clamped to [0, limit]. Frozen. What a kind does not use is 0 */
  fs_profile_kind kind;
  fs_sense sense;
  double gain, offset, width;           /* see the kind */
  double limit;                         /* N, > 0 unless kind is NONE: the threshold of the paper */
  double reach;                         /* m, >= 0: no force beyond; 0: without end */
  fs_curve *curve;                      /* CUSTOM; else null */
} fs_profile;

typedef enum fs_keep {                  /* the side of a plane or mesh the hand cannot leave */
  FS_KEEP_NONE = 0,                     /* not solid */
  FS_KEEP_FRONT = 1,                    /* an obstacle */
  FS_KEEP_BACK = 2,                     /* an envelope: the hand stays within a closed mesh */
  FS_KEEP_EITHER = 3,                   /* a sheet: the side it came from */
  FS_KEEP_FORCE_32 = 0x7fffffff
} fs_keep;

/* Makes a plane or mesh solid: a proxy of each tool point stays on the kept side (Zilles & Salisbury 1995) and draws the
 * point with min(stiffness*|hand - proxy|, limit). This object's profiles are then those at the proxy; where the proxy
 * lies on the surface they act along the kept side's normal. Frozen. */
typedef struct fs_contact {
  fs_keep keep;                         /* POINT, POLYLINE: NONE */
  uint32_t reserved;
  double stiffness;                     /* N/m, >= 0; 0: an equal share of the servo's max_stiffness among those that
                                           ask for 0; no servo and no bound: 1000 */
  double limit;                         /* N, > 0 unless keep is NONE */
  double damping;                       /* N s/m, >= 0, along the normal, on approach only */
  double friction;                      /* Coulomb coefficient, 0..2 */
} fs_contact;

typedef struct fs_object {              /* a force-object. Growing; made by fs_object_init */
  uint32_t struct_size;
  fs_primitive primitive;
  char name[FS_NAME_SIZE];              /* UTF-8, 1..31 bytes and a 0, no '/', no control character; unique */
  fs_pose pose;                         /* object to scene, at `time` */
  fs_twist twist;                       /* its motion from then on, for 0.1 s at most; then it stands */
  double time;                          /* s; FS_NOW */
  double start;                         /* s, t = 0 of f(d, t); 0: when this name was first set, kept by later sets */
  double lifetime;                      /* s, >= 0: fades unless set, changed or moved within it; 0: as its client */
  fs_profile front;                     /* POINT, POLYLINE: the only one */
  fs_profile back;                      /* PLANE, MESH: on the back side; else NONE */
  double damping;                       /* N s/m, >= 0, against motion relative to the object, where a profile acts */
  fs_contact contact;
  fs_shape *shape;                      /* POLYLINE, MESH; else null */
  void *owner;                          /* the library's; null but in what fs_object_get filled */
  uint32_t tool_points;                 /* bit i: point i of the tool feels it; 0: all */
  bool enabled;
  uint8_t reserved[3];
} fs_object;

/* The three components of the paper: gain, offset (GAUSSIAN: width), limit. */
static inline fs_profile fs_profile_init(fs_profile_kind kind, fs_sense sense, double gain, double offset_or_width,
                                         double limit)
{
  fs_profile p;
  memset(&p, 0, sizeof p);
  p.kind = kind; p.sense = sense; p.gain = gain; p.limit = limit;
  if (kind == FS_PROFILE_GAUSSIAN) p.width = offset_or_width; else p.offset = offset_or_width;
  return p;
}

/* Enabled, at the origin, no profile, not solid. name may be a temporary; a bad one is refused by fs_object_set. */
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

/* After fs_object_get: its handles go unless retained, whatever the fields hold by now. Else does nothing. */
FS_API void fs_object_release(fs_object *object);

/* What a profile gives at count distances (m), with slopes limited to max_stiffness (N/m; 0: the bare formula). */
FS_API fs_status fs_profile_evaluate(const fs_profile *profile, double max_stiffness, double t,
                                     const double *distances, size_t count, double *forces);

/* Shapes: cheap to make (copy and check). The search tree is built by fs_shape_build, else by the first scene of this
 * process that uses the shape (a million triangles: about 1 s); a server builds its own. */
FS_API fs_status fs_shape_create_polyline(const fs_vec3 *points, size_t count, bool closed, fs_shape **out); /* >= 2 */
FS_API fs_status fs_shape_create_mesh(const fs_vec3 *points, size_t point_count, const uint32_t *triangles,
                                      size_t triangle_count, fs_shape **out);   /* three indices a triangle */
FS_API fs_status fs_shape_load(const char *path, double scale, fs_shape **out); /* OBJ PLY STL OFF; scale: m per file
                                                                   unit; NOT_FOUND, IO, PARSE, UNSUPPORTED */
FS_API fs_status fs_shape_build(fs_shape *shape);
FS_API fs_shape *fs_shape_retain(fs_shape *shape);      /* one more reference; returns shape; null gives null */
FS_API void fs_shape_destroy(fs_shape *shape);
FS_API const fs_vec3 *fs_shape_get_points(const fs_shape *shape, size_t *count);        /* live as long as the shape */
FS_API const uint32_t *fs_shape_get_triangles(const fs_shape *shape, size_t *count);    /* polyline: null, 0 */

typedef struct fs_shape_info {          /* growing */
  uint32_t struct_size;
  fs_primitive primitive;               /* POLYLINE or MESH */
  uint64_t open_edges, odd_edges;       /* mesh: of one triangle; of three and more, or of two that disagree */
  uint64_t degenerate;                  /* mesh: triangles without area; they are kept */
  fs_vec3 lower, upper;                 /* m, bounds, object frame */
  bool closed, built;
  uint8_t reserved[6];
} fs_shape_info;
FS_DEFINE_INIT(fs_shape_info)
FS_API fs_status fs_shape_get_info(const fs_shape *shape, fs_shape_info *out);

/* Curves f(d, t), N: below 0 or not finite counts as 0. */
FS_API fs_status fs_curve_create_table(const double *forces, size_t count, double step, fs_curve **out); /* f(0), f(step),
                                      f(2 step)...; count >= 2, step > 0 (m); monotone cubic; the last value beyond */
FS_API fs_status fs_curve_create_expression(const char *text, fs_curve **out);  /* "3*(1+sin(12*t))*exp(-d/0.01)";
                              d in m, t in s; no assignment; at most 255 bytes; its slope by differences in d; PARSE */
FS_API const char *fs_curve_get_expression(const fs_curve *curve);      /* table: null; lives as long as the curve */
FS_API const double *fs_curve_get_table(const fs_curve *curve, size_t *count, double *step); /* expression: null, 0 */
FS_API fs_curve *fs_curve_retain(fs_curve *curve);
FS_API void fs_curve_destroy(fs_curve *curve);

#ifdef __cplusplus
}
#endif
#endif
