/* A fingertip: the tool's point is a ball with a radius of 8 mm. A floor and a wall hold it at its skin, and a post that pushes
 * everything away within 10 mm is felt 8 mm earlier. */
#include "recipe.h"

static fs_vec3 at = {0.02, 0, 0.03};  /* m */

static void go_to(fs_tool *tool, const char *where, double x, double z)
{
  const double from_x = at.x, from_z = at.z;
  fs_response felt;
  int i;
  for (i = 1; i <= 50; ++i) {
    fs_state hand = {0};
    at.x = from_x + (x - from_x) * i / 50;
    at.z = from_z + (z - from_z) * i / 50;
    hand.pose.position = at;
    check(fs_evaluate(tool, &hand, &felt));
  }
  printf("%-26s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N\n", where, 1e3 * at.x, 1e3 * at.y, 1e3 * at.z,
         rounded(felt.wrench.force.x), rounded(felt.wrench.force.y), rounded(felt.wrench.force.z));
}

int main(int argc, char **argv)
{
  fs_object floor = fs_object_init("floor", FS_PRIMITIVE_PLANE), wall = fs_object_init("wall", FS_PRIMITIVE_PLANE);
  fs_object post = fs_object_init("post", FS_PRIMITIVE_POINT);
  const fs_vec3 origin = {0, 0, 0}, right = {1, 0, 0};
  fs_scene *scene;
  fs_tool *tool;

  floor.contact.keep = FS_KEEP_FRONT;
  floor.contact.stiffness = 500;
  floor.contact.limit = 10;
  wall.contact = floor.contact;
  check(fs_pose_from_z(origin, right, &wall.pose));
  post.pose.position.x = 0.04;
  post.pose.position.z = 0.008;
  post.front = fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_REPULSIVE, -100, 1, 10);
  check(fs_scene_create(&scene));
  check(fs_scene_set_tool_radius(scene, 0.008));
  check(fs_object_set(scene, &floor));
  check(fs_object_set(scene, &wall));
  check(fs_object_set(scene, &post));
  check(fs_tool_create(scene, NULL, 0, &tool));
  go_to(tool, "above", 0.02, 0.02);
  go_to(tool, "it touches the floor", 0.02, 0.008);
  go_to(tool, "2 mm into the floor", 0.02, 0.006);
  go_to(tool, "1 mm into the wall, too", 0.007, 0.006);
  go_to(tool, "6 mm from the post", 0.026, 0.008);
  go_to(tool, "touches the post", 0.032, 0.008);
  fs_tool_destroy(tool);
  return finish(scene, argc, argv);
}
