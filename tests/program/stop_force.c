/* stop_force SERVER: a client that ends the force of all, as a stop button does. */
#include <stdio.h>

#include <forceserver/forceserver.h>

int main(int argc, char **argv)
{
  char endpoint[100];
  fs_scene *scene;
  if (argc != 2 || snprintf(endpoint, sizeof endpoint, "shm:%s", argv[1]) >= (int)sizeof endpoint) return 2;
  if (fs_scene_connect(endpoint, "stop", &scene) != FS_OK || fs_scene_stop_force(scene) != FS_OK) {
    fprintf(stderr, "%s\n", fs_last_error());
    return 1;
  }
  fs_scene_destroy(scene);
  return 0;
}
