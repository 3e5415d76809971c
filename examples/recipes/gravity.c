/* Gravity: the weight of 0.2 kg, downwards and the same everywhere. The force of a plane is along its normal: its front
 * draws the hand to the plane, its back drives it away from the plane, and both are downwards. */
#include "recipe.h"

int main(int argc, char **argv)
{
  const double weight = 0.2 * 9.81;  /* N */
  fs_object gravity = fs_object_init("gravity", FS_PRIMITIVE_PLANE);
  fs_scene *scene;

  gravity.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, weight, 0, weight);
  gravity.back = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_REPULSIVE, weight, 0, weight);
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &gravity));
  feel(scene, "above the plane", 0, 0, 0.05);
  feel(scene, "in the plane", 0, 0, 0);
  feel(scene, "below the plane", 0, 0, -0.05);
  feel(scene, "far to the side", 0.09, -0.07, 0.02);
  return finish(scene, argc, argv);
}
