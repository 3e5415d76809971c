/* A hazard: a border, here a circle with a radius of 40 mm, that keeps the hand away on both sides, most strongly 10 mm
 * away, with 3 N. On the border itself there is no force, so the force does not jump when the hand is pushed across it;
 * from 30 mm on there is none either. */
#include "recipe.h"

int main(int argc, char **argv)
{
  const double newtons[] = {0, 2.2, 3, 2.4, 1.2, 0.3, 0}, degree = 0.017453292519943295;
  fs_object hazard = fs_object_init("hazard", FS_PRIMITIVE_POLYLINE);
  fs_vec3 border[360];
  fs_scene *scene;
  int i;

  for (i = 0; i < 360; ++i) {  /* with so many the force hardly jumps where, inside, two edges are equally near */
    border[i].x = 0.04 * cos((i + 0.5) * degree);
    border[i].y = 0.04 * sin((i + 0.5) * degree);
    border[i].z = 0;
  }
  check(fs_shape_create_polyline(border, 360, true, &hazard.shape));  /* closed: the last is joined to the first */
  hazard.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_REPULSIVE, 1, 0, 3);
  check(fs_curve_create_table(newtons, 7, 0.005, &hazard.front.curve));
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &hazard));
  fs_shape_destroy(hazard.shape);
  fs_curve_destroy(hazard.front.curve);
  feel(scene, "on the border", 0.04, 0, 0);
  feel(scene, "10 mm outside", 0.05, 0, 0);
  feel(scene, "10 mm inside", 0.03, 0, 0);
  feel(scene, "10 mm above the border", 0.04, 0, 0.01);
  feel(scene, "in the middle", 0, 0, 0);
  return finish(scene, argc, argv);
}
