/* A second client of the server, in C: the journeys ask it, and not the page, what became of an edit.
 *
 *     second ENDPOINT NAME
 *
 * It reads lines and answers each with a line of JSON:
 *     get NAME           all fields of an object; {"status": ..} if there is none
 *     list               the names of all objects
 *     hand               the hand, and the force that was sent
 *     frame CLIENT       the frame, clutch and tool of a client
 *     law STIFFNESS D NAME  the force of an object at the signed distance D, m, with slopes up to STIFFNESS (0: any)
 *     stats              whether the servo is enabled
 *     point NAME X Y Z   adds a point of its own there, with a force
 *     move NAME X Y Z    moves one
 *     gain NAME GAIN     changes its gain */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <forceserver/forceserver.h>

static void text(const char *s)
{
  putchar('"');
  for (; *s; ++s) {
    if (*s == '"' || *s == '\\') putchar('\\');
    putchar(*s);
  }
  putchar('"');
}

static void numbers(const char *name, const double *x, size_t count)
{
  size_t i;
  printf("\"%s\": [", name);
  for (i = 0; i < count; ++i) printf("%s%.17g", i ? ", " : "", x[i]);
  printf("], ");
}

static void profile(const char *name, const fs_profile *p)
{
  printf("\"%s\": {\"kind\": %d, \"sense\": %d, \"gain\": %.17g, \"offset\": %.17g, \"width\": %.17g, \"limit\": %.17g, "
         "\"reach\": %.17g, ", name, p->kind, p->sense, p->gain, p->offset, p->width, p->limit, p->reach);
  if (p->curve && fs_curve_get_expression(p->curve)) {
    printf("\"expression\": ");
    text(fs_curve_get_expression(p->curve));
    printf(", ");
  } else if (p->curve) {
    size_t count;
    double step;
    const double *table = fs_curve_get_table(p->curve, &count, &step);
    numbers("table", table, count);
    printf("\"step\": %.17g, ", step);
  }
  printf("\"end\": 0}, ");
}

static void get(fs_scene *scene, const char *name)
{
  fs_object o = fs_object_init("any", FS_PRIMITIVE_POINT);
  const fs_status status = fs_object_get(scene, name, &o);
  printf("{\"status\": \"%s\"", fs_status_name(status));
  if (status == FS_OK) {
    printf(", \"primitive\": %d, ", o.primitive);
    numbers("position", &o.pose.position.x, 3);
    numbers("orientation", &o.pose.orientation.w, 4);
    numbers("twist", &o.twist.linear.x, 6);
    profile("front", &o.front);
    profile("back", &o.back);
    printf("\"keep\": %d, \"stiffness\": %.17g, \"contact_limit\": %.17g, \"contact_damping\": %.17g, \"friction\": %.17g, ",
           o.contact.keep, o.contact.stiffness, o.contact.limit, o.contact.damping, o.contact.friction);
    if (o.surface) {
      fs_surface_settings s = fs_surface_settings_init();
      size_t count;
      const double *heights = fs_surface_get_heights(o.surface, &count);
      fs_surface_get_settings(o.surface, &s);
      printf("\"static_friction\": %.17g, \"slip_distance\": %.17g, \"column_width\": %.17g, ", s.static_friction, s.slip_distance,
             s.column_width);
      numbers("impact", &s.impact_gain, 3);
      numbers("heights", heights, count);
    }
    if (o.shape) {
      size_t points, triangles;
      const fs_vec3 *p = fs_shape_get_points(o.shape, &points);
      fs_shape_info info = fs_shape_info_init();
      fs_shape_get_triangles(o.shape, &triangles);
      fs_shape_get_info(o.shape, &info);
      printf("\"closed\": %s, \"triangles\": %zu, \"point_count\": %zu, ", info.closed ? "true" : "false", triangles, points);
      numbers("points", &p->x, 3 * (points < 1000 ? points : 1000));
    }
    printf("\"damping\": %.17g, \"lifetime\": %.17g, \"start\": %.17g, \"tool_points\": %u, \"enabled\": %s", o.damping,
           o.lifetime, o.start, o.tool_points, o.enabled ? "true" : "false");
  }
  printf("}\n");
  fs_object_release(&o);
}

static void list(fs_scene *scene)
{
  static fs_motion motions[8192];
  size_t count = 0, i;
  fs_scene_get_motions(scene, NULL, motions, 8192, &count);
  putchar('[');
  for (i = 0; i < count; ++i) {
    if (i) printf(", ");
    text(motions[i].name);
  }
  printf("]\n");
}

int main(int argc, char **argv)
{
  char line[512], verb[16], name[256];
  fs_scene *scene;
  if (argc != 3 || fs_scene_connect(argv[1], argv[2], &scene) != FS_OK) {
    fprintf(stderr, "second: %s\n", argc == 3 ? fs_last_error() : "usage: second ENDPOINT NAME");
    return 1;
  }
  while (fgets(line, sizeof line, stdin)) {
    fs_vec3 at = {0, 0, 0};
    char *rest;
    line[strcspn(line, "\n")] = 0;
    verb[0] = name[0] = 0;
    sscanf(line, "%15s", verb);
    rest = strchr(line, ' ');
    if (rest) strcpy(name, rest + 1);
    if (strcmp(verb, "get") == 0) {
      get(scene, name);
    } else if (strcmp(verb, "list") == 0) {
      list(scene);
    } else if (strcmp(verb, "hand") == 0) {
      fs_state state;
      fs_wrench sent;
      fs_scene_get_hand(scene, &state, NULL, &sent);
      printf("{");
      numbers("position", &state.pose.position.x, 3);
      numbers("sent", &sent.force.x, 3);
      printf("\"time\": %.17g}\n", state.time);
    } else if (strcmp(verb, "frame") == 0) {
      fs_view view;
      const fs_status status = fs_scene_get_view(scene, name, &view);
      printf("{\"status\": \"%s\", ", fs_status_name(status));
      numbers("position", &view.frame.pose.position.x, 3);
      numbers("orientation", &view.frame.pose.orientation.w, 4);
      numbers("points", &view.points[0].x, 3 * view.point_count);
      printf("\"scale\": %.17g, \"force_scale\": %.17g, \"held\": %s}\n", view.frame.scale, view.frame.force_scale,
             view.held ? "true" : "false");
    } else if (sscanf(line, "law %lf %lf %255[^\n]", &at.x, &at.y, name) == 3) {
      fs_object o = fs_object_init("any", FS_PRIMITIVE_POINT);
      double force = 0;
      fs_status status = fs_object_get(scene, name, &o);
      strcpy(o.name, "any");
      if (status == FS_OK) status = fs_object_evaluate_law(&o, at.x, 0, &at.y, 1, &force);
      fs_object_release(&o);
      if (status == FS_OK) printf("%.17g\n", force);
      else printf("\"%s\"\n", fs_status_name(status));
    } else if (strcmp(verb, "stats") == 0) {
      fs_servo_stats stats = fs_servo_stats_init();
      fs_scene_get_servo_stats(scene, &stats);
      printf("{\"enabled\": %u, \"late_p99\": %.17g}\n", stats.enabled, stats.late_p99);
    } else if (sscanf(line, "point %255s %lf %lf %lf", name, &at.x, &at.y, &at.z) == 4) {
      fs_object o = fs_object_init(name, FS_PRIMITIVE_POINT);
      o.pose.position = at;
      o.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, 1, 0.01, 2);
      printf("\"%s\"\n", fs_status_name(fs_object_set(scene, &o)));
    } else if (sscanf(line, "move %255s %lf %lf %lf", name, &at.x, &at.y, &at.z) == 4) {
      fs_pose pose;
      const fs_twist rest = {{0, 0, 0}, {0, 0, 0}};
      memset(&pose, 0, sizeof pose);
      pose.position = at;
      pose.orientation.w = 1;
      printf("\"%s\"\n", fs_status_name(fs_object_move(scene, name, &pose, &rest, FS_NOW)));
    } else if (sscanf(line, "gain %255s %lf", name, &at.x) == 2) {
      fs_object o = fs_object_init("any", FS_PRIMITIVE_POINT);
      fs_status status = fs_object_get(scene, name, &o);
      if (status == FS_OK) {
        o.front.gain = at.x;
        status = fs_object_change(scene, &o, FS_PART_PROFILES);
      }
      fs_object_release(&o);
      printf("\"%s\"\n", fs_status_name(status));
    } else {
      printf("\"what is: %s\"\n", verb);
    }
    fflush(stdout);
  }
  fs_scene_destroy(scene);
  return 0;
}
