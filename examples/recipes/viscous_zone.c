/* A ball of honey with a radius of 30 mm: it resists motion with 20 N s/m, 5 N at most, and does nothing to a hand at
 * rest. The damping of an object acts where its profile gives a force: here a force too small to be felt. */
#include "recipe.h"

static void feel_moving(fs_tool *tool, const char *where, double x, double speed)
{
  fs_state hand;
  fs_response response;
  memset(&hand, 0, sizeof hand);  /* all zeros is a good state */
  hand.pose.position.x = x;
  hand.twist.linear.y = speed;
  check(fs_evaluate(tool, &hand, &response));
  printf("%-26s %4.1f m/s   (%5.2f, %5.2f, %5.2f) N\n", where, speed, rounded(response.wrench.force.x),
         rounded(response.wrench.force.y), rounded(response.wrench.force.z));
}

int main(int argc, char **argv)
{
  fs_object honey = fs_object_init("honey", FS_PRIMITIVE_POINT);
  fs_scene *scene;
  fs_tool *tool;

  honey.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 1e-6, 0, 5);  /* the limit is for both */
  honey.front.reach = 0.03;
  honey.damping = 20;
  check(fs_scene_create(&scene));
  check(fs_object_set(scene, &honey));
  check(fs_tool_create(scene, NULL, 0, &tool));
  feel_moving(tool, "inside, at rest", 0.01, 0);
  feel_moving(tool, "inside, slowly", 0.01, 0.1);
  feel_moving(tool, "inside, back", 0.01, -0.1);
  feel_moving(tool, "inside, fast: the limit", 0.01, 1);
  feel_moving(tool, "outside, slowly", 0.04, 0.1);
  fs_tool_destroy(tool);
  return finish(scene, argc, argv);
}
