/* Corduroy: cords along y, 4 mm apart, 0.4 mm high. The hand comes from above, pushes 3 mm deep, and goes across a cord. */
#include "recipe.h"

int main(int argc, char **argv)
{
  fs_surface_settings settings = fs_surface_settings_init();
  fs_object cloth = fs_object_init("cloth", FS_PRIMITIVE_PLANE);
  double heights[16];  /* of one cord, from its top to the next */
  fs_scene *scene;
  fs_tool *tool;
  int i;

  for (i = 0; i < 16; ++i) heights[i] = -0.0002 * (1 - cos(2 * 3.14159265358979 * i / 16));
  settings.columns = 16;
  settings.rows = 1;
  settings.column_width = 0.004 / 16;
  settings.repeats = true;
  check(fs_surface_create_texture(&settings, heights, 16, &cloth.surface));
  cloth.contact.keep = FS_KEEP_FRONT;
  cloth.contact.stiffness = 500;
  cloth.contact.limit = 5;
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &cloth));
  fs_surface_destroy(cloth.surface);  /* the scene keeps it */
  check(fs_tool_create(scene, NULL, 0, &tool));
  for (i = -1; i <= 8; ++i) {
    fs_state hand = {0};
    fs_response felt;
    hand.pose.position.x = i < 0 ? 0 : 5e-4 * i;
    hand.pose.position.z = i < 0 ? 1e-3 : -3e-3;
    check(fs_evaluate(tool, &hand, &felt));
    printf("%-26s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N\n", i < 0 ? "above" : "on the cloth",
           1e3 * hand.pose.position.x, 0.0, 1e3 * hand.pose.position.z, rounded(felt.wrench.force.x),
           rounded(felt.wrench.force.y), rounded(felt.wrench.force.z));
  }
  fs_tool_destroy(tool);
  return finish(scene, argc, argv);
}
