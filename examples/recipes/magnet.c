/* A magnet with a battery: it draws the hand from all sides, most strongly 10 mm away, with 3 N. The gain is the charge
 * of the battery, 0 to 1, and may change at any time while the magnet is felt. */
#include "recipe.h"

int main(int argc, char **argv)
{
  fs_object magnet = fs_object_init("magnet", FS_PRIMITIVE_POINT);
  fs_scene *scene;
  int charge;

  magnet.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 3);
  check(fs_curve_create_expression("3 * d/0.01 * exp(0.5 - (d/0.01)^2/2)", &magnet.front.curve));  /* d: m; N */
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &magnet));
  feel(scene, "at the magnet", 0, 0, 0);
  feel(scene, "20 mm above it", 0, 0, 0.02);
  for (charge = 100; charge >= 0; charge -= 25) {
    char where[40];
    snprintf(where, sizeof where, "10 mm above it, at %d %%", charge);
    magnet.front.gain = charge / 100.0;
    check(fs_object_change(scene, &magnet, FS_PART_PROFILES));  /* not the pose: another client may move it */
    feel(scene, where, 0, 0, 0.01);
  }
  fs_curve_destroy(magnet.front.curve);
  return finish(scene, argc, argv);
}
