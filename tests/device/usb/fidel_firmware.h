/* A reference firmware of FIDEL, written from device/fidel/USB.md alone: freestanding C99, without a heap, a clock or a bus of its
 * own. The board calls it: fidel_firmware_tick once each millisecond or more often, the others when the bus has something. One at
 * a time. */
#ifndef FIDEL_FIRMWARE_H
#define FIDEL_FIRMWARE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { FIDEL_REPORT_SIZE = 40, FIDEL_COMMAND_SIZE = 32, FIDEL_IDENTITY_SIZE = 64, FIDEL_STATUS_SIZE = 32 };

/* What a device is. */
typedef struct fidel_constants {
  char serial[16];              /* followed by zeros where it is shorter */
  uint16_t firmware_version;
  uint32_t base_radius, platform_radius, upper_arm, forearm, centre_depth; /* um */
  uint32_t joint_counts, wrist_counts;                                     /* a revolution */
  uint32_t joint_torque, wrist_torque;                                     /* uN m */
  uint32_t joint_speed;                                                    /* mrad/s */
} fidel_constants;

/* What the board sees at one moment. */
typedef struct fidel_inputs {
  int32_t counters[3];          /* of the joints: counts from wherever they were at power-up */
  uint8_t at_mark[3];           /* not 0: the joint has passed its reference mark since the moment before */
  int32_t mark_counters[3];     /* the counter when it did */
  int16_t wrist[3];
  uint16_t buttons;
  uint8_t stop_pressed, in_holder, hot, no_supply;
} fidel_inputs;

typedef struct fidel_firmware {
  fidel_constants constants;
  uint32_t now, last_tick;      /* us */
  uint32_t command_time;        /* us, when the newest accepted command came */
  uint16_t command_number, report_number;
  uint8_t has_command, has_ticked, has_watchdog, has_stop, has_over_speed, is_limited;
  uint16_t marks;               /* bit i: of joint i */
  int32_t offsets[3];           /* counts: counter + offset is the angle */
  int32_t wanted[6];            /* uN m: joints, wrist; within the limits */
  int32_t history[16][3];       /* counters of the last ticks, by history_next */
  uint32_t history_times[16];
  unsigned history_next, history_count;
  fidel_inputs inputs;
  uint32_t reports, accepted, refused, limited, watchdog;
  int32_t torques[6];           /* uN m: what the amplifiers give; an output for the board */
} fidel_firmware;

void fidel_firmware_start(fidel_firmware *firmware, const fidel_constants *constants);
/* A turn of the loop; time: us. Afterwards `torques` holds what the amplifiers are to give. */
void fidel_firmware_tick(fidel_firmware *firmware, const fidel_inputs *inputs, uint32_t time);
/* What came to endpoint 0x01. */
void fidel_firmware_command(fidel_firmware *firmware, const uint8_t *bytes, size_t size, uint32_t time);
/* The report to lay into endpoint 0x81. */
void fidel_firmware_report(fidel_firmware *firmware, uint8_t out[FIDEL_REPORT_SIZE]);
/* A control transfer of the vendor's kind. Returns how many bytes of `answer` go to the host; -1: stall. */
int fidel_firmware_control(fidel_firmware *firmware, uint8_t request_type, uint8_t request, uint16_t value, uint16_t index,
                           uint16_t length, uint8_t answer[FIDEL_IDENTITY_SIZE]);
/* The bits of the status of a report. */
uint16_t fidel_firmware_status(const fidel_firmware *firmware);

#ifdef __cplusplus
}
#endif
#endif
