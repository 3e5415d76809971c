/* A driver for WoodenHaptics, an arm of plywood with three motors that anybody can build, in one file: take it as the beginning
 * of a driver for your own device. README.md leads through it, and names the source of each figure.
 *
 *     woodenhaptics:/dev/hidraw0?config=FILE[&homed=yes]
 *
 * The device is a USB HID device. Linux gives it a node, from which each read takes a report of 8 bytes: the counts of three
 * encoders and a number that grows by 1. Each write sends a report with the currents of the three motors. */
#define _GNU_SOURCE  /* strtod_l */
#include <errno.h>
#include <fcntl.h>
#include <linux/hidraw.h>
#include <locale.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <forceserver/driver.h>

enum { REPORT_SIZE = 8, VENDOR = 0x1234, PRODUCT = 0x0006 };
static const double PI = 3.14159265358979323846;
static const double CURRENT_MAX = 3;        /* A, of a motor; the firmware gives no more */
static const double COUNTS_MAX = 200;       /* a millisecond: the arm would turn by 40 rad/s */
static const int DOUBTS_MAX = 10;           /* reports one after the other that cannot be true */
static const int FIRST = 5;                 /* reports after opening: the device may have had some ready for long */
static const double WATCHDOG = 0.5;         /* s: then the firmware switches the motors off */
static const double DELAY = 0.002;          /* s: a report waits 1 ms for the bus on each way, 0.5 ms on average, and the
                                               firmware looks for a new one once a ms */

/* ------------------------------------------------------------------------------------------------------------- the mechanism
 * Body a turns about the vertical. On it stands body b, and on top of that hangs body c with the handle at its end; a motor turns
 * each of them by a thin drum, the capstan. */
typedef struct config {
  double capstan[3], body[3];               /* m, diameters: a motor turns body/capstan times as far as its body */
  double length[3];                         /* m: the height of the joint of b; of b; of c */
  double origin[3];                         /* m: the centre of the workspace; x towards the user, y to the right, z up */
  double radius;                            /* m, of the workspace */
  double torque_constant[3];                /* N m/A, of a motor */
  double counts[3];                         /* of an encoder, in a turn of its motor */
  double force_max;                         /* N */
  double gravity;                           /* m/s^2, by which the weight is compensated: this driver cannot */
} config;

/* The numbers of the file that are used, by name and last letter, with the range that is plausible. */
static const struct {
  const char *name, *letters;
  size_t offset;
  double low, high;
} fields[] = {{"diameter_capstan_", "abc", offsetof(config, capstan), 0.001, 0.1},
              {"diameter_body_", "abc", offsetof(config, body), 0.01, 1},
              {"length_body_", "abc", offsetof(config, length), 0.01, 2},
              {"workspace_origin_", "xyz", offsetof(config, origin), -2, 2},
              {"workspace_radius", "", offsetof(config, radius), 0.01, 2},
              {"torque_constant_motor_", "abc", offsetof(config, torque_constant), 0.001, 1},
              {"cpr_encoder_", "abc", offsetof(config, counts), 100, 100000},
              {"max_linear_force", "", offsetof(config, force_max), 0.1, 100},
              {"g_constant", "", offsetof(config, gravity), 0, 0}};

/* Forward. At home b stands upright and c points level at the user: the angles are 0, 0, pi/2. From there each angle becomes
 * smaller as its encoder counts up. b and c are measured from the vertical, c from straight down: the motor of c sits on a. */
static void angles_of(const config *c, const int32_t count[3], double angle[3])
{
  for (int i = 0; i < 3; ++i) angle[i] = (i == 2 ? PI / 2 : 0) - 2 * PI * count[i] / c->counts[i] * c->capstan[i] / c->body[i];
}

/* The position of the handle, and its derivatives by the three angles, in the device frame: x right, y away, z up. */
static fs_vec3 position_of(const config *c, const double angle[3], fs_vec3 derivative[3])
{
  const double sa = sin(angle[0]), ca = cos(angle[0]), sb = sin(angle[1]), cb = cos(angle[1]), sc = sin(angle[2]), cc = cos(angle[2]);
  const double b = c->length[1], l = c->length[2], reach = b * sb + l * sc;  /* from the vertical through body a */
  const fs_vec3 by_a = {reach * ca, reach * sa, 0}, by_b = {b * cb * sa, -b * cb * ca, -b * sb}, by_c = {l * cc * sa, -l * cc * ca, l * sc};
  const fs_vec3 p = {reach * sa - c->origin[1], c->origin[0] - reach * ca, c->length[0] + b * cb - l * cc - c->origin[2]};
  derivative[0] = by_a, derivative[1] = by_b, derivative[2] = by_c;
  return p;
}

/* Force to currents, mA. What turns a body by da does the work torque * da = force . (derivative da): so the torque is the product
 * of force and derivative. Where a motor cannot give its current, all three become smaller, and the direction remains. */
static void currents_of(const config *c, const double angle[3], const fs_vec3 *force, int16_t current[3])
{
  static const double sign[3] = {1, -1, -1};  /* a positive current turns a motor that way */
  fs_vec3 derivative[3];
  double amperes[3], largest = CURRENT_MAX;
  position_of(c, angle, derivative);
  for (int i = 0; i < 3; ++i) {
    const double torque = derivative[i].x * force->x + derivative[i].y * force->y + derivative[i].z * force->z;
    amperes[i] = sign[i] * torque * c->capstan[i] / c->body[i] / c->torque_constant[i];
    largest = fmax(largest, fabs(amperes[i]));
  }
  for (int i = 0; i < 3; ++i) current[i] = (int16_t)lrint(1000 * amperes[i] * CURRENT_MAX / largest);
}

/* ---------------------------------------------------------------------------------------------------------------- opening it */
/* A node that has been opened. A device that was lost has forgotten where it is, so that homed=yes of this node counts no more. */
typedef struct place {
  struct place *next;
  int was_lost;
  char node[];
} place;

typedef struct arm {
  config config;
  place *place;
  int fd;
  char serial[64];
  double came;                              /* s, when the newest report that was believed did; 0: none has */
  int seen, doubts;                         /* reports: up to FIRST, and since the newest that was believed */
  uint16_t last[3], number;                 /* counts and number of that report */
  uint64_t lost;                            /* reports of which only the gap in the numbers was seen */
  int32_t count[3];                         /* from home */
  int is_homed;
} arm;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;  /* of the fields from `came` on, and of the next: control is called beside receive */
static place *places;  /* they stay until the program ends, as a device that is lost is closed and opened anew */

static locale_t plain_numbers;  /* with a point, whatever the program's language is */

static fs_status refuse(fs_status status, const char *format, ...)
{
  char text[512];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return fs_fail(status, text);
}

static double now(void)
{
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* The file has lines as  "length_body_a": 0.08,  in any order; what is not used may be there, too. */
static fs_status read_config(const char *path, config *out)
{
  char text[8192] = "";
  FILE *file = fopen(path, "r");
  if (!file) return refuse(FS_ERROR_NOT_FOUND, "config is '%s': %s", path, strerror(errno));
  text[fread(text, 1, sizeof text - 1, file)] = 0;
  fclose(file);
  for (size_t f = 0; f < sizeof fields / sizeof *fields; ++f) {
    for (size_t i = 0; i == 0 || i < strlen(fields[f].letters); ++i) {
      char key[64], *end = NULL;
      double value = 0;
      snprintf(key, sizeof key, "\"%s%.1s\"", fields[f].name, fields[f].letters + i);
      const char *at = strstr(text, key), *colon = at ? at + strlen(key) : NULL;
      if (colon && *(colon += strspn(colon, " \t")) == ':') value = strtod_l(colon + 1, &end, plain_numbers);
      if (!end || end == colon + 1) return refuse(FS_ERROR_PARSE, "config '%s' has no number %s", path, key);
      if (!(value >= fields[f].low && value <= fields[f].high))
        return refuse(FS_ERROR_INVALID, "config '%s': %s is %g, must be within %g..%g", path, key, value, fields[f].low, fields[f].high);
      ((double *)(void *)((char *)out + fields[f].offset))[i] = value;
    }
  }
  return FS_OK;
}

/* Splits "NODE?config=FILE&homed=yes", which is changed by that. */
static fs_status read_address(char *address, char **config_path, int *is_homed)
{
  char *rest = NULL, *option = strchr(address, '?');
  if (option) *option++ = 0;
  for (option = option ? strtok_r(option, "&", &rest) : NULL; option; option = strtok_r(NULL, "&", &rest)) {
    if (!strncmp(option, "config=", 7)) *config_path = option + 7;
    else if (!strcmp(option, "homed=yes")) *is_homed = 1;
    else return refuse(FS_ERROR_INVALID, "option '%s' is not known; the options are config=FILE and homed=yes", option);
  }
  if (!*address) return refuse(FS_ERROR_INVALID, "the device has no node; write woodenhaptics:/dev/hidraw0?config=FILE");
  return *config_path ? FS_OK : refuse(FS_ERROR_INVALID, "option config=FILE is missing: a file as woodenhaptics.json");
}

static fs_status open_node(arm *it, const char *node)
{
  struct hidraw_devinfo id;
  struct stat info;
  it->fd = open(node, O_RDWR | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
  if (it->fd < 0) {
    if (errno == EACCES) return refuse(FS_ERROR_DENIED, "%s may not be opened by this user: a udev rule is needed (README.md, step 1)", node);
    return refuse(errno == ENOENT || errno == ENODEV ? FS_ERROR_NOT_FOUND : FS_ERROR_IO, "%s: %s", node, strerror(errno));
  }
  if (fstat(it->fd, &info) || !S_ISCHR(info.st_mode)) return refuse(FS_ERROR_INVALID, "%s is no device, must be a node of hidraw", node);
  if (flock(it->fd, LOCK_EX | LOCK_NB)) return refuse(FS_ERROR_IO, "%s is in use by another program, or by this one", node);
  if (ioctl(it->fd, HIDIOCGRAWINFO, &id) == 0 && ((id.vendor & 0xffff) != VENDOR || (id.product & 0xffff) != PRODUCT))
    return refuse(FS_ERROR_NOT_FOUND, "%s is the device %04x:%04x, must be %04x:%04x; see /sys/class/hidraw/*/device/uevent", node,
                  id.vendor & 0xffff, id.product & 0xffff, VENDOR, PRODUCT);
  if (ioctl(it->fd, HIDIOCGRAWUNIQ(sizeof it->serial - 1), it->serial) <= 1)
    snprintf(it->serial, sizeof it->serial, "at %.60s", node);  /* it has no serial number: known by its place */
  return FS_OK;
}

/* The place of a node, or null where there is no memory for one. Called with the lock. */
static place *place_of(const char *node)
{
  place *it = places;
  while (it && strcmp(it->node, node)) it = it->next;
  if (it || !(it = calloc(1, sizeof *it + strlen(node) + 1))) return it;
  strcpy(it->node, node);
  it->next = places;
  return places = it;
}

static fs_status arm_open(const char *address, void **self)
{
  char *text = strdup(address), *config_path = NULL;
  arm *it = calloc(1, sizeof *it);
  fs_status status = text && it ? FS_OK : refuse(FS_ERROR_MEMORY, "no memory for the device");
  if (it) it->fd = -1;
  if (!status) status = read_address(text, &config_path, &it->is_homed);
  if (!status) status = read_config(config_path, &it->config);
  if (!status) status = open_node(it, text);
  if (!status) {
    pthread_mutex_lock(&lock);
    it->place = place_of(text);
    if (it->place && it->place->was_lost) it->is_homed = 0;
    pthread_mutex_unlock(&lock);
    if (!it->place) status = refuse(FS_ERROR_MEMORY, "no memory for the device");
  }
  free(text);
  if (!status) *self = it;
  else if (it && it->fd >= 0) close(it->fd);
  if (status) free(it);
  return status;
}

static fs_status arm_get_info(void *self, fs_device_info *out)
{
  const arm *it = self;
  const config *c = &it->config;
  strcpy(out->name, "WoodenHaptics");
  strcpy(out->serial, it->serial);
  out->force_axes = 3;
  out->force_max = c->force_max;
  out->workspace_radius = c->radius;
  out->workspace_height = 2 * c->radius;
  for (int i = 0; i < 3; ++i) {  /* a count moves the handle by its angle times the length that turns */
    const double turns = i == 0 ? fabs(c->origin[0]) + c->radius : c->length[i];
    out->resolution = fmax(out->resolution, turns * 2 * PI / c->counts[i] * c->capstan[i] / c->body[i]);
  }
  out->rate = 1000;
  out->delay = DELAY;
  out->watchdog = WATCHDOG;
  return FS_OK;
}

/* --------------------------------------------------------------------------------------------------------------- running it */
/* Whether a report can be true. Called with the lock. */
static int take_report(arm *it, const uint8_t report[REPORT_SIZE], double time)
{
  uint16_t value[4];
  int16_t step[3];
  for (int i = 0; i < 4; ++i) value[i] = (uint16_t)(report[2 * i] | report[2 * i + 1] << 8);
  const int is_first = it->seen < FIRST;
  const uint16_t gap = (uint16_t)(value[3] - it->number);  /* ms, as the device sends one in each */
  const double way_max = COUNTS_MAX * fmin(1 + gap, 2 + 1000 * (time - it->came));
  int is_possible = 1;
  for (int i = 0; i < 3; ++i) {  /* the counter of 16 bits runs over; a step that is short enough does not */
    step[i] = (int16_t)(uint16_t)(value[i] - it->last[i]);
    if (!is_first && abs(step[i]) > way_max) is_possible = 0;
  }
  if (!is_possible && ++it->doubts < DOUBTS_MAX) return 0;
  if (!is_possible) it->is_homed = 0, it->place->was_lost = 1;  /* so the encoder has jumped, and the arm is elsewhere */
  it->seen += is_first;
  if (!is_first && is_possible) it->lost += gap > 0 ? gap - 1u : 0;  /* the same number: nothing was lost */
  for (int i = 0; i < 3; ++i) {
    it->count[i] = is_first ? (int16_t)value[i] : it->count[i] + step[i];
    it->last[i] = value[i];
  }
  it->number = value[3];
  it->came = time;
  it->doubts = 0;
  return 1;
}

static fs_status lost(arm *it)
{
  pthread_mutex_lock(&lock);
  it->place->was_lost = 1;
  pthread_mutex_unlock(&lock);
  return FS_ERROR_DISCONNECTED;
}

static fs_status arm_receive(void *self, fs_state *out)
{
  enum { QUEUE = 64 };  /* reports that Linux keeps */
  arm *it = self;
  struct pollfd node = {it->fd, POLLIN, 0};
  uint8_t report[REPORT_SIZE];
  ssize_t size = 0;
  int taken = 0, odd = 0;
  if (poll(&node, 1, 20) <= 0) return FS_ERROR_TIMEOUT;
  for (int i = 0; i < QUEUE && (size = read(it->fd, report, sizeof report)) > 0; ++i) {  /* all that wait: the newest counts */
    pthread_mutex_lock(&lock);
    const int is_good = size == REPORT_SIZE && take_report(it, report, now());
    pthread_mutex_unlock(&lock);
    taken += is_good;
    odd = !is_good;
  }
  if (size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR) || (!taken && !odd && node.revents & (POLLHUP | POLLERR))) return lost(it);
  if (odd || !taken) return odd ? FS_ERROR_IO : FS_ERROR_TIMEOUT;

  double angle[3];
  fs_vec3 derivative[3];
  pthread_mutex_lock(&lock);
  out->flags = it->is_homed ? FS_STATE_READY : FS_STATE_NOT_HOMED;
  const int is_known = it->seen == FIRST;
  angles_of(&it->config, it->count, angle);
  pthread_mutex_unlock(&lock);
  if (!is_known) return FS_ERROR_TIMEOUT;  /* the next one comes soon */
  if (out->flags == FS_STATE_READY) out->pose.position = position_of(&it->config, angle, derivative);
  return FS_OK;
}

static fs_status arm_send(void *self, const fs_wrench *wrench)
{
  arm *it = self;
  double angle[3];
  int16_t current[3] = {0, 0, 0};
  uint8_t report[1 + REPORT_SIZE] = {0};  /* first the number of the report: 0, as this device has only one */
  pthread_mutex_lock(&lock);
  const int is_known = it->is_homed && it->seen == FIRST;
  angles_of(&it->config, it->count, angle);
  pthread_mutex_unlock(&lock);
  if (is_known) currents_of(&it->config, angle, &wrench->force, current);
  for (int i = 0; i < 3; ++i) {
    report[1 + 2 * i] = (uint8_t)((uint16_t)current[i] & 0xff);
    report[2 + 2 * i] = (uint8_t)((uint16_t)current[i] >> 8);
  }
  const ssize_t written = write(it->fd, report, sizeof report);
  if (written == (ssize_t)sizeof report) return FS_OK;
  return written < 0 && (errno == EIO || errno == ENODEV) ? lost(it) : FS_ERROR_IO;  /* a short write sets no errno */
}

static void arm_close(void *self)
{
  arm *it = self;
  const fs_wrench none = {{0, 0, 0}, {0, 0, 0}};
  arm_send(it, &none);  /* a write to the node returns when the device has the report */
  close(it->fd);
  free(it);
}

/* "home": the handle is in its home position, and held still. Takes 0.2 s, in which the device is not ready. */
static fs_status home(arm *it)
{
  const struct timespec moment = {0, 200000000};
  int32_t before[3];
  int most = 0, most_raw = 0;
  pthread_mutex_lock(&lock);
  it->is_homed = 0;
  memcpy(before, it->count, sizeof before);
  pthread_mutex_unlock(&lock);
  nanosleep(&moment, NULL);
  pthread_mutex_lock(&lock);
  const int is_fresh = it->seen == FIRST && now() - it->came < 0.1;
  for (int i = 0; i < 3; ++i) most = abs(it->count[i] - before[i]) > most ? abs(it->count[i] - before[i]) : most;
  for (int i = 0; i < 3; ++i) most_raw = abs((int16_t)it->last[i]) > most_raw ? abs((int16_t)it->last[i]) : most_raw;
  if (is_fresh && most <= 20) {
    if (most_raw <= 20) it->place->was_lost = 0;  /* it was at home when it got power again: homed=yes is true once more */
    memset(it->count, 0, sizeof it->count);
    it->is_homed = 1;
  }
  pthread_mutex_unlock(&lock);
  if (!is_fresh) return refuse(FS_ERROR_TIMEOUT, "no report has come for 0.1 s, so the device cannot be homed");
  return most <= 20 ? FS_OK : refuse(FS_ERROR_STATE, "the handle moved by %d counts in 0.2 s, must be at most 20: hold it still", most);
}

static fs_status arm_control(void *self, const char *request, char *answer, size_t size)
{
  arm *it = self;
  if (!strcmp(request, "home")) return home(it);
  if (strcmp(request, "status")) return refuse(FS_ERROR_UNSUPPORTED, "'%s' is not known; the requests are home and status", request);
  pthread_mutex_lock(&lock);
  snprintf(answer, size, "counts %d %d %d, %s, %llu reports lost", (int)it->count[0], (int)it->count[1], (int)it->count[2],
           it->is_homed ? "homed" : "not homed", (unsigned long long)it->lost);
  pthread_mutex_unlock(&lock);
  return FS_OK;
}

/* No FS_DRIVER_IN_SERVO: a write to a node of hidraw waits for the device, and for 5 s if that takes nothing. */
FS_API const fs_driver *fs_driver_entry(void);
const fs_driver *fs_driver_entry(void)
{
  static const fs_driver driver = {.struct_size = sizeof driver, .scheme = "woodenhaptics", .open = arm_open, .close = arm_close,
    .get_info = arm_get_info, .receive = arm_receive, .send = arm_send, .control = arm_control};
  plain_numbers = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  return plain_numbers ? &driver : NULL;
}
