/* forceserver/server.h - lets other processes connect to a servo. Conventions: forceserver.h.
 *
 * A client is a process, or a part of one, that calls fs_scene_connect: it has a scene of its own, with its own frame,
 * clutch and tool, and the forces of all scenes add. When a client is lost, even killed, its objects fade; whatever it
 * sends, it cannot push with more than its force_limit. What lost clients still push counts to the limit of each
 * client that then connects by the same name or for the same user: programs that come again and again push no more than
 * those that stay. A client whose name has an '@', "client@site", is at another machine and is brought by a bridge: all clients
 * of one site (the text after the last '@') together push with no more than the force_limit, as if they were one client. Where
 * they want more, their sum is shortened with its direction kept, what lost ones still push included; each has its own limit,
 * too. A client that alone takes longer than a period in ten ticks in a row, or whose force is not finite, is disconnected,
 * and its force is 0 at once. The server has a thread that takes the clients' changes at the servo's
 * rate, and two threads that build their meshes; all end with the server, and nothing remains in the system. Other
 * users cannot pose as a server or as a client of this user: both ends ask the system whose process the other is, and
 * tell it nothing before. Nor can they keep a server from its name: they can take its address, which is in the abstract
 * name space of sockets; then it listens at a socket .forceserver-NAME in /run/user/UID, or else in the user's home, if
 * the folder is the user's and no other user can write there. (That file stays until the next server of the name if the
 * process ends without fs_server_stop.) But the name of a server with all_users goes to whoever takes it first. What
 * these threads do for one client is bounded: when a client moves more than 256 objects in every tick, its newest moves
 * are taken some ticks later; and a mesh waits for at most one mesh of each other client.
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
  uint32_t max_clients;         /* at most 4096; 0: 32. max(max_clients, 32) more may still be fading out */
  uint32_t max_objects;         /* per client, at most 65536; 0: 4096. As many more may be fading out */
  uint32_t max_megabytes;       /* of points, triangles and tables, per client, at most 1e6; 0: 1024 */
  double lease;                 /* s from the loss of a client to the start of its fade, at most 1e6; 0: 0.2 */
  double force_limit;           /* N, of one client's summed force, whose torque is reduced in proportion; 0: the
                                   servo's. What lost clients push counts to it (above); and of the summed force of all
                                   clients of one site */
  bool locked;                  /* a client can change its own objects only */
  bool all_users;               /* other users of this machine may connect */
  bool no_stop;                 /* a client cannot end the force: fs_scene_stop_force is DENIED */
  uint8_t reserved[5];          /* 0 */
} fs_server_options;
FS_DEFINE_INIT(fs_server_options)

/* Starts a server to which other processes can connect at endpoint ("shm:NAME", 1..64 bytes without '/'). Processes of other
 * machines come through the program forceserver-bridge, a client of the server; "dds:.." is UNSUPPORTED. The forces of their
 * scenes add to those of the servo's own scene. options null: defaults. EXISTS (a
 * server of this user, or with all_users anybody, has the name already), STATE (the servo has a server already, or was
 * stopped), FULL (no file descriptors left), IO, UNSUPPORTED, VERSION. */
FS_API fs_status fs_server_start(fs_servo *servo, const char *endpoint, const fs_server_options *options,
                                 fs_server **out);

/* A client of a server. Frozen. */
typedef struct fs_client {
  char name[FS_NAME_SIZE];      /* its client_name; "server": the server's own scene */
  uint32_t process, user;       /* the system's ids of them */
  uint32_t objects;             /* the number of objects that it has now: as many as other clients find in
                                   fs_scene_get_motions */
  uint32_t reserved_32;         /* 0 */
  double connected;             /* s, when it connected, on the scene's clock; 0: the server itself */
  double force_limit;           /* N, of its summed force */
  fs_wrench wrench;             /* its summed force at the last tick, as it was added; device frame */
  uint64_t moves,               /* moves of its objects taken since it connected; of two within a period one is taken */
           changes,             /* other changes of its objects, of its frame, clutch and tool, and of other clients'
                                   objects by it */
           refused;             /* changes by it that were refused */
  uint64_t limited;             /* ticks in which force_limit bounded it, alone or with others of its site */
  uint64_t shape_bytes;         /* size of its shapes, curves and surfaces at the server */
  uint64_t reserved[4];         /* 0 */
} fs_client;

/* The clients of the server that this scene is connected to, a list; the first is the server's own scene. A client that
 * has left or was lost is not listed, although its force may still fade out. A scene in this process: UNSUPPORTED.
 * TIMEOUT, FULL (no file descriptors left). */
FS_API fs_status fs_scene_get_clients(fs_scene *scene, fs_client *out, size_t capacity, size_t *count);

/* The view of a client. Frozen. */
typedef struct fs_client_view {
  char name[FS_NAME_SIZE];      /* of the client, as in fs_client */
  fs_view view;                 /* as fs_scene_get_view gives it */
} fs_client_view;

/* The views of the clients of the server that this scene is connected to, a list in the order of fs_scene_get_clients:
 * one request for viewers and editors. Each is what fs_scene_get_view gives for that client: this scene's own with all
 * changes made before the call and those of the thread's group, the others' as the server has them, without the changes of
 * a group that is not committed. A scene in this process: UNSUPPORTED. TIMEOUT, FULL. */
FS_API fs_status fs_scene_get_views(fs_scene *scene, fs_client_view *out, size_t capacity, size_t *count);

/* Stops the server: the objects of its clients fade, and their calls return DISCONNECTED. A mesh that is being built is
 * abandoned. The memory that the clients used is freed with the servo, or by its next server. Null does nothing. */
FS_API void fs_server_stop(fs_server *server);

#ifdef __cplusplus
}
#endif
#endif
