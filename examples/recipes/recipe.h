/* What the recipes share: they print the force at a place, and save the scene to a file. */
#include <forceserver/forceserver.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static inline void check(fs_status status) {
  if (status >= 0) return;
  fprintf(stderr, "recipe: %s\n", fs_last_error());
  exit(1);
}

static inline double rounded(double force) { return fabs(force) < 0.005 ? 0 : force; }  /* no "-0.00" */

/* Prints what a hand feels that rests at (x, y, z), m. */
static inline void feel(fs_scene* scene, const char* where, double x, double y, double z) {
  const fs_vec3 position = {x, y, z};
  fs_vec3 f;
  check(fs_evaluate_field(scene, NULL, FS_NOW, &position, 1, &f));
  printf("%-26s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N\n", where, 1e3 * x, 1e3 * y, 1e3 * z, rounded(f.x),
         rounded(f.y), rounded(f.z));
}

/* Writes the scene to the file that the first argument names, if there is one. */
static inline int finish(fs_scene* scene, int argc, char** argv) {
  if (argc > 1) check(fs_scene_save(scene, argv[1]));
  fs_scene_destroy(scene);
  return 0;
}
