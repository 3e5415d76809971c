/* forceserver/base.h - version, status, plain data and the handles. Conventions: forceserver.h. */
#ifndef FORCESERVER_BASE_H
#define FORCESERVER_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Marks what the library exports. */
#if defined(SWIG) || !defined(__GNUC__)
#  define FS_API
#else
#  define FS_API __attribute__((visibility("default")))
#endif

/* Of these headers; fs_version() is that of the library that runs. */
#define FS_VERSION_MAJOR 0
#define FS_VERSION_MINOR 1
#define FS_VERSION_PATCH 0

#define FS_NAME_SIZE 64         /* bytes of a name with its end */
#define FS_TOOL_POINTS_MAX 32   /* points of a tool */
#define FS_NOW 0.0              /* as a time: when the call is made */

/* Defines type_init(), which gives the struct as zeros with its struct_size. It is inline so that the size is the one
 * the caller was compiled with. */
#define FS_DEFINE_INIT(type) static inline type type##_init(void) \
  { type v; memset(&v, 0, sizeof v); v.struct_size = (uint32_t)sizeof v; return v; }

#ifdef __cplusplus
extern "C" {
#endif

/* How a call ended: below 0 it failed, and fs_last_error() says why. */
typedef enum fs_status {
  FS_OK = 0,                    /* done */
  FS_ERROR_INVALID = -1,        /* an argument or field out of range */
  FS_ERROR_NOT_FOUND = -2,      /* no such object, file, device, server or driver */
  FS_ERROR_EXISTS = -3,         /* client name, endpoint or scheme taken */
  FS_ERROR_STATE = -4,          /* not now: commit without begin, device owned by a servo, scene without a servo */
  FS_ERROR_VERSION = -5,        /* a struct, file, server or driver newer than this library */
  FS_ERROR_UNSUPPORTED = -6,    /* not built in, or not for this kind of scene, servo or device */
  FS_ERROR_MEMORY = -7,         /* none left */
  FS_ERROR_IO = -8,             /* the system refused; the sentence has its reason */
  FS_ERROR_PARSE = -9,          /* JSON, mesh file or expression; the sentence has line or column */
  FS_ERROR_TIMEOUT = -10,       /* it did not happen within the time given */
  FS_ERROR_DISCONNECTED = -11,  /* server gone: so it stays for this handle; or device gone: asked again each tick */
  FS_ERROR_DENIED = -12,        /* another user's server, or another client's object where those are locked */
  FS_ERROR_FULL = -13,          /* a stated maximum is reached */
  FS_ERROR_INTERNAL = -14,      /* our bug */
  FS_STATUS_FORCE_32 = 0x7fffffff /* no value, here and in every enum below: it makes the type 32 bits wide */
} fs_status;

/* "0.1.0", of the library that runs; static. */
FS_API const char *fs_version(void);

/* "FS_ERROR_INVALID"; static, never null, also for a number that is no status. */
FS_API const char *fs_status_name(fs_status status);

/* A sentence on this thread's last failure, valid until its next; a call that succeeds leaves it. Empty before the
 * first; never null. */
FS_API const char *fs_last_error(void);

/* Plain data, frozen. */

/* A point (m), direction, velocity or force; the comment where it stands has the unit. */
typedef struct fs_vec3 { double x, y, z; } fs_vec3;
/* A rotation from object to parent, of unit length; all zeros: the identity. */
typedef struct fs_quat { double w, x, y, z; } fs_quat;
/* Where an object is in its parent: x_parent = position (m) + x_object turned by orientation. */
typedef struct fs_pose { fs_vec3 position; fs_quat orientation; } fs_pose;
/* How it moves: m/s of its origin and rad/s, both along the parent's axes. */
typedef struct fs_twist { fs_vec3 linear, angular; } fs_twist;
/* N; N m about the origin of the tool. */
typedef struct fs_wrench { fs_vec3 force, torque; } fs_wrench;
/* A 3 by 3 matrix, row-major. */
typedef struct fs_mat3 { double xx, xy, xz, yx, yy, yz, zx, zy, zz; } fs_mat3;

/* *out: the pose at position whose z axis points along direction (any length > 0): a plane from point and normal. The
 * turn about z is the one of the shortest way from z to direction. */
FS_API fs_status fs_pose_from_z(fs_vec3 position, fs_vec3 direction, fs_pose *out);

/* Handles. Each is given back to the function behind its name. */

/* The force-objects of one application: fs_scene_destroy. */
typedef struct fs_scene fs_scene;
/* The points of a polyline or triangles of a mesh; immutable, shared by objects: fs_shape_destroy. */
typedef struct fs_shape fs_shape;
/* A custom profile function; immutable, shared by profiles: fs_curve_destroy. */
typedef struct fs_curve fs_curve;
/* What touches a scene in a loop of one's own, with its memory: fs_tool_destroy. */
typedef struct fs_tool fs_tool;
/* A haptic device or the simulator: fs_device_close. */
typedef struct fs_device fs_device;
/* The loop between a scene and a device: fs_servo_stop. */
typedef struct fs_servo fs_servo;
/* The door of a servo to other processes: fs_server_stop. */
typedef struct fs_server fs_server;

#ifdef __cplusplus
}
#endif
#endif
