/* forceserver/device.h - haptic devices and the simulator. Conventions: forceserver.h. */
#ifndef FORCESERVER_DEVICE_H
#define FORCESERVER_DEVICE_H

#include <forceserver/evaluate.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The properties of a device. Growing. */
typedef struct fs_device_info {
  uint32_t struct_size;         /* sizeof(fs_device_info), by fs_device_info_init */
  uint32_t force_axes,          /* 0..3: n means forces along the first n of x, y, z */
           torque_axes;         /* 0..3: n means torques about the first n of x, y, z */
  uint32_t reserved;            /* 0 */
  char name[64], serial[64];    /* for people; serial may be empty */
  double workspace_radius,      /* m: a cylinder about z, centred on the origin */
         workspace_height,      /* m: of that cylinder */
         workspace_angle;       /* rad, each way; 0: the handle does not rotate */
  double force_max, torque_max; /* N, N m, in most of the workspace */
  double resolution;            /* m, of the position: the largest step; 0: exact, or not known. Where it is 0, damping takes
                                   each step of an encoder for a motion, and may shake a hand at rest */
  double rate;                  /* Hz, preferred servo rate, 100..20000 */
  double delay;                 /* s from pose to force, in addition to the servo period, with the way through a link; a
                                   pose may be 20 ms + delay + 1/link_rate old before it is a fault (100 ms at most). A
                                   driver that measures it while a servo runs tells that in fs_servo_stats */
  double damping;               /* N s/m, its own, physical; 0 also if it is not known */
  double mass;                  /* kg, its own, felt at the handle; 0: not known, and a servo assumes 0.05 kg */
  double link_rate;             /* Hz, how often pose and force cross a link to a remote controller; 0: at each tick */
  double controller_rate;       /* Hz, 100..1e6, of a remote controller that renders local models (write_model in
                                   driver.h); 0: none, the servo alone makes the force */
  double controller_delay;      /* s from pose to force within that controller, in addition to its period */
  double controller_damping;    /* N s/m, the local damping of that controller, filtered at 100 Hz; the servo adds
                                   none */
  double watchdog;              /* s, how long after the last command the device itself ends its force, as when the program
                                   is killed; 0: not known; -1: it has none, so the force stays */
} fs_device_info;
FS_DEFINE_INIT(fs_device_info)

/* A device that can be opened. Frozen. */
typedef struct fs_device_entry {
  char uri[128],                /* for fs_device_open */
       label[128];              /* for people */
} fs_device_entry;

/* The devices that the drivers find at this moment, a list. */
FS_API fs_status fs_device_list(fs_device_entry *out, size_t capacity, size_t *count);

/* Opens a device. What stands before the first ':' names its driver: "sim:", a module ("dhd:0", "openhaptics:", "haply:0",
 * "falcon:0", "fidel:usb", "fidel:udp:HOST:PORT"), or one of your own (driver.h). Options follow as "?key=value&.." (nothing
 * is %-decoded); an unknown key is INVALID. May take seconds. NOT_FOUND: no such driver or device; DENIED: this user may not
 * open it; UNSUPPORTED, DISCONNECTED, TIMEOUT, IO (also: in use, or a module that cannot be loaded), VERSION (a maker's library
 * that is too old).
 *
 * "dhd:0" is the first device of Force Dimension, "dhd:SERIAL" the one with that serial number; options library=PATH (of the
 * maker's SDK, which must be installed), home=yes (the device then homes if it must, which moves it), rate=100..4000 (1000) and
 * falcon=yes.
 * "openhaptics:" is the default device of OpenHaptics (3D Systems Touch, Phantom), "openhaptics:NAME" the one with that configured
 * name; option library=PATH (of the maker's library, which must be installed).
 * "haply:0" is the first Haply Inverse3 of the Haply Inverse Service on this computer, "haply:DEVICE_ID" the one with that
 * identifier; options host= and port= (127.0.0.1, 10001), grip=ID (a Verse Grip, which gives orientation and buttons),
 * force=0.1..20 (5: the largest force, N), and dialect=3.4|3.5, where the service does not tell its version.
 * "falcon:0" is the first Novint Falcon, "falcon:SERIAL" the one with that serial number; options firmware=PATH, as a Falcon
 * that has been without power needs its firmware, and motor=1e3..1e5, its motor constant (device/falcon/README.md).
 * "fidel:usb" is a FIDEL on the USB, "fidel:usb:SERIAL" the one with that serial number; option calibration=FILE|none.
 * "fidel:udp:HOST:PORT" is the controller of a FIDEL on the network, such as the program fidel-controller (port 47811 if none
 * is given); options render=model|force (model), and hz=100..1000, the states that it sends a second (500; of forces 1000).
 * The pages of device/ describe these devices, and what a person does first.
 *
 * "sim:" is a simulated FIDEL, the device of the paper, and the hand on it. Its workspace is a cylinder about z of
 * radius 0.150 m and height 0.200 m (x, y within 0.150, z within -0.100..0.100), with end stops 0.010 m beyond; its
 * wrist rotates 0.35 rad (20 degrees) each way; it gives 25 N, and with wrist=active 0.5 N m. The hand is a mass at the
 * handle that a spring and a damper pull to its target, where the hand wants to be:
 *
 *     hand        kg       N s/m    N/m
 *     nominal     0.554    6.45     135      measured: Scientific Reports, srep18004, figure 3
 *     firm        0.8      5.5      568      measured: N. Hogan
 *     light       0.15     3        100      assumed
 *     released    0        0        0        nobody holds it
 *     worst       as light, with friction=0 and delay_ms=1 unless those are given: what shakes, shakes here first
 *
 *     path        target, m, t s after the first reading                       period     top speed
 *     figure8     x = 0.06 sin(wt), y = 0.03 sin(2wt), z = 0                   4 s        0.133 m/s
 *     sweep       x = -0.10 cos(wt), y = z = 0                                 5 s        0.126 m/s
 *     touch       x = y = 0, z = 0.02 + 0.04 cos(wt): from 0.06 to -0.02       2 s        0.126 m/s
 *
 * Forces push the hand off its target. The keys of "sim:", with their defaults in parentheses:
 *     hand=nominal|firm|light|released|worst       the hand (nominal); its values one by one:
 *     hand_mass, hand_damping, hand_stiffness      kg 0..10, N s/m 0..1000, N/m 0..1e5
 *     hold=X,Y,Z                                   m, within 1: a target that stands still (0,0,0); or
 *     path=figure8|sweep|touch|FILE                a target that moves, from the first reading on; FILE: lines of
 *                                                  "t x y z" (s, rising; m, within 1), straight between, '#': comment
 *     mass, friction                               of the device: kg 0.01..10 (0.3), N 0..20 (0.3)
 *     encoder=joint|ideal                          positions quantised as by encoders in the joints (default), or exact
 *     wrist=passive|active                         passive (default): no torque
 *     delay_ms                                     0..1000 (0), from force sent to force felt
 *     seed                                         of the encoders' starting offsets, 0..4294967295 (0)
 *     link=force|model                             a controller of 1 kHz at the device, behind a link: it passes on the
 *                                                  force sent, or renders local models (driver.h) with a damping of
 *                                                  5 N s/m of its own. When no command has come for 0.1 s (a model:
 *                                                  for its hold time), its force fades within 0.1 s. Default: no link
 *     link_ms                                      0..1000 (10), from a pose to the force that answers it
 *     link_hz                                      10..10000 (100), how often a pose comes and its answer goes */
FS_API fs_status fs_device_open(const char *uri, fs_device **out);

/* Gives the device back after setting its force to 0; null does nothing. A servo that uses the device goes on. */
FS_API void fs_device_close(fs_device *device);

/* Fills out, which fs_device_info_init made. VERSION. */
FS_API fs_status fs_device_get_info(fs_device *device, fs_device_info *out);

/* For calibration and tests, as is fs_device_write: the newest state, device frame; it does not wait for a newer one.
 * STATE while a servo has the device; INVALID: the driver gave numbers that are not finite; DISCONNECTED, IO. */
FS_API fs_status fs_device_read(fs_device *device, fs_state *out);

/* Sends a force and torque, device frame, not guarded, but scaled down to the device's maxima with the direction kept;
 * axes that the device does not have get 0. It stays until the next fs_device_write, a servo's first tick,
 * fs_device_close, the loss of the device or the end of the process by exit; while a driver's receive fails, 0 is sent. Does
 * not wait. STATE while a servo has the device; DISCONNECTED, IO. */
FS_API fs_status fs_device_write(fs_device *device, const fs_wrench *wrench);

/* What a device answers to a request. Frozen. */
typedef struct fs_answer {
  char text[512];               /* cut where it is longer */
} fs_answer;

/* Asks the driver for something that only this kind of device knows, such as "home" or "lights=green"; the page of the device
 * lists its requests. Any thread, also while a servo has the device; may take seconds. UNSUPPORTED: the device does not know
 * the request; INVALID: its value; STATE: not at present. DISCONNECTED, TIMEOUT, IO. */
FS_API fs_status fs_device_control(fs_device *device, const char *request, fs_answer *out);

#ifdef __cplusplus
}
#endif
#endif
