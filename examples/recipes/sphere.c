/* A ball with a radius of 30 mm: no force outside; inside, 500 N/m push the hand out, away from the centre. No mesh is
 * needed: the force of a point can fall with the distance d, as 500 N/m * (30 mm - d), and is 0 from 30 mm on. */
#include "recipe.h"

int main(int argc, char **argv)
{
  const double stiffness = 500, radius = 0.03;  /* N/m, m */
  fs_object ball = fs_object_init("ball", FS_PRIMITIVE_POINT);
  fs_scene *scene;

  ball.front = fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_REPULSIVE, -stiffness, stiffness * radius, 10);
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &ball));
  feel(scene, "outside", 0, 0.04, 0);
  feel(scene, "on the surface", 0, 0.03, 0);
  feel(scene, "10 mm deep", 0, 0.02, 0);
  feel(scene, "10 mm deep, elsewhere", 0.012, 0, -0.016);
  feel(scene, "25 mm deep: the limit", 0, 0, 0.005);
  return finish(scene, argc, argv);
}
