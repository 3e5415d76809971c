/* A wooden table that knocks: the hand comes down at three speeds, and stops as it touches, 0.1 mm below the surface. */
#include "recipe.h"

static fs_vec3 go_to(fs_tool *tool, double z, double speed)
{
  static double time = 1;  /* s */
  fs_state hand = {0};
  fs_response felt;
  time += 5e-4;
  hand.time = time;
  hand.pose.position.z = z;
  hand.twist.linear.z = -speed;
  check(fs_evaluate(tool, &hand, &felt));
  return felt.wrench.force;
}

static void show(double speed, const char *when, double z, fs_vec3 f)
{
  printf("%4.2f m/s, %-16s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N\n", speed, when, 0.0, 0.0, 1e3 * z, rounded(f.x),
         rounded(f.y), rounded(f.z));
}

static void tap(fs_tool *tool, double speed)
{
  const double way = 5e-4 * speed, touching = -1e-4;  /* m */
  double z = 0.02;
  int i;

  for (i = 0; i < 400; ++i) go_to(tool, z, 0);  /* 0.2 s, in which the last knock fades */
  show(speed, "above", z, go_to(tool, z, 0));
  for (z -= way; z > way / 2; z -= way) go_to(tool, z, speed);
  for (i = 0; i <= 15; ++i) {
    const fs_vec3 f = go_to(tool, touching, i == 0 ? speed : 0);
    char when[16];
    snprintf(when, sizeof when, "after %3.1f ms", 0.5 * i);
    if (i % 5 == 0) show(speed, when, touching, f);
  }
}

int main(int argc, char **argv)
{
  fs_surface_settings settings = fs_surface_settings_init();
  fs_object table = fs_object_init("table", FS_PRIMITIVE_PLANE);
  fs_scene *scene;
  fs_tool *tool;

  check(fs_surface_set_impact(&settings, FS_IMPACT_MEDIUM));  /* wood: 8 N s/m, 100 Hz, 80/s */
  check(fs_surface_create(&settings, &table.surface));
  table.contact.keep = FS_KEEP_FRONT;
  table.contact.stiffness = 500;
  table.contact.limit = 5;
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &table));
  fs_surface_destroy(table.surface);  /* the scene keeps it */
  check(fs_tool_create(scene, NULL, 0, &tool));
  tap(tool, 0.2);
  tap(tool, 0.1);
  tap(tool, 0.01);
  fs_tool_destroy(tool);
  return finish(scene, argc, argv);
}
