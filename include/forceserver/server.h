/* forceserver/server.h - lets other processes into a servo. Conventions: forceserver.h. */
#ifndef FORCESERVER_SERVER_H
#define FORCESERVER_SERVER_H

#include <forceserver/servo.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fs_server_options {      /* growing; all zeros are the defaults */
  uint32_t struct_size;
  uint32_t max_clients;                 /* 0: 32 */
  uint32_t max_objects;                 /* a client; 0: 4096 */
  uint32_t max_megabytes;               /* of shapes, a client; 0: 1024 */
  double lease;                         /* s from the loss of a client to the start of its fade; 0: 0.2 */
  double force_limit;                   /* N, of one client's summed force; 0: the servo's */
  bool locked;                          /* a client changes its own objects only */
  bool all_users;                       /* other users of this machine may connect */
  uint8_t reserved[6];
} fs_server_options;
FS_DEFINE_INIT(fs_server_options)
/* Lets other processes in: their scenes' forces add to those of the servo's own. options null: defaults. EXISTS, IO,
 * UNSUPPORTED. */
FS_API fs_status fs_server_start(fs_servo *servo, const char *endpoint, const fs_server_options *options,
                                 fs_server **out);
FS_API void fs_server_stop(fs_server *server);

#ifdef __cplusplus
}
#endif
#endif
