/* forceserver/server.h - lets other processes into a servo. Conventions: forceserver.h. 0.1: there is no server yet. */
#ifndef FORCESERVER_SERVER_H
#define FORCESERVER_SERVER_H

#include <forceserver/servo.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Growing; made by fs_server_options_init; all zeros are the defaults. */
typedef struct fs_server_options {
  uint32_t struct_size;         /* sizeof(fs_server_options), by fs_server_options_init */
  uint32_t max_clients;         /* 0: 32 */
  uint32_t max_objects;         /* a client; 0: 4096 */
  uint32_t max_megabytes;       /* of shapes, a client; 0: 1024 */
  double lease;                 /* s from the loss of a client to the start of its fade; 0: 0.2 */
  double force_limit;           /* N, of one client's summed force; 0: the servo's */
  bool locked;                  /* a client changes its own objects only */
  bool all_users;               /* other users of this machine may connect */
  uint8_t reserved[6];          /* 0 */
} fs_server_options;
FS_DEFINE_INIT(fs_server_options)

/* Lets other processes in, at endpoint ("shm:NAME" or "dds:DOMAIN"): their scenes' forces add to those of the servo's
 * own. options null: defaults. EXISTS, IO, UNSUPPORTED, VERSION. 0.1: UNSUPPORTED. */
FS_API fs_status fs_server_start(fs_servo *servo, const char *endpoint, const fs_server_options *options,
                                 fs_server **out);

/* Closes the door; the objects of its clients fade. Null does nothing. */
FS_API void fs_server_stop(fs_server *server);

#ifdef __cplusplus
}
#endif
#endif
