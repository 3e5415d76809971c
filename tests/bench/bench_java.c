/* What tests/bench/java compares Java with: the same calls in C. Prints a name and nanoseconds a call, or a place. */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <forceserver/forceserver.h>

enum { CALLS = 500000, PLACES = 100000, TIMES = 20 };

static double now(void)
{
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static void check(fs_status status)
{
  if (status >= 0) return;
  fprintf(stderr, "bench_java: %s\n", fs_last_error());
  exit(1);
}

int main(void)
{
  fs_scene *scene;
  fs_tool *tool;
  fs_state state;
  fs_response response;
  const fs_twist still = {{0, 0, 0}, {0, 0, 0}};
  fs_pose pose = {{0.01, 0, 0}, {1, 0, 0, 0}};
  fs_object spring = fs_object_init("spring", FS_PRIMITIVE_POINT);
  fs_vec3 *positions = malloc(PLACES * sizeof *positions), *forces = malloc(PLACES * sizeof *forces);
  double begin, sum = 0;
  int i, round;

  spring.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 200, 0, 5);
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &spring));
  check(fs_tool_create(scene, NULL, 0, &tool));
  memset(&state, 0, sizeof state);
  for (round = 0; round < 6; ++round) {  /* all but the last warm up */
    begin = now();
    for (i = 0; i < CALLS; ++i) {
      state.pose.position.x = 1e-5 * (i & 1023);
      check(fs_evaluate(tool, &state, &response));
      sum += response.wrench.force.x;
    }
    if (round == 5) printf("evaluate %.1f\n", (now() - begin) / CALLS);
    begin = now();
    for (i = 0; i < CALLS / 4; ++i) {
      pose.position.x = 1e-5 * (i & 1023);
      check(fs_object_move(scene, "spring", &pose, &still, FS_NOW));
    }
    if (round == 5) printf("move %.1f\n", (now() - begin) / (CALLS / 4));
    for (i = 0; i < PLACES; ++i) positions[i].x = positions[i].y = positions[i].z = 1e-6 * i;
    begin = now();
    for (i = 0; i < TIMES; ++i) check(fs_evaluate_field(scene, NULL, FS_NOW, positions, PLACES, forces));
    if (round == 5) printf("batch %.2f\n", (now() - begin) / TIMES / PLACES);
  }
  fs_tool_destroy(tool);
  fs_scene_destroy(scene);
  free(positions);
  free(forces);
  return sum > 0;
}
