/* forceserver/device.h - haptic devices and the simulator. Conventions: forceserver.h. */
#ifndef FORCESERVER_DEVICE_H
#define FORCESERVER_DEVICE_H

#include <forceserver/evaluate.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fs_device_info {         /* growing */
  uint32_t struct_size;
  uint32_t force_axes, torque_axes;     /* 0..3 each */
  uint32_t reserved;
  char name[64], serial[64];
  double workspace_radius, workspace_height, workspace_angle;   /* m, m: cylinder about z, centred; rad each way */
  double force_max, torque_max;         /* N, N m, in most of the workspace */
  double resolution;                    /* m */
  double rate;                          /* Hz, as it likes to be served */
  double delay;                         /* s from pose to force, beside the servo period */
  double damping;                       /* N s/m, its own, physical */
  double mass;                          /* kg, its own, felt at the handle; 0: not known */
} fs_device_info;
FS_DEFINE_INIT(fs_device_info)
typedef struct fs_device_entry { char uri[128], label[128]; } fs_device_entry;  /* frozen */

FS_API fs_status fs_device_list(fs_device_entry *out, size_t capacity, size_t *count);
/* "sim:", "fidel:usb", "fidel:udp:HOST:PORT", "falcon:0"; then "?key=value&..": an unknown key is INVALID. NOT_FOUND,
 * UNSUPPORTED, DENIED, IO. sim: (a simulated FIDEL and the hand on it) takes hand=nominal|firm|light|released or
 * hand_mass, hand_damping, hand_stiffness (SI); hold=X,Y,Z where the hand wants to be, or path=figure8|sweep|touch|FILE
 * (lines "t x y z"); mass, friction (SI), encoder=joint|ideal, wrist=passive|active, delay_ms, seed; and a controller
 * behind a link: link=force|model, link_ms, link_hz. */
FS_API fs_status fs_device_open(const char *uri, fs_device **out);
FS_API void fs_device_close(fs_device *device);         /* force to 0 first */
FS_API fs_status fs_device_get_info(fs_device *device, fs_device_info *out);
/* For calibration and tests, device frame, not guarded but scaled into the maxima; neither waits. STATE while a servo
 * has the device; DISCONNECTED, IO. */
FS_API fs_status fs_device_read(fs_device *device, fs_state *out);
FS_API fs_status fs_device_write(fs_device *device, const fs_wrench *wrench);

#ifdef __cplusplus
}
#endif
#endif
