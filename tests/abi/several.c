/* A program and a plug-in that use libraries of two SONAMEs in one process: several.py makes both from this file and runs them.
 * Each evaluates, has a servo and a server of its own, and connects to the other's server.
 *
 * PLUGIN: the plug-in, whose functions have the prefix `plugin_`. Otherwise the program: several PLUGIN_FILE */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <forceserver/forceserver.h>

#define OK(call) ((call) == FS_OK ? (void)0 : stop(__LINE__, #call))
static void stop(int line, const char *call)
{
  printf("several.c:%d: %s: %s\n", line, call, fs_last_error());
  exit(1);
}

static fs_scene *scene, *other;
static fs_servo *servo;
static fs_server *server;
static fs_device *device;

static void start(const char *endpoint, double gain)
{
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, gain, 0, 3);
  OK(fs_scene_create(&scene));
  OK(fs_object_set(scene, &spring));
  OK(fs_device_open("sim:?hold=0.01,0,0", &device));
  OK(fs_servo_start(scene, device, NULL, &servo));
  OK(fs_server_start(servo, endpoint, NULL, &server));
}

/* The force at 10 mm of the spring of one's own, N. */
static double own_force(void)
{
  fs_tool *tool;
  fs_state hand;
  fs_response response;
  memset(&hand, 0, sizeof hand);
  hand.pose.position.x = 0.01;
  OK(fs_tool_create(scene, NULL, 0, &tool));
  OK(fs_evaluate(tool, &hand, &response));
  fs_tool_destroy(tool);
  return response.wrench.force.x;
}

/* The gain of the spring of the other one's server, N/m. */
static double gain_there(const char *endpoint)
{
  fs_object out = fs_object_init(NULL, FS_PRIMITIVE_POINT);
  double gain;
  OK(fs_scene_connect(endpoint, "guest", &other));
  OK(fs_object_get(other, "server/spring", &out));
  gain = out.front.gain;
  fs_object_release(&out);
  return gain;
}

static void end(void)
{
  fs_scene_destroy(other);
  fs_server_stop(server);
  fs_servo_stop(servo);
  fs_device_close(device);
  fs_scene_destroy(scene);
}

/* The address of a function tells which library it is of. */
#define LIBRARY_OF_THIS (library_of((void *)fs_evaluate))
static const char *library_of(void *function)
{
  Dl_info info;
  return dladdr(function, &info) ? strrchr(info.dli_fname, '/') + 1 : "unknown";
}

#ifdef PLUGIN
__attribute__((visibility("default"))) void plugin_start(const char *endpoint, double gain) { start(endpoint, gain); }
__attribute__((visibility("default"))) double plugin_own_force(void) { return own_force(); }
__attribute__((visibility("default"))) double plugin_gain_there(const char *endpoint) { return gain_there(endpoint); }
__attribute__((visibility("default"))) const char *plugin_library(void) { return LIBRARY_OF_THIS; }
__attribute__((visibility("default"))) void plugin_end(void) { end(); }
#else
int main(int count, char **arguments)
{
  char here[64], there[64];
  void *plugin = count > 1 ? dlopen(arguments[1], RTLD_NOW | RTLD_GLOBAL) : NULL;
  void (*plugin_start)(const char *, double), (*plugin_end)(void);
  double (*plugin_own_force)(void), (*plugin_gain_there)(const char *);
  const char *(*plugin_library)(void);
  if (!plugin) {
    printf("%s\n", count > 1 ? dlerror() : "which plug-in?");
    return 2;
  }
  *(void **)&plugin_start = dlsym(plugin, "plugin_start");
  *(void **)&plugin_end = dlsym(plugin, "plugin_end");
  *(void **)&plugin_own_force = dlsym(plugin, "plugin_own_force");
  *(void **)&plugin_gain_there = dlsym(plugin, "plugin_gain_there");
  *(void **)&plugin_library = dlsym(plugin, "plugin_library");
  snprintf(here, sizeof here, "shm:several-%s-program", arguments[2]);
  snprintf(there, sizeof there, "shm:several-%s-plugin", arguments[2]);
  start(here, 100);
  plugin_start(there, 200);
  printf("%s %g %g\n", LIBRARY_OF_THIS, own_force(), gain_there(there));
  printf("%s %g %g\n", plugin_library(), plugin_own_force(), plugin_gain_there(here));
  plugin_end();
  end();
  return 0;
}
#endif
