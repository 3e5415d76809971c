/* Devices for the first touch, "hello:NAME". The hand and the person are another process, at two files of one letter in the
 * current folder: `hand` says where the hand holds the handle (m in the middle, b 10 mm to the right of it, r a u 50 mm to the
 * right, away, up), and `felt` which way the motors really push (r l a t u d; n: not at all). The handle yields by 7 mm/N.
 * right      all is well
 * exchanged  x and y of the poses are exchanged, and the sign of what becomes y
 * mirrored   z of the poses has the wrong sign
 * backwards  the motors push the other way
 * turned     poses and motors: x and y both with the wrong sign; no watchdog
 * scaled     the poses are 10 times too large
 * deaf       the motors do nothing
 * unready    it is never ready
 * lost       it is lost at the second push
 * forceless  it has no motors */
#include <fcntl.h>
#include <math.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <forceserver/driver.h>

static char name[16];
static int hand, felt, pushes, is_pushing;
static double at[3], pushed[3]; /* m, N: in truth, to the right, away, up */

static int is(const char *other) { return strcmp(name, other) == 0; }

static fs_status device_open(const char *address, void **self)
{
  strncpy(name, address, sizeof name - 1);
  hand = open("hand", O_RDONLY | O_CLOEXEC);
  felt = open("felt", O_WRONLY | O_CLOEXEC);
  *self = name;
  return hand < 0 || felt < 0 ? fs_fail(FS_ERROR_IO, "there are no files hand and felt") : FS_OK;
}
static void device_close(void *self)
{
  (void)self;
  close(hand);
  close(felt);
}
static fs_status get_info(void *self, fs_device_info *out)
{
  (void)self;
  strcpy(out->name, "hello");
  strcpy(out->serial, "no/1");
  out->rate = 1000;
  out->mass = 0.3;
  out->damping = 1;
  out->force_axes = is("forceless") ? 0 : 3;
  out->force_max = is("forceless") ? 0 : 2;
  out->workspace_radius = out->workspace_height = 0.1;
  if (is("turned")) out->watchdog = -1;
  return FS_OK;
}
/* The handle goes where the hand and the motors want it, with 0.5 m/s at most, and ever more slowly: so it does not swing. */
static void move(void)
{
  static char where = 'm';
  double target[3] = {0, 0, 0};
  int i;
  if (pread(hand, &where, 1, 0) < 0) where = 'm';
  target[0] = where == 'r' ? 0.05 : where == 'b' ? 0.01 : 0;
  target[1] = where == 'a' ? 0.05 : 0;
  target[2] = where == 'u' ? 0.05 : 0;
  for (i = 0; i < 3; ++i) {
    const double way = target[i] + 0.007 * pushed[i] - at[i];
    at[i] += fmax(-0.0005, fmin(0.0005, 0.02 * way));
  }
}
/* "pausing": in each of the first pushes no state comes for some 60 ms. */
static int pauses(void)
{
  static int before, left;
  if (is_pushing && pushes != before && pushes <= 6) before = pushes, left = 60;
  return left > 0 ? left-- : 0;
}
static fs_status receive(void *self, fs_state *out)
{
  const double scale = is("scaled") ? 10 : 1;
  fs_vec3 *x = &out->pose.position;
  (void)self;
  usleep(1000);
  if (is("pausing") && pauses()) return FS_ERROR_TIMEOUT;
  if (is("lost") && pushes > 1) return fs_fail(FS_ERROR_DISCONNECTED, "the cable is out");
  move();
  x->x = scale * at[0], x->y = scale * at[1], x->z = scale * at[2];
  if (is("exchanged")) x->x = at[1], x->y = -at[0];
  if (is("mirrored")) x->z = -at[2];
  if (is("turned")) x->x = -at[0], x->y = -at[1];
  out->buttons = 5;
  out->flags = is("unready") ? FS_STATE_NOT_HOMED : FS_STATE_READY;
  return FS_OK;
}
static fs_status send(void *self, const fs_wrench *wrench)
{
  const double sign = is("backwards") || is("turned") ? -1 : is("deaf") ? 0 : 1;
  char letter = 'n';
  int i, pushing;
  (void)self;
  pushed[0] = sign * wrench->force.x, pushed[1] = sign * wrench->force.y;
  pushed[2] = is("turned") ? wrench->force.z : sign * wrench->force.z;
  for (i = 0; i < 3; ++i) {
    if (fabs(pushed[i]) > 0.3) letter = "rlatud"[2 * i + (pushed[i] < 0)];
  }
  pushing = letter != 'n';
  pushes += pushing && !is_pushing;
  is_pushing = pushing;
  return pwrite(felt, &letter, 1, 0) == 1 ? FS_OK : fs_fail(FS_ERROR_IO, "the file felt cannot be written");
}
static fs_status control(void *self, const char *request, char *answer, size_t size)
{
  (void)self;
  if (strcmp(request, "status") != 0) return fs_fail(FS_ERROR_UNSUPPORTED, "the request is: status");
  if (size < sizeof "all is well") return FS_ERROR_INVALID;
  strcpy(answer, "all is well");
  return FS_OK;
}

FS_API const fs_driver *fs_driver_entry(void)
{
  static fs_driver driver;
  driver.struct_size = sizeof driver;
  driver.scheme = "hello";
  driver.open = device_open;
  driver.close = device_close;
  driver.get_info = get_info;
  driver.receive = receive;
  driver.send = send;
  driver.control = control;
  return &driver;
}
