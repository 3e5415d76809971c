/* A wall: no force above z = 0; below, 500 N/m push the hand out, 10 N at most. */
#include "recipe.h"

int main(int argc, char **argv)
{
  const fs_vec3 point = {0, 0, 0}, normal = {0, 0, 1};  /* the normal points to where the hand is free */
  const fs_object wall = fs_wall_init("wall", point, normal, 500, 10);
  fs_scene *scene;

  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &wall));
  feel(scene, "in front", 0, 0, 0.01);
  feel(scene, "10 mm deep", 0, 0, -0.01);
  feel(scene, "10 mm deep, elsewhere", 0.04, 0.03, -0.01);
  feel(scene, "50 mm deep: the limit", 0, 0, -0.05);
  return finish(scene, argc, argv);
}
