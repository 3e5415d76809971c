/* stop_force SERVER [SCENE]: a client that ends the force of all, as a stop button does, or that loads a scene. */
#include <stdio.h>

#include <forceserver/forceserver.h>

int main(int argc, char **argv)
{
  char endpoint[100];
  fs_scene *scene;
  if (argc < 2 || argc > 3 || snprintf(endpoint, sizeof endpoint, "shm:%s", argv[1]) >= (int)sizeof endpoint) return 2;
  if (fs_scene_connect(endpoint, "stop", &scene) != FS_OK ||
      (argc == 3 ? fs_scene_load(scene, argv[2]) : fs_scene_stop_force(scene)) != FS_OK) {
    fprintf(stderr, "%s\n", fs_last_error());
    return 1;
  }
  fs_scene_destroy(scene);
  return 0;
}
