/* A loop of your own: a tool gives the force at a pose. Here the application is responsible for time, device and
 * safety: only the objects' own limits bound the force. */
#include <stdio.h>
#include <stdlib.h>
#include <forceserver/forceserver.h>

static void check(fs_status status)
{
  if (status >= 0) return;
  fprintf(stderr, "own_loop: %s\n", fs_last_error());
  exit(1);
}

int main(void)
{
  fs_scene *scene;
  fs_tool *tool;
  fs_state state;
  fs_response response;
  fs_object magnet = fs_object_init("magnet", FS_PRIMITIVE_POINT);
  const double mass = 0.3, damping = 3, dt = 0.001;  /* kg, N s/m, s: a ball on a damper, let go at 50 mm */
  double x = 0.05, v = 0;
  int i;

  magnet.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 100, 0, 4);  /* 100 N/m, 4 N */
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &magnet));
  check(fs_tool_create(scene, NULL, 0, &tool));
  memset(&state, 0, sizeof state);  /* all zeros is a good state */
  for (i = 0; i < 2000; ++i) {
    state.pose.position.x = x;
    check(fs_evaluate(tool, &state, &response));  /* no lock, no allocation: may run in a real-time thread */
    v += (response.wrench.force.x - damping * v) / mass * dt;
    x += v * dt;
    if (i % 250 == 0) printf("%.2f s: %6.2f mm, %6.3f N\n", i * dt, x * 1e3, response.wrench.force.x);
  }
  fs_tool_destroy(tool);
  fs_scene_destroy(scene);
  return x > -0.001 && x < 0.001 ? 0 : 1;
}
