/* forceserver/base.h - version, status, plain data and the handles. */
#ifndef FORCESERVER_BASE_H
#define FORCESERVER_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(SWIG) || !defined(__GNUC__)
#  define FS_API
#else
#  define FS_API __attribute__((visibility("default")))
#endif
#define FS_VERSION_MAJOR 0
#define FS_VERSION_MINOR 1
#define FS_VERSION_PATCH 0
#define FS_NAME_SIZE 64         /* bytes of a name with its end */
#define FS_TOOL_POINTS_MAX 32
#define FS_NOW 0.0
#define FS_DEFINE_INIT(type) static inline type type##_init(void) \
  { type v; memset(&v, 0, sizeof v); v.struct_size = (uint32_t)sizeof v; return v; }

#ifdef __cplusplus
extern "C" {
#endif

typedef enum fs_status {
  FS_OK = 0,
  FS_ERROR_INVALID = -1,        /* an argument or field out of range */
  FS_ERROR_NOT_FOUND = -2,      /* no such object, file, device, server or driver */
  FS_ERROR_EXISTS = -3,         /* client name, endpoint or scheme taken */
  FS_ERROR_STATE = -4,          /* not now: commit without begin, device owned by a servo, scene without a servo */
  FS_ERROR_VERSION = -5,        /* a struct, server or driver newer than this library */
  FS_ERROR_UNSUPPORTED = -6,    /* not built in, or not for this kind of scene, servo or device */
  FS_ERROR_MEMORY = -7,
  FS_ERROR_IO = -8,             /* the system refused; the sentence has its reason */
  FS_ERROR_PARSE = -9,          /* JSON, mesh file or expression; the sentence has line or column */
  FS_ERROR_TIMEOUT = -10,
  FS_ERROR_DISCONNECTED = -11,  /* server gone: so it stays for this handle; or device gone: asked again each tick */
  FS_ERROR_DENIED = -12,        /* another user's server, or another client's object where those are locked */
  FS_ERROR_FULL = -13,          /* a stated maximum is reached */
  FS_ERROR_INTERNAL = -14,      /* our bug */
  FS_STATUS_FORCE_32 = 0x7fffffff
} fs_status;

FS_API const char *fs_version(void);                    /* "0.1.0", of the library that runs; static */
FS_API const char *fs_status_name(fs_status status);    /* "FS_ERROR_INVALID"; static, never null */
FS_API const char *fs_last_error(void);                 /* of this thread's last failure, until its next; never null */

/* Frozen plain data. */
typedef struct fs_vec3 { double x, y, z; } fs_vec3;
typedef struct fs_quat { double w, x, y, z; } fs_quat;
typedef struct fs_pose { fs_vec3 position; fs_quat orientation; } fs_pose;
typedef struct fs_twist { fs_vec3 linear, angular; } fs_twist;  /* m/s of the origin, rad/s; along the parent's axes */
typedef struct fs_wrench { fs_vec3 force, torque; } fs_wrench;  /* N; N m about the origin of the tool */
typedef struct fs_mat3 { double xx, xy, xz, yx, yy, yz, zx, zy, zz; } fs_mat3;  /* row-major */

/* The pose at position whose z axis points along direction (any length > 0): a plane from point and normal. */
FS_API fs_status fs_pose_from_z(fs_vec3 position, fs_vec3 direction, fs_pose *out);

typedef struct fs_scene fs_scene;       /* the force-objects of one application */
typedef struct fs_shape fs_shape;       /* the points of a polyline or triangles of a mesh; immutable */
typedef struct fs_curve fs_curve;       /* a custom profile function; immutable */
typedef struct fs_tool fs_tool;         /* what touches a scene, with its memory */
typedef struct fs_device fs_device;
typedef struct fs_servo fs_servo;
typedef struct fs_server fs_server;

#ifdef __cplusplus
}
#endif
#endif
