/* A box of 60 mm x 60 mm x 40 mm: no force outside; inside, 500 N/m push the hand to the nearest face, 10 N at most. */
#include "recipe.h"

int main(int argc, char **argv)
{
  const uint32_t faces[12][3] = {  /* counter-clockwise as seen from outside, so the front is outside */
    {0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  fs_vec3 corners[8];
  fs_object box = fs_object_init("box", FS_PRIMITIVE_MESH);
  fs_scene *scene;
  int i;

  for (i = 0; i < 8; ++i) {  /* bit 0 of i: right, bit 1: away, bit 2: up */
    corners[i].x = i & 1 ? 0.03 : -0.03;
    corners[i].y = i & 2 ? 0.03 : -0.03;
    corners[i].z = i & 4 ? 0.02 : -0.02;
  }
  check(fs_shape_create_mesh(corners, 8, &faces[0][0], 12, &box.shape));
  box.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 500, 0, 10);
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &box));
  fs_shape_destroy(box.shape);  /* the scene keeps what it needs */
  feel(scene, "above the box", 0, 0, 0.03);
  feel(scene, "5 mm below the top", 0, 0, 0.015);
  feel(scene, "5 mm from the right face", 0.025, 0, 0);
  feel(scene, "beside a corner, outside", 0.031, 0.031, 0.021);
  return finish(scene, argc, argv);
}
