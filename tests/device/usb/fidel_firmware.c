#include "fidel_firmware.h"

#include <string.h>

enum { VERSION = 1, WATCHDOG_US = 20000, SPEED_WINDOW_US = 4000, HISTORY = 16 };
enum {
  HOMED = 1, MARK_1 = 2, MOTORS = 16, EMERGENCY_STOP = 32, OVER_SPEED = 64, WATCHDOG = 128, LIMITED = 256, IN_HOLDER = 512,
  OVER_HEATED = 2048, NO_SUPPLY = 4096
};

/* -------------------------------------------------------------------------------------------------------- bytes */

static uint16_t crc16(const uint8_t *bytes, size_t size) {
  uint16_t crc = 0xffff;
  for (size_t i = 0; i < size; ++i) {
    /* A nibble at a time: the CRC of four bits is a product with 1 + x^5 + x^12. */
    for (int shift = 4; shift >= 0; shift -= 4) {
      const uint16_t top = (uint16_t)((crc >> 12) ^ ((bytes[i] >> shift) & 15));
      crc = (uint16_t)((crc << 4) ^ top ^ (top << 5) ^ (top << 12));
    }
  }
  return crc;
}

static void put16(uint8_t *at, uint16_t value) {
  at[0] = (uint8_t)value;
  at[1] = (uint8_t)(value >> 8);
}
static void put32(uint8_t *at, uint32_t value) {
  put16(at, (uint16_t)value);
  put16(at + 2, (uint16_t)(value >> 16));
}
static uint16_t get16(const uint8_t *at) { return (uint16_t)(at[0] | at[1] << 8); }
static int32_t get32(const uint8_t *at) { return (int32_t)(get16(at) | (uint32_t)get16(at + 2) << 16); }

static void begin(uint8_t *out, size_t size, char kind) {
  memset(out, 0, size);
  out[0] = (uint8_t)kind;
  out[1] = VERSION;
}
static void end(uint8_t *out, size_t size) { put16(out + size - 2, crc16(out, size - 2)); }

/* --------------------------------------------------------------------------------------------------------- state */

static int is_homed(const fidel_firmware *f) { return f->marks == 7; }

static int motors_may_act(const fidel_firmware *f) {
  return is_homed(f) && !f->has_stop && !f->has_over_speed && !f->has_watchdog && !f->inputs.hot && !f->inputs.no_supply;
}

uint16_t fidel_firmware_status(const fidel_firmware *f) {
  unsigned status = 0;
  if (is_homed(f)) status |= HOMED;
  status |= f->marks * MARK_1;
  if (motors_may_act(f)) status |= MOTORS;
  if (f->has_stop) status |= EMERGENCY_STOP;
  if (f->has_over_speed) status |= OVER_SPEED;
  if (f->has_watchdog) status |= WATCHDOG;
  if (f->is_limited) status |= LIMITED;
  if (f->inputs.in_holder) status |= IN_HOLDER;
  if (f->inputs.hot) status |= OVER_HEATED;
  if (f->inputs.no_supply) status |= NO_SUPPLY;
  return (uint16_t)status;
}

void fidel_firmware_start(fidel_firmware *f, const fidel_constants *constants) {
  memset(f, 0, sizeof *f);
  f->constants = *constants;
  f->has_watchdog = 1;
}

/* Each count of a joint is 2 pi/counts rad: mrad/s to counts in the window, rounded up. */
static int64_t counts_in_window(const fidel_firmware *f, uint32_t window) {
  const int64_t micro_turns = (int64_t)f->constants.joint_speed * 1000000 / 6283; /* a second */
  return micro_turns * f->constants.joint_counts / 1000000 * window / 1000000 + 1;
}

static void watch_speed(fidel_firmware *f) {
  unsigned i;
  for (i = 1; i <= f->history_count; ++i) {
    const unsigned place = (f->history_next + HISTORY - i) % HISTORY;
    const uint32_t window = f->now - f->history_times[place];
    if (window > SPEED_WINDOW_US + 1000) break;
    if (window < SPEED_WINDOW_US) continue;
    for (int joint = 0; joint < 3; ++joint) {
      int64_t way = (int64_t)f->inputs.counters[joint] - f->history[place][joint];
      if (way < 0) way = -way;
      if (way > counts_in_window(f, window)) f->has_over_speed = 1;
    }
    break;
  }
  f->history_times[f->history_next] = f->now;
  memcpy(f->history[f->history_next], f->inputs.counters, sizeof f->inputs.counters);
  f->history_next = (f->history_next + 1) % HISTORY;
  if (f->history_count < HISTORY) ++f->history_count;
}

static void find_marks(fidel_firmware *f) {
  const int32_t mark = (int32_t)((f->constants.joint_counts + 6) / 12);
  if (is_homed(f)) return;
  for (int joint = 0; joint < 3; ++joint) {
    if (!f->inputs.at_mark[joint]) continue;
    f->offsets[joint] = mark - f->inputs.mark_counters[joint];
    f->marks = (uint16_t)(f->marks | 1u << joint);
  }
}

void fidel_firmware_tick(fidel_firmware *f, const fidel_inputs *inputs, uint32_t time) {
  const uint32_t period = f->has_ticked ? time - f->last_tick : 1000;
  f->now = f->last_tick = time;
  f->has_ticked = 1;
  f->inputs = *inputs;
  if (inputs->stop_pressed) f->has_stop = 1;
  if (!f->has_watchdog && time - f->command_time + period > WATCHDOG_US) {
    f->has_watchdog = 1;
    ++f->watchdog;
  }
  watch_speed(f);
  find_marks(f);
  if (motors_may_act(f)) memcpy(f->torques, f->wanted, sizeof f->torques);
  else memset(f->torques, 0, sizeof f->torques);
}

/* ------------------------------------------------------------------------------------------------------- packets */

/* Brings three torques to the limit by one factor; says whether that was needed. */
static int limit(const int32_t *in, int32_t *out, uint32_t limit) {
  int64_t most = 0;
  for (int i = 0; i < 3; ++i) {
    const int64_t size = in[i] < 0 ? -(int64_t)in[i] : in[i];
    if (size > most) most = size;
  }
  for (int i = 0; i < 3; ++i) out[i] = most > limit ? (int32_t)((int64_t)in[i] * limit / most) : in[i];
  return most > limit;
}

void fidel_firmware_command(fidel_firmware *f, const uint8_t *bytes, size_t size, uint32_t time) {
  int32_t torques[6];
  f->now = time;
  const int is_whole = size == FIDEL_COMMAND_SIZE && bytes[0] == 'C' && bytes[1] == VERSION && get16(bytes + 28) == 0 &&
                       get16(bytes + 30) == crc16(bytes, 30);
  if (!is_whole) {
    ++f->refused;
    return;
  }
  const uint16_t number = get16(bytes + 2);
  const uint16_t ahead = (uint16_t)(number - f->command_number);
  if (f->has_command && !f->has_watchdog && (ahead == 0 || ahead >= 32768)) {
    ++f->refused;
    return;
  }
  for (int i = 0; i < 6; ++i) torques[i] = get32(bytes + 4 + 4 * i);
  const int joints = limit(torques, f->wanted, f->constants.joint_torque);
  const int wrist = limit(torques + 3, f->wanted + 3, f->constants.wrist_torque);
  f->is_limited = joints || wrist;
  if (f->is_limited) ++f->limited;
  f->has_command = 1;
  f->has_watchdog = 0;
  f->command_number = number;
  f->command_time = time;
  ++f->accepted;
}

void fidel_firmware_report(fidel_firmware *f, uint8_t out[FIDEL_REPORT_SIZE]) {
  const uint32_t age = f->now - f->command_time;
  begin(out, FIDEL_REPORT_SIZE, 'R');
  put16(out + 2, ++f->report_number);
  put32(out + 4, f->last_tick);
  for (int i = 0; i < 3; ++i) put32(out + 8 + 4 * i, (uint32_t)f->inputs.counters[i] + (uint32_t)f->offsets[i]);
  for (int i = 0; i < 3; ++i) put16(out + 20 + 2 * i, (uint16_t)f->inputs.wrist[i]);
  put16(out + 26, f->inputs.buttons);
  put16(out + 28, fidel_firmware_status(f));
  put16(out + 30, f->command_number);
  put16(out + 32, f->has_command && age < 65535 ? (uint16_t)age : 65535);
  put16(out + 34, (uint16_t)f->refused);
  end(out, FIDEL_REPORT_SIZE);
  ++f->reports;
}

static int identity(const fidel_firmware *f, uint8_t *out) {
  const fidel_constants *c = &f->constants;
  const uint32_t fields[10] = {c->base_radius,  c->platform_radius, c->upper_arm,    c->forearm,      c->centre_depth,
                               c->joint_counts, c->wrist_counts,    c->joint_torque, c->wrist_torque, c->joint_speed};
  begin(out, FIDEL_IDENTITY_SIZE, 'I');
  put16(out + 2, c->firmware_version);
  memcpy(out + 4, c->serial, sizeof c->serial);
  for (int i = 0; i < 10; ++i) put32(out + 20 + 4 * i, fields[i]);
  end(out, FIDEL_IDENTITY_SIZE);
  return FIDEL_IDENTITY_SIZE;
}

static int status(const fidel_firmware *f, uint8_t *out) {
  const uint32_t fields[6] = {f->now, f->reports, f->accepted, f->refused, f->limited, f->watchdog};
  begin(out, FIDEL_STATUS_SIZE, 'S');
  put16(out + 2, fidel_firmware_status(f));
  for (int i = 0; i < 6; ++i) put32(out + 4 + 4 * i, fields[i]);
  end(out, FIDEL_STATUS_SIZE);
  return FIDEL_STATUS_SIZE;
}

int fidel_firmware_control(fidel_firmware *f, uint8_t request_type, uint8_t request, uint16_t value, uint16_t index,
                           uint16_t length, uint8_t answer[FIDEL_IDENTITY_SIZE]) {
  int size = -1;
  if (value != 0 || index != 0) return -1;
  if (request_type == 0xc0 && request == 1) size = identity(f, answer);
  if (request_type == 0xc0 && request == 4) size = status(f, answer);
  if (size >= 0) return length < size ? length : size;
  if (request_type != 0x40 || length != 0) return -1;
  if (request == 2) {
    f->marks = 0;
    return 0;
  }
  if (request == 3 && !f->inputs.stop_pressed) {
    f->has_stop = f->has_over_speed = 0;
    f->history_count = 0;
    return 0;
  }
  return -1;
}
