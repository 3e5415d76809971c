/* fs_wall_init: of the four planes with one profile, the one that is a wall. Compiled as C and as C++. */
#include <math.h>
#include <stdlib.h>

#include <check.h>
#include <forceserver/forceserver.h>

static const fs_vec3 zero = {0, 0, 0};

static fs_vec3 add(fs_vec3 a, double s, fs_vec3 b)
{
  fs_vec3 sum;
  sum.x = a.x + s * b.x;
  sum.y = a.y + s * b.y;
  sum.z = a.z + s * b.z;
  return sum;
}
static double length(fs_vec3 a) { return sqrt(a.x * a.x + a.y * a.y + a.z * a.z); }
static double distance(fs_vec3 a, fs_vec3 b) { return length(add(a, -1, b)); }

static fs_vec3 force_at(fs_tool *tool, fs_vec3 x)
{
  fs_state hand;
  fs_response response;
  memset(&hand, 0, sizeof hand);
  hand.pose.position = x;
  ck_assert_int_eq(fs_evaluate(tool, &hand, &response), FS_OK);
  return response.wrench.force;
}

START_TEST(pushes_out_of_its_back)
{
  static const fs_vec3 normals[] = {{0, 0, 1}, {0, 0, -1}, {3, 0, 0}, {-1e-200, 0, 0}, {0, 1e200, 0}, {1, -2, 0.5}};
  const fs_vec3 point = {0.1, -0.2, 0.3};
  fs_scene *scene = NULL;
  fs_tool *tool = NULL;
  fs_report report;
  size_t i;
  ck_assert_int_eq(fs_scene_create(&scene), FS_OK);
  ck_assert_int_eq(fs_tool_create(scene, NULL, 0, &tool), FS_OK);
  for (i = 0; i < sizeof normals / sizeof *normals; ++i) {
    const fs_vec3 n = normals[i];
    const double largest = fmax(fabs(n.x), fmax(fabs(n.y), fabs(n.z)));
    fs_vec3 out = {n.x / largest, n.y / largest, n.z / largest}; /* its square neither over- nor underflows */
    const fs_object wall = fs_wall_init("wall", point, n, 400, 3);
    const double size = length(out);
    out = add(zero, 1 / size, out);
    ck_assert_msg(fs_object_set(scene, &wall) == FS_OK, "%s", fs_last_error());
    /* Free in front, near and far, and beside the point. */
    ck_assert_double_eq(length(force_at(tool, add(point, 0.001, out))), 0);
    ck_assert_double_eq(length(force_at(tool, add(point, 10, out))), 0);
    /* Behind, along the normal, 400 N/m up to 3 N. */
    ck_assert_double_lt(distance(force_at(tool, add(point, -0.005, out)), add(zero, 2, out)), 1e-9);
    ck_assert_double_lt(distance(force_at(tool, add(point, -0.1, out)), add(zero, 3, out)), 1e-9);
    /* Nothing jumps. */
    ck_assert_int_eq(fs_scene_get_report(scene, "wall", &report), FS_OK);
    ck_assert_double_eq_tol(report.stiffness_wanted, 400, 1e-9);
  }
  fs_tool_destroy(tool);
  fs_scene_destroy(scene);
}
END_TEST

/* fs_wall_init itself cannot fail: what is bad in its arguments is named by fs_object_set, and nothing is set. */
static void refused(fs_scene *scene, fs_object wall, const char *word)
{
  size_t count = 7;
  ck_assert_int_eq(fs_object_set(scene, &wall), FS_ERROR_INVALID);
  ck_assert_msg(strstr(fs_last_error(), word) != NULL, "\"%s\" does not name \"%s\"", fs_last_error(), word);
  ck_assert_int_eq(fs_scene_get_reports(scene, NULL, 0, &count), FS_OK);
  ck_assert_uint_eq(count, 0);
}

START_TEST(a_bad_argument_is_named)
{
  const fs_vec3 up = {0, 0, 1}, not_finite = {0, NAN, 1}, endless = {INFINITY, 0, 0};
  fs_scene *scene = NULL;
  fs_object good;
  ck_assert_int_eq(fs_scene_create(&scene), FS_OK);
  refused(scene, fs_wall_init("wall", zero, zero, 400, 3), "fs_wall_init is (0, 0, 0)");
  refused(scene, fs_wall_init("wall", zero, not_finite, 400, 3), "fs_wall_init is (0, nan, 1)");
  refused(scene, fs_wall_init("wall", zero, endless, 400, 3), "fs_wall_init is (inf, 0, 0)");
  refused(scene, fs_wall_init("wall", endless, up, 400, 3), "pose.position.x is inf");
  refused(scene, fs_wall_init("wall", zero, up, -1, 3), "back.gain is -1");
  refused(scene, fs_wall_init("wall", zero, up, NAN, 3), "back.gain");
  refused(scene, fs_wall_init("wall", zero, up, 400, 0), "back.limit is 0");
  refused(scene, fs_wall_init("", zero, up, 400, 3), "name");
  refused(scene, fs_wall_init(NULL, zero, up, 400, 3), "name");
  good = fs_wall_init("wall", zero, up, 0, 3); /* a slider at its end: not felt */
  ck_assert_msg(fs_object_set(scene, &good) == FS_OK, "%s", fs_last_error());
  fs_scene_destroy(scene);
}
END_TEST

int main(void)
{
  Suite *suite = suite_create("wall");
  TCase *test_case = tcase_create("wall");
  SRunner *runner;
  int failed;
  tcase_add_test(test_case, pushes_out_of_its_back);
  tcase_add_test(test_case, a_bad_argument_is_named);
  suite_add_tcase(suite, test_case);
  runner = srunner_create(suite);
  srunner_run_all(runner, CK_NORMAL);
  failed = srunner_ntests_failed(runner);
  srunner_free(runner);
  return failed == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
