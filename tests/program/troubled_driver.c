/* Devices with one trouble each, "troubled:NAME":
 * silent     no state ever comes
 * stops      none comes any more 0.5 s after the first opening
 * jams       none comes any more once it is pushed
 * open       the function open hangs
 * control    the function control hangs
 * delay      it tells of a delay of 0.022 ms, and measures one of 0.721 ms
 * leaving    a thread of the second opening ends 0.2 s after it has begun
 * leaking    each opening leaves a file open
 * threaded   it has a thread that takes signals; closing takes 0.5 s, and says so then */
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <forceserver/driver.h>

static char trouble[16];
static int openings, is_pushed;
static double opened; /* s, first */

static int is(const char *name) { return strcmp(trouble, name) == 0; }

static double now(void)
{
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}
static void *stay(void *unused)
{
  usleep(200000);
  return unused;
}
static void *take_signals(void *unused)
{
  while (unused == NULL) pause();
  return unused;
}
static fs_status device_open(const char *address, void **self)
{
  pthread_t thread;
  strncpy(trouble, address, sizeof trouble - 1);
  while (is("open")) pause();
  if (is("leaving") && openings == 1 && pthread_create(&thread, NULL, stay, NULL) == 0) pthread_detach(thread);
  if (is("threaded") && pthread_create(&thread, NULL, take_signals, NULL) == 0) pthread_detach(thread);
  if (is("leaking") && dup(0) < 0) return FS_ERROR_IO;
  if (openings++ == 0) opened = now();
  *self = trouble;
  return FS_OK;
}
static void device_close(void *self)
{
  (void)self;
  if (!is("threaded")) return;
  usleep(500000);
  puts("the device is closed");
}
static fs_status get_info(void *self, fs_device_info *out)
{
  (void)self;
  strcpy(out->name, "troubled");
  strcpy(out->serial, "1");
  out->rate = 1000;
  out->force_axes = 3;
  out->force_max = 5;
  out->workspace_radius = out->workspace_height = 0.1;
  if (is("delay")) out->delay = 22e-6;
  return FS_OK;
}
static fs_status receive(void *self, fs_state *out)
{
  (void)self;
  if (is("silent") || (is("stops") && now() > opened + 0.5) || (is("jams") && is_pushed)) {
    usleep(20000);
    return FS_ERROR_TIMEOUT;
  }
  usleep(1000);
  out->flags = FS_STATE_READY;
  return FS_OK;
}
static fs_status send(void *self, const fs_wrench *wrench)
{
  (void)self;
  is_pushed |= wrench->force.x > 0.1;
  return FS_OK;
}
static fs_status get_link(void *self, fs_link *out)
{
  (void)self;
  if (!is("delay")) return FS_ERROR_UNSUPPORTED;
  out->delay = out->delay_p99 = 721e-6;
  return FS_OK;
}
static fs_status control(void *self, const char *request, char *answer, size_t size)
{
  (void)self;
  while (is("control")) pause();
  if (strcmp(request, "status") != 0) return fs_fail(FS_ERROR_UNSUPPORTED, "the request is: status");
  if (size < sizeof "all is well") return FS_ERROR_INVALID;
  strcpy(answer, "all is well");
  return FS_OK;
}

FS_API const fs_driver *fs_driver_entry(void)
{
  static fs_driver driver;
  driver.struct_size = sizeof driver;
  driver.scheme = "troubled";
  driver.open = device_open;
  driver.close = device_close;
  driver.get_info = get_info;
  driver.receive = receive;
  driver.send = send;
  driver.get_link = get_link;
  driver.control = control;
  return &driver;
}
