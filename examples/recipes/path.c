/* A path: it draws the hand to itself, most strongly 10 mm away, with 3 N. On the path and from 20 mm on there is no
 * force, so the force does not jump when the hand comes or goes. */
#include "recipe.h"

int main(int argc, char **argv)
{
  const fs_vec3 points[] = {{-0.06, 0, 0}, {0, 0, 0}, {0.06, 0, 0.03}};
  const double newtons[] = {0, 2, 3, 2, 0};  /* every 5 mm; smooth in between; the last one also holds beyond */
  fs_object path = fs_object_init("path", FS_PRIMITIVE_POLYLINE);
  fs_scene *scene;

  check(fs_shape_create_polyline(points, 3, false, &path.shape));
  path.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 3);
  check(fs_curve_create_table(newtons, 5, 0.005, &path.front.curve));
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &path));
  fs_shape_destroy(path.shape);
  fs_curve_destroy(path.front.curve);
  feel(scene, "on the path", -0.03, 0, 0);
  feel(scene, "5 mm beside it", -0.03, 0.005, 0);
  feel(scene, "10 mm below it", -0.03, 0, -0.01);
  feel(scene, "30 mm beside it", -0.03, 0.03, 0);
  feel(scene, "10 mm past its end", -0.07, 0, 0);
  return finish(scene, argc, argv);
}
