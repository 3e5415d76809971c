/* A solid plate, 1 mm thick: the hand comes from above and pushes 30 mm through it, and the plate still holds it. */
#include "recipe.h"

int main(int argc, char **argv)
{
  const uint32_t faces[12][3] = {  /* counter-clockwise as seen from outside, so the front is outside */
    {0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  fs_vec3 corners[8];
  fs_object plate = fs_object_init("plate", FS_PRIMITIVE_MESH);
  fs_scene *scene;
  fs_tool *tool;
  int i;

  for (i = 0; i < 8; ++i) {
    corners[i].x = i & 1 ? 0.03 : -0.03;
    corners[i].y = i & 2 ? 0.03 : -0.03;
    corners[i].z = i & 4 ? 0 : -0.001;
  }
  check(fs_shape_create_mesh(corners, 8, &faces[0][0], 12, &plate.shape));
  plate.contact.keep = FS_KEEP_FRONT;
  plate.contact.stiffness = 200;
  plate.contact.limit = 5;
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &plate));
  fs_shape_destroy(plate.shape);
  check(fs_tool_create(scene, NULL, 0, &tool));  /* it remembers where it has been */
  for (i = 10; i >= -30; --i) {
    fs_state hand = {0};
    fs_response felt;
    hand.pose.position.z = 1e-3 * i;
    check(fs_evaluate(tool, &hand, &felt));
    if (i % 10) continue;
    printf("%-26s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N\n", i > 0 ? "above" : "on or through the plate",
           0.0, 0.0, 1.0 * i, rounded(felt.wrench.force.x), rounded(felt.wrench.force.y), rounded(felt.wrench.force.z));
  }
  fs_tool_destroy(tool);
  return finish(scene, argc, argv);
}
