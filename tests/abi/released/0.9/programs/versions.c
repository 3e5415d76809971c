#define FIRST_fs_object 576
#define FIRST_fs_shape_info 88
#define FIRST_fs_surface_settings 32
#define FIRST_fs_device_info 256
#define FIRST_fs_servo_options 104
#define FIRST_fs_servo_stats 184
#define FIRST_fs_server_options 40
#define FIRST_fs_link 40
#define FIRST_fs_model 280
#define FIRST_fs_driver 88
/* A program that was built with some version of the headers, and runs on some version of the library: versions.py makes and
 * runs it. It is compiled with PROGRAM: -1 the last fields of each growing struct are not there, 0 today's headers, 1 one more
 * field, called `added`, is. FIRST_fs_object and so on: the sizes of the first version. With BY_DLOPEN it knows the library at run time only.
 *
 * versions local WHAT...        the calls with growing structs, in this process
 * versions serve ENDPOINT       a server with a client "owner" of its own; does what it reads, line by line
 * versions connect ENDPOINT     a client "editor"; does what it reads
 *
 * It prints "ok" after each line that it has done, or ends with a sentence. WHAT, and the lines, are in the tables below. */
#define _GNU_SOURCE
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <forceserver/forceserver.h>
#include <forceserver/driver.h>

#ifdef BY_DLOPEN
#  include <dlfcn.h>
static void *find(const char *name)
{
  static void *library;
  void *found;
  if (!library) library = dlopen("libforceserver.so.1", RTLD_NOW | RTLD_LOCAL);
  found = library ? dlsym(library, name) : NULL;
  if (found) return found;
  fprintf(stderr, "%s\n", dlerror());
  exit(1);
}
#  define CALL(name) ((__typeof__(&name))find(#name))
#else
#  define CALL(name) name
#endif

#define CHECK(condition) ((condition) ? (void)0 : stop(__LINE__, #condition))
#define OK(call) CHECK((call) == FS_OK)
/* The call fails with this status, and the sentence has this part. */
#define REFUSED(status, part, call) (CHECK((call) == (status)), CHECK(strstr(CALL(fs_last_error)(), part)))

static void stop(int line, const char *condition)
{
  printf("versions.c:%d: not so: %s; the last error is: %s\n", line, condition, CALL(fs_last_error)());
  exit(1);
}

/* A struct of a caller, with other memory behind it that nobody may write to. */
#define FRAMED(type) struct { type at; unsigned char behind[64]; }
#define FRAME(framed, value) ((framed).at = (value), memset((framed).behind, 0xa5, sizeof (framed).behind))
#define UNTOUCHED(framed) untouched((framed).behind)
static int untouched(const unsigned char *bytes)
{
  int i;
  for (i = 0; i < 64; ++i) {
    if (bytes[i] != 0xa5) return 0;
  }
  return 1;
}

/* The last field of fs_object that its older versions lack is a surface; each value here is one of another friction. */
#define LAST_PART FS_PART_CONTACT
#if PROGRAM >= 0
static fs_surface *surface_of(double value)
{
  fs_surface_settings settings = fs_surface_settings_init();
  fs_surface *out;
  if (value == 0) return NULL;
  settings.static_friction = settings.dynamic_friction = value / 1000;
  OK(CALL(fs_surface_create)(&settings, &out));
  return out;
}
static double value_of(const fs_surface *surface)
{
  fs_surface_settings settings = fs_surface_settings_init();
  if (!surface) return 0;
  OK(CALL(fs_surface_get_settings)(surface, &settings));
  return settings.static_friction * 1000;
}
#  define SET_LAST(object, value) ((object).surface = surface_of(value))  /* kept until the program ends */
#  define LAST(object) value_of((object).surface)
#else
#  define SET_LAST(object, value) ((void)(value))
#  define LAST(object) 0.0
#endif

static fs_object spring(const char *name)
{
  fs_object o = fs_object_init(name, FS_PRIMITIVE_PLANE);  /* which may have a surface; its front looks along x */
  o.pose.orientation.w = o.pose.orientation.y = sqrt(0.5);
  o.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 3);
  return o;
}

static fs_object object_of(fs_scene *scene, const char *name)
{
  FRAMED(fs_object) out;
  fs_object last;
  FRAME(out, fs_object_init(NULL, FS_PRIMITIVE_POINT));
#if PROGRAM > 0
  out.at.added = 7;  /* the library does not know it, so it becomes 0 */
#endif
  OK(CALL(fs_object_get)(scene, name, &out.at));
  CHECK(UNTOUCHED(out) && out.at.struct_size == sizeof out.at && !strcmp(out.at.name, name));
#if PROGRAM > 0
  CHECK(out.at.added == 0);
#endif
#if PROGRAM >= 0
  CALL(fs_surface_retain)(out.at.surface);
#endif
  last = out.at;
  CALL(fs_object_release)(&out.at);
  return last;
}

/* ---- a driver */

static fs_model got;
static fs_status open_device(const char *address, void **self) { (void)address; *self = &got; return FS_OK; }
static void close_device(void *self) { (void)self; }
static fs_status get_info(void *self, fs_device_info *out)
{
  (void)self;
  CHECK(out->struct_size >= 248);
  out->force_axes = 3;
  out->force_max = 10;
  out->rate = 1000;
  out->mass = 0.3;
  out->damping = 1;
  out->delay = 0.01;
  out->link_rate = 100;
  out->controller_rate = 1000;
  return FS_OK;
}
static fs_status read_device(void *self, fs_state *out)
{
  (void)self;
  out->pose.position.x = 0.01;
  out->flags = FS_STATE_READY;
  return FS_OK;
}
static fs_status write_device(void *self, const fs_wrench *wrench) { (void)self; (void)wrench; return FS_OK; }
static fs_status write_model(void *self, const fs_model *model)
{
  size_t size = sizeof got < model->struct_size ? sizeof got : model->struct_size;
  (void)self;
  memcpy(&got, model, size);
  return FS_OK;
}

static fs_status register_driver(const char *scheme, int added)
{
  static FRAMED(fs_driver) table;
  memset(&table, 0, sizeof table);
  table.at.struct_size = sizeof table.at;
  table.at.scheme = scheme;
  table.at.open = open_device;
  table.at.close = close_device;
  table.at.get_info = get_info;
  table.at.read = read_device;
  table.at.write = write_device;
  table.at.write_model = write_model;
#if PROGRAM > 0
  if (added) table.at.added = (void (*)(void))close_device;
#else
  (void)added;
#endif
  memset(table.behind, 0xa5, sizeof table.behind);
  return CALL(fs_driver_register)(&table.at);
}

/* ---- in this process */

static fs_scene *scene;
static fs_device *device;
static fs_servo *servo;

static void take_all_structs(void)
{
  FRAMED(fs_shape_info) shape_info;
  FRAMED(fs_device_info) device_info;
  FRAMED(fs_servo_stats) stats;
  FRAMED(fs_object) object;
  fs_servo_options options = fs_servo_options_init();
  fs_server_options server_options = fs_server_options_init();
  fs_server *server;
  char endpoint[64];
  const fs_vec3 points[] = {{0, 0, 0}, {1, 0, 0}};
  const double distance = 0.001;
  double force = 0;
  fs_shape *shape;

  OK(CALL(fs_scene_create)(&scene));
  FRAME(object, spring("a"));
  SET_LAST(object.at, 0);
  OK(CALL(fs_object_set)(scene, &object.at));
  OK(CALL(fs_object_change)(scene, &object.at, FS_PART_PROFILES));
  OK(CALL(fs_object_evaluate_law)(&object.at, 0, 0, &distance, 1, &force));
  CHECK(fabs(force - 0.2) < 1e-12 || fabs(force + 0.2) < 1e-12);
  CHECK(object_of(scene, "a").front.gain == 200);

  OK(CALL(fs_shape_create_polyline)(points, 2, false, &shape));
  FRAME(shape_info, fs_shape_info_init());
  OK(CALL(fs_shape_get_info)(shape, &shape_info.at));
  CHECK(UNTOUCHED(shape_info) && shape_info.at.struct_size == sizeof shape_info.at && shape_info.at.upper.x == 1);
  CALL(fs_shape_destroy)(shape);

  OK(register_driver("mine", 0));
  OK(CALL(fs_device_open)("mine:", &device));
  FRAME(device_info, fs_device_info_init());
  OK(CALL(fs_device_get_info)(device, &device_info.at));
  CHECK(UNTOUCHED(device_info) && device_info.at.struct_size == sizeof device_info.at && device_info.at.force_max == 10);
  options.mode = FS_SERVO_VIRTUAL;
  options.ramp = options.fade = -1;
  OK(CALL(fs_servo_start)(scene, device, &options, &servo));
  OK(CALL(fs_servo_step)(servo, 100));
  CHECK(got.number == 100 && fabs(got.x0.position.x - 0.01) < 1e-12 && got.f0.force.x < -0.5);
  FRAME(stats, fs_servo_stats_init());
  OK(CALL(fs_scene_get_servo_stats)(scene, &stats.at));
  CHECK(UNTOUCHED(stats) && stats.at.struct_size == sizeof stats.at && stats.at.ticks == 100);
  OK(CALL(fs_scene_get_device_info)(scene, &device_info.at));
  CHECK(UNTOUCHED(device_info));
  server_options.max_objects = 10;
  snprintf(endpoint, sizeof endpoint, "shm:versions-local-%ld", (long)time(NULL) % 1000 * 1000 + clock() % 1000);
  OK(CALL(fs_server_start)(servo, endpoint, &server_options, &server));
#if PROGRAM > 0
  server_options.added = 1;
  REFUSED(FS_ERROR_VERSION, "fs_server_options has a field at byte", CALL(fs_server_start)(servo, "shm:x", &server_options, &server));
  options.added = 1;
  REFUSED(FS_ERROR_VERSION, "fs_servo_options has a field at byte", CALL(fs_servo_start)(scene, device, &options, &servo));
  object.at.added = 1;
  REFUSED(FS_ERROR_VERSION, "fs_object has a field at byte", CALL(fs_object_set)(scene, &object.at));
  REFUSED(FS_ERROR_VERSION, "fs_object has a field at byte", CALL(fs_object_change)(scene, &object.at, FS_PART_POSE));
  REFUSED(FS_ERROR_VERSION, "fs_driver has a field at byte", register_driver("other", 1));
#endif
  CALL(fs_server_stop)(server);
}

/* Today's last field, where the library knows it; where it does not, it is refused. */
static void last_field_is_kept(void)
{
  fs_object o = spring("b");
  SET_LAST(o, 5);
  OK(CALL(fs_object_set)(scene, &o));
  CHECK(LAST(object_of(scene, "b")) == 5);
}
static void last_field_is_refused(void)
{
  fs_object o = spring("b");
  SET_LAST(o, 5);
  REFUSED(FS_ERROR_VERSION, "fs_object has a field at byte", CALL(fs_object_set)(scene, &o));
}
/* A struct that is smaller than in the first version. */
static void smaller_ones_are_refused(void)
{
  fs_object o = spring("a");
  fs_servo_options options = fs_servo_options_init();
  fs_device_info info = fs_device_info_init();
  fs_driver driver;
  fs_scene *own;
  OK(CALL(fs_scene_create)(&own));
  OK(CALL(fs_device_open)("sim:", &device));
  o.struct_size = FIRST_fs_object - 8;
  options.struct_size = FIRST_fs_servo_options - 8;
  info.struct_size = FIRST_fs_device_info - 8;
  memset(&driver, 0, sizeof driver);
  driver.struct_size = FIRST_fs_driver - 8;
  REFUSED(FS_ERROR_INVALID, "struct_size of fs_object is", CALL(fs_object_set)(own, &o));
  REFUSED(FS_ERROR_INVALID, "struct_size of fs_object is", CALL(fs_object_get)(own, "a", &o));
  REFUSED(FS_ERROR_INVALID, "struct_size of fs_servo_options is", CALL(fs_servo_start)(own, device, &options, &servo));
  REFUSED(FS_ERROR_INVALID, "struct_size of fs_device_info is", CALL(fs_device_get_info)(device, &info));
  REFUSED(FS_ERROR_INVALID, "struct_size of fs_driver is", CALL(fs_driver_register)(&driver));
}

/* ---- connected */

static const char *endpoint_name;
static const char *me;

static void connect_scene(const char *name)
{
  char place[200];
  me = name;
  snprintf(place, sizeof place, "%s?timeout=10", endpoint_name);
  OK(CALL(fs_scene_connect)(place, name, &scene));
}

static void serve(void)
{
  fs_scene *own;
  fs_server *server;
  fs_object o = spring("hold");
  OK(CALL(fs_scene_create)(&own));
  SET_LAST(o, 1000);
  OK(CALL(fs_object_set)(own, &o));
  OK(CALL(fs_device_open)("sim:", &device));
  OK(CALL(fs_servo_start)(own, device, NULL, &servo));
  OK(CALL(fs_server_start)(servo, endpoint_name, NULL, &server));
  connect_scene("owner");
}

/* An object of one's own with and without the last field. */
static void set_kept(void)
{
  fs_object o = spring("kept");
  SET_LAST(o, 1000);
  OK(CALL(fs_object_set)(scene, &o));
  OK(CALL(fs_scene_sync)(scene, 5));
}
static void set_plain(void)
{
  fs_object o = spring("plain");
  OK(CALL(fs_object_set)(scene, &o));
  OK(CALL(fs_object_change)(scene, &o, 31));
  OK(CALL(fs_scene_sync)(scene, 5));
  CHECK(object_of(scene, "plain").front.gain == 200);
}

/* Changes another client's object: all parts of it, but the pose. */
static void edit(const char *name)
{
  fs_object o = object_of(scene, name);
  o.tool_points = 3;
  o.front.gain = 250;
  OK(CALL(fs_object_change)(scene, &o, FS_PART_PROFILES | FS_PART_OTHER | FS_PART_CONTACT));
}
static void edit_kept(void) { edit("owner/kept"); }
static void edit_hold(void) { edit("server/hold"); }
static void edit_in_group(void)
{
  OK(CALL(fs_scene_begin)(scene));
  edit("owner/kept");
  edit("server/hold");
  OK(CALL(fs_scene_commit)(scene));
  OK(CALL(fs_scene_sync)(scene, 5));
}
static void edited(const char *name)
{
  const fs_object o = object_of(scene, name);
  CHECK(o.tool_points == 3 && o.front.gain == 250 && o.enabled);
  CHECK(LAST(o) == 1000);
}
static void both_stay(void) { edited("kept"); edited("server/hold"); }

/* The owner gives an object of the editor a surface, which the editor then changes without knowing of it. */
static void give_last_field(void)
{
  fs_object o = object_of(scene, "editor/plain");
  SET_LAST(o, 500);
  OK(CALL(fs_object_change)(scene, &o, LAST_PART));
}
static void change_plain(void)
{
  fs_object o = object_of(scene, "plain");
  o.tool_points = 5;
  o.front.gain = 222;
  OK(CALL(fs_object_change)(scene, &o, FS_PART_PROFILES | FS_PART_OTHER | LAST_PART));
  OK(CALL(fs_scene_begin)(scene));
  o.front.gain = 223;
  OK(CALL(fs_object_change)(scene, &o, FS_PART_PROFILES | FS_PART_OTHER | LAST_PART));
  OK(CALL(fs_scene_commit)(scene));
  OK(CALL(fs_scene_sync)(scene, 5));
}
static void last_field_stays(void)
{
  const fs_object o = object_of(scene, "editor/plain");
  CHECK(o.tool_points == 5 && o.front.gain == 223 && LAST(o) == 500);
}
static void last_field_is_gone(void)  /* set anew by who does not know of it */
{
  const fs_object o = object_of(scene, "editor/plain");
  CHECK(o.tool_points == 0 && o.front.gain == 200 && LAST(o) == 0);
}

static void take_all_lists(void)
{
  FRAMED(fs_servo_stats) stats;
  FRAMED(fs_device_info) info;
  fs_report reports[8];
  fs_motion motions[8];
  fs_client clients[8];
  fs_client_view views[8];
  static fs_recorded_tick ticks[4];
  fs_view view;
  const struct timespec tick = {0, 1000000};
  size_t count = 0, i;
  int names = 0, waits = 0;
  while (count <= 4 && waits++ < 10000) {  /* the server may have begun a moment ago */
    OK(CALL(fs_scene_get_record)(scene, 0, NULL, 0, &count));
    nanosleep(&tick, NULL);
  }
  FRAME(stats, fs_servo_stats_init());
  OK(CALL(fs_scene_get_servo_stats)(scene, &stats.at));
  CHECK(UNTOUCHED(stats) && stats.at.struct_size == sizeof stats.at && stats.at.ticks > 0 && stats.at.rate > 0);
  FRAME(info, fs_device_info_init());
  OK(CALL(fs_scene_get_device_info)(scene, &info.at));
  CHECK(UNTOUCHED(info) && info.at.struct_size == sizeof info.at && info.at.force_max == 25 && info.at.link_rate == 0);
#if PROGRAM > 0
  CHECK(stats.at.added == 0 && info.at.added == 0);
#endif
  OK(CALL(fs_scene_get_reports)(scene, reports, 8, &count));
  for (i = 0; i < count; ++i) names += !strcmp(reports[i].name, "server/hold");
  OK(CALL(fs_scene_get_motions)(scene, NULL, motions, 8, &count));
  for (i = 0; i < count; ++i) names += !strcmp(motions[i].name, "server/hold");
  OK(CALL(fs_scene_get_clients)(scene, clients, 8, &count));
  CHECK(count == 3 && !strcmp(clients[0].name, "server"));
  OK(CALL(fs_scene_get_views)(scene, views, 8, &count));
  CHECK(count == 3 && views[1].view.frame.scale == 1);
  OK(CALL(fs_scene_get_record)(scene, 0, ticks, 4, &count));
  CHECK(count > 4 && ticks[1].number == ticks[0].number + 1);
  OK(CALL(fs_scene_get_view)(scene, "server", &view));
  CHECK(names == 2);
}

/* The server does not know the last field. What has it is refused here, also within a group, and the group goes on. */
static void server_refuses_last_field(void)
{
  fs_object o = spring("b"), other = object_of(scene, "owner/plain");
  size_t count;
  SET_LAST(o, 5);
  REFUSED(FS_ERROR_VERSION, "the server is older", CALL(fs_object_set)(scene, &o));
  OK(CALL(fs_scene_begin)(scene));
  REFUSED(FS_ERROR_VERSION, "the server is older", CALL(fs_object_set)(scene, &o));
  SET_LAST(o, 0);
  OK(CALL(fs_object_set)(scene, &o));
  SET_LAST(o, 5);
  REFUSED(FS_ERROR_VERSION, "the server is older", CALL(fs_object_change)(scene, &o, LAST_PART));
  OK(CALL(fs_object_change)(scene, &o, FS_PART_PROFILES));  /* the field is of another part */
  SET_LAST(other, 5);
  REFUSED(FS_ERROR_VERSION, "the server is older", CALL(fs_object_change)(scene, &other, LAST_PART));
  OK(CALL(fs_scene_commit)(scene));
  OK(CALL(fs_scene_sync)(scene, 5));
  REFUSED(FS_ERROR_VERSION, "the server is older", CALL(fs_object_change)(scene, &other, LAST_PART));
  OK(CALL(fs_object_change)(scene, &other, FS_PART_PROFILES));
  CHECK(LAST(object_of(scene, "b")) == 0);
  OK(CALL(fs_scene_get_motions)(scene, me, NULL, 0, &count));
  CHECK(count == 1);
}

#define LINE(name) { #name, name }
static const struct {
  const char *name;
  void (*run)(void);
} lines[] = {LINE(take_all_structs), LINE(last_field_is_kept), LINE(last_field_is_refused), LINE(smaller_ones_are_refused),
             LINE(set_kept), LINE(set_plain), LINE(edit_kept), LINE(edit_hold), LINE(edit_in_group), LINE(both_stay),
             LINE(give_last_field), LINE(change_plain), LINE(last_field_stays), LINE(last_field_is_gone), LINE(take_all_lists),
             LINE(server_refuses_last_field)};

static void run(const char *name)
{
  size_t i;
  for (i = 0; i < sizeof lines / sizeof *lines; ++i) {
    if (!strcmp(lines[i].name, name)) {
      lines[i].run();
      printf("ok\n");
      fflush(stdout);
      return;
    }
  }
  CHECK(!"a line that is in the table");
}

int main(int count, char **arguments)
{
  char line[100];
  int i;
  if (count < 3) return 2;
  if (!strcmp(arguments[1], "local")) {
    for (i = 2; i < count; ++i) run(arguments[i]);
    return 0;
  }
  endpoint_name = arguments[2];
  if (!strcmp(arguments[1], "serve")) serve();
  else connect_scene("editor");
  printf("ok\n");
  fflush(stdout);
  while (fgets(line, sizeof line, stdin)) {
    line[strcspn(line, "\n")] = 0;
    run(line);
  }
  return 0;
}
