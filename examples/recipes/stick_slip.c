/* A table that sticks and slips: the hand pushes with 1 N on it, 2 mm deep, and is drawn aside, back, and aside again. */
#include "recipe.h"

static fs_vec3 go_to(fs_tool *tool, double x, double z)
{
  fs_state hand = {0};
  fs_response felt;
  hand.pose.position.x = x;
  hand.pose.position.z = z;
  check(fs_evaluate(tool, &hand, &felt));
  return felt.wrench.force;
}

int main(int argc, char **argv)
{
  static const int stops[] = {0, 10, 16, 20, 40, 80, 70, 64, 75, 90};  /* 0.1 mm */
  fs_surface_settings settings = fs_surface_settings_init();
  fs_object table = fs_object_init("table", FS_PRIMITIVE_PLANE);
  fs_scene *scene;
  fs_tool *tool;
  int i, x = 0;

  settings.static_friction = 0.8;
  settings.dynamic_friction = 0.4;
  settings.slip_distance = 2e-3;
  check(fs_surface_create(&settings, &table.surface));
  table.contact.keep = FS_KEEP_FRONT;
  table.contact.stiffness = 500;
  table.contact.limit = 5;
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &table));
  fs_surface_destroy(table.surface);  /* the scene keeps it */
  check(fs_tool_create(scene, NULL, 0, &tool));
  go_to(tool, 0, 1e-3);  /* from above */
  for (i = 0; i < 10; ++i) {
    fs_vec3 f;
    do {  /* in small steps, as a hand goes */
      x += (x < stops[i]) - (x > stops[i]);
      f = go_to(tool, 1e-4 * x, -2e-3);
    } while (x != stops[i]);
    printf("%-26s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N\n", "on the table", 0.1 * x, 0.0, -2.0, rounded(f.x),
           rounded(f.y), rounded(f.z));
  }
  fs_tool_destroy(tool);
  return finish(scene, argc, argv);
}
