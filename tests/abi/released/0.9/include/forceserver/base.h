/* forceserver/base.h - version, status, plain data and the handles. Conventions: forceserver.h. */
#ifndef FORCESERVER_BASE_H
#define FORCESERVER_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Marks a function that the library exports. */
#if defined(SWIG) || !defined(__GNUC__)
#  define FS_API
#else
#  define FS_API __attribute__((visibility("default")))
#endif

/* The version of these headers; fs_version() gives that of the library that runs. */
#define FS_VERSION_MAJOR 0
#define FS_VERSION_MINOR 9
#define FS_VERSION_PATCH 0

#define FS_NAME_SIZE 128        /* bytes of a name, its final 0 included */
#define FS_TOOL_POINTS_MAX 32   /* points of a tool */
#define FS_NOW 0.0              /* as a time: the moment of the call */

/* Defines type_init(), which returns the struct with all zeros but struct_size. It is inline so that struct_size is the
 * size that the caller was compiled with. */
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
  FS_ERROR_STATE = -4,          /* not possible now: commit without begin, device owned by a servo, a scene without a
                                   servo */
  FS_ERROR_VERSION = -5,        /* a struct, file, server or driver newer than this library */
  FS_ERROR_UNSUPPORTED = -6,    /* not built in, or not available for this kind of scene, servo or device */
  FS_ERROR_MEMORY = -7,         /* no memory left */
  FS_ERROR_IO = -8,             /* the system refused; fs_last_error() has its reason */
  FS_ERROR_PARSE = -9,          /* bad JSON, mesh file or expression; fs_last_error() says where: the line, column or
                                   byte, or for a scene file the object and key */
  FS_ERROR_TIMEOUT = -10,       /* it did not happen within the time given */
  FS_ERROR_DISCONNECTED = -11,  /* server gone, for good for this handle; or device gone, which each tick tries again */
  FS_ERROR_DENIED = -12,        /* another user's server, or another client's object at a server that is `locked` */
  FS_ERROR_FULL = -13,          /* a stated maximum is reached */
  FS_ERROR_INTERNAL = -14,      /* a bug of the library */
  FS_STATUS_FORCE_32 = 0x7fffffff /* not a value: here and in every enum below it makes the type 32 bits wide */
} fs_status;

/* The version of the library that runs, such as "0.9.0"; static. */
FS_API const char *fs_version(void);

/* The name of a status, such as "FS_ERROR_INVALID"; static, never null, not even for a number that is no status. */
FS_API const char *fs_status_name(fs_status status);

/* A sentence about the last failure in this thread. It is valid until the thread's next failure; a call that succeeds
 * leaves it as it is. Empty before the first failure; never null. */
FS_API const char *fs_last_error(void);

/* Plain data, frozen. */

/* A point (m), direction, velocity or force; the comment at each use has the unit. */
typedef struct fs_vec3 { double x, y, z; } fs_vec3;
/* A rotation from object to parent, of unit length; all zeros: the identity. */
typedef struct fs_quat { double w, x, y, z; } fs_quat;
/* Where an object is in its parent's frame: x_parent = position (m) + x_object rotated by orientation. */
typedef struct fs_pose { fs_vec3 position; fs_quat orientation; } fs_pose;
/* How an object moves: velocity of its origin, m/s, and angular velocity, rad/s, both along the parent's axes. */
typedef struct fs_twist { fs_vec3 linear, angular; } fs_twist;
/* A force, N, and a torque, N m, about the origin of the tool. */
typedef struct fs_wrench { fs_vec3 force, torque; } fs_wrench;
/* A 3 by 3 matrix, row-major. */
typedef struct fs_mat3 { double xx, xy, xz, yx, yy, yz, zx, zy, zz; } fs_mat3;

/* Sets *out to the pose at position whose z axis points along direction (of any length > 0), such as the pose of a
 * plane from a point and a normal. The orientation is the shortest rotation from z to direction. */
FS_API fs_status fs_pose_from_z(fs_vec3 position, fs_vec3 direction, fs_pose *out);

/* Handles. Each comment ends with the function that gives the handle back. */

/* The force-objects of one application: fs_scene_destroy. */
typedef struct fs_scene fs_scene;
/* The points of a polyline or triangles of a mesh; immutable, shared by objects: fs_shape_destroy. */
typedef struct fs_shape fs_shape;
/* A custom profile function; immutable, shared by profiles: fs_curve_destroy. */
typedef struct fs_curve fs_curve;
/* What a solid object's surface does, such as stick and slip; immutable, shared by objects: fs_surface_destroy. */
typedef struct fs_surface fs_surface;
/* What touches a scene in an application's own loop, with its memory of contacts: fs_tool_destroy. */
typedef struct fs_tool fs_tool;
/* A haptic device or the simulator: fs_device_close. */
typedef struct fs_device fs_device;
/* The loop between a scene and a device: fs_servo_stop. */
typedef struct fs_servo fs_servo;
/* Lets other processes connect to a servo: fs_server_stop. */
typedef struct fs_server fs_server;

#ifdef __cplusplus
}
#endif
#endif
