/* The loops of python_figures.py in C, in the same process: ns of each call. */
#include <time.h>
#include <forceserver/forceserver.h>

static double now(void)
{
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static fs_scene *scene;
static fs_tool *tool;

int peer_load(const char *path)
{
  fs_tool_destroy(tool);
  fs_scene_destroy(scene);
  return fs_scene_create(&scene) || fs_scene_load(scene, path) || fs_tool_create(scene, NULL, 0, &tool);
}

double peer_batch(const fs_state *states, fs_response *responses, size_t count)
{
  const double start = now();
  size_t i;
  for (i = 0; i < count; ++i) fs_evaluate(tool, states + i, responses + i);
  return (now() - start) / (double)count;
}

double peer_single(const fs_state *state, fs_response *response, size_t count)
{
  const double start = now();
  size_t i;
  for (i = 0; i < count; ++i) fs_evaluate(tool, state, response);
  return (now() - start) / (double)count;
}

double peer_field(const fs_vec3 *positions, fs_vec3 *forces, size_t count)
{
  const double start = now();
  fs_evaluate_field(scene, NULL, 0, positions, count, forces);
  return (now() - start) / (double)count;
}

double peer_move(size_t count)
{
  const fs_twist still = {{0, 0, 0}, {0, 0, 0}};
  const double start = now();
  fs_pose pose = {{0, 0, 0}, {1, 0, 0, 0}};
  size_t i;
  for (i = 0; i < count; ++i) {
    pose.position.x = 1e-6 * (double)i;
    fs_object_move(scene, "0", &pose, &still, 0);
  }
  return (now() - start) / (double)count;
}
