/* forceserver/server.h - lets other processes into a servo. Conventions: forceserver.h.
 *
 * A client is a process, or a part of one, that calls fs_scene_connect: it has a scene of its own, with its own frame,
 * clutch and tool, and the forces of all scenes add. When a client is lost, even killed, its objects fade; nothing it
 * sends can do more than push within its force_limit. One that alone takes longer than a period in ten ticks
 * in a row, or whose force is not finite, is let go of, its force at once. The server has a thread that takes what the clients have
 * changed at the servo's rate, and two that build their meshes; all end with it, and nothing is left in the system.
 * That thread does so much for each client and no more: of one that moves more than 256 objects in every tick the
 * newest moves are taken some ticks later, and while a mesh waits, at most one mesh of each other client is built
 * before it.
 */
#ifndef FORCESERVER_SERVER_H
#define FORCESERVER_SERVER_H

#include <forceserver/servo.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Growing; made by fs_server_options_init; all zeros are the defaults. */
typedef struct fs_server_options {
  uint32_t struct_size;         /* sizeof(fs_server_options), by fs_server_options_init */
  uint32_t max_clients;         /* at most 4096; 0: 32. As many again, or 32, may be fading out */
  uint32_t max_objects;         /* a client, at most 65536; 0: 4096. As many again may be fading out */
  uint32_t max_megabytes;       /* of points, triangles and tables, a client, at most 1e6; 0: 1024 */
  double lease;                 /* s from the loss of a client to the start of its fade, at most 1e6; 0: 0.2 */
  double force_limit;           /* N, of one client's summed force, its torque in proportion; 0: the servo's */
  bool locked;                  /* a client changes its own objects only */
  bool all_users;               /* other users of this machine may connect */
  uint8_t reserved[6];          /* 0 */
} fs_server_options;
FS_DEFINE_INIT(fs_server_options)

/* Lets other processes in, at endpoint ("shm:NAME", 1..64 bytes without '/', or "dds:DOMAIN"): their scenes' forces
 * add to those of the servo's own. options null: defaults. EXISTS (a server of this user, or with all_users of
 * anybody, has the name), STATE (the servo was stopped), FULL (no descriptors), IO, UNSUPPORTED, VERSION. 0.1: dds is
 * UNSUPPORTED. */
FS_API fs_status fs_server_start(fs_servo *servo, const char *endpoint, const fs_server_options *options,
                                 fs_server **out);

/* A client of a server. Frozen. */
typedef struct fs_client {
  char name[FS_NAME_SIZE];      /* as it connected; "server": the server's own scene */
  uint32_t process, user;       /* ids of the system */
  uint32_t objects;             /* that it has now */
  uint32_t reserved_32;         /* 0 */
  double connected;             /* s, when it came, on the scene's clock; 0: the server itself */
  double force_limit;           /* N, of its summed force */
  fs_wrench wrench;             /* its sum at the last tick, as it was added; device frame */
  uint64_t moves,               /* of its objects, taken since it came; of two within a period one is taken */
           changes,             /* of its objects otherwise, of its frame, clutch and tool, and by it of others' */
           refused;             /* changes by it that were not taken */
  uint64_t limited;             /* ticks in which force_limit bounded it */
  uint64_t shape_bytes;         /* of its shapes and curves at the server */
  uint64_t reserved[4];         /* 0 */
} fs_client;

/* The clients of the server that this scene is connected to, a list; the server's own scene is the first. In this
 * process: UNSUPPORTED. TIMEOUT. */
FS_API fs_status fs_scene_get_clients(fs_scene *scene, fs_client *out, size_t capacity, size_t *count);

/* Closes the door; the objects of its clients fade, and their calls give DISCONNECTED. A mesh that is being built is
 * given up. What the clients had of memory is given back with the servo, or by its next server. Null does nothing. */
FS_API void fs_server_stop(fs_server *server);

#ifdef __cplusplus
}
#endif
#endif
