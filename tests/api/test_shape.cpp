// Shapes, curves and mesh files: what is made of them, what is refused, and how long they live.
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <set>
#include <thread>

#include "api/hand.h"
#include "api/support.h"

using namespace scenes;

static constexpr double nan_ = std::numeric_limits<double>::quiet_NaN();
static constexpr double infinite = std::numeric_limits<double>::infinity();

static fs_shape_info info_of(const fs_shape* shape) {
  fs_shape_info info = fs_shape_info_init();
  OK(fs_shape_get_info(shape, &info));
  return info;
}

START_TEST(polylines) {
  const fs_vec3 points[]{{1, 2, 3}, {-1, 5, 3}, {0, 0, 9}};
  const Shape shape = make_polyline(points, 3, true);
  size_t count = 99;
  const fs_vec3* got = fs_shape_get_points(shape.get(), &count);
  ck_assert_uint_eq(count, 3);
  ck_assert(got != points);
  for (int i = 0; i < 3; ++i) EXPECT_VECTOR(got[i], points[i], 0);
  ck_assert_ptr_null(fs_shape_get_triangles(shape.get(), &count));
  ck_assert_uint_eq(count, 0);
  const fs_shape_info info = info_of(shape.get());
  ck_assert_int_eq(info.primitive, FS_PRIMITIVE_POLYLINE);
  ck_assert(info.closed);
  EXPECT_VECTOR(info.lower, (fs_vec3{-1, 0, 3}), 0);
  EXPECT_VECTOR(info.upper, (fs_vec3{1, 5, 9}), 0);
  ck_assert(!info_of(make_polyline(points, 2, false).get()).closed);
  const fs_vec3 same[]{{1, 1, 1}, {1, 1, 1}};  // of no length, but a line
  make_polyline(same, 2, false);
  for (const size_t n : {20'000, 300'000}) {  // the boxes of its segments have no area
    std::vector<fs_vec3> line(n);
    for (size_t i = 0; i < n; ++i) line[i].x = 1e-6 * static_cast<double>(i);
    make_polyline(line.data(), n, false);
    std::vector<uint32_t> flat;
    for (uint32_t i = 2; i < n; ++i) flat.insert(flat.end(), {i - 2, i - 1, i});
    fs_shape* mesh = nullptr;
    OK(fs_shape_create_mesh(line.data(), n, flat.data(), n - 2, &mesh));
    OK(fs_shape_build(mesh));
    fs_shape_destroy(mesh);
    std::fill(line.begin(), line.end(), fs_vec3{1, 2, 3});
    make_polyline(line.data(), n, false);
  }

  fs_shape* none = nullptr;
  EXPECT(FS_ERROR_INVALID, fs_shape_create_polyline(points, 1, false, &none));
  EXPECT(FS_ERROR_INVALID, fs_shape_create_polyline(points, 0, false, &none));
  EXPECT(FS_ERROR_INVALID, fs_shape_create_polyline(nullptr, 3, false, &none));
  for (double bad : {nan_, infinite, 1.1e15}) {
    fs_vec3 spoilt[]{points[0], points[1], points[2]};
    spoilt[2].z = bad;
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_shape_create_polyline(spoilt, 3, false, &none), "2");  // which point
  }
  ck_assert_ptr_null(none);
}
END_TEST

START_TEST(meshes) {
  const MeshData box = box_mesh({1, 2, 3});
  const Shape shape = make_mesh(box);
  size_t count = 0;
  const uint32_t* triangles = fs_shape_get_triangles(shape.get(), &count);
  ck_assert_uint_eq(count, 12);
  for (size_t i = 0; i < 36; ++i) ck_assert_uint_eq(triangles[i], box.triangles[i]);
  fs_shape_info info = info_of(shape.get());
  ck_assert_int_eq(info.primitive, FS_PRIMITIVE_MESH);
  ck_assert(info.closed && !info.built);
  ck_assert_uint_eq(info.open_edges, 0);
  ck_assert_uint_eq(info.odd_edges, 0);
  ck_assert_uint_eq(info.degenerate, 0);
  EXPECT_VECTOR(info.lower, (fs_vec3{-1, -2, -3}), 0);
  EXPECT_VECTOR(info.upper, (fs_vec3{1, 2, 3}), 0);
  OK(fs_shape_build(shape.get()));
  ck_assert(info_of(shape.get()).built);
  OK(fs_shape_build(shape.get()));

  fs_shape* none = nullptr;
  const fs_vec3* p = box.points.data();
  const uint32_t* t = box.triangles.data();
  EXPECT(FS_ERROR_INVALID, fs_shape_create_mesh(p, 8, t, 0, &none));
  EXPECT(FS_ERROR_INVALID, fs_shape_create_mesh(p, 7, t, 12, &none));  // an index beyond
  EXPECT(FS_ERROR_INVALID, fs_shape_create_mesh(nullptr, 8, t, 12, &none));
  EXPECT(FS_ERROR_INVALID, fs_shape_create_mesh(p, 8, nullptr, 12, &none));
  EXPECT(FS_ERROR_INVALID, fs_shape_create_mesh(p, 8, t, 12, nullptr));
  MeshData bad = box;
  bad.points[5].x = nan_;
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_shape_create_mesh(bad.points.data(), 8, t, 12, &none), "5");
  ck_assert_ptr_null(none);
}
END_TEST

START_TEST(edges_of_meshes) {  // counted; the triangles are kept whatever they are
  MeshData mesh = box_mesh({1, 1, 1});
  mesh.triangles.resize(33);  // one triangle off
  fs_shape_info info = info_of(make_mesh(mesh).get());
  ck_assert_uint_eq(info.open_edges, 3);
  ck_assert_uint_eq(info.odd_edges, 0);
  ck_assert(!info.closed);

  mesh = box_mesh({1, 1, 1});
  std::swap(mesh.triangles[0], mesh.triangles[1]);  // one the wrong way round: its three edges disagree
  info = info_of(make_mesh(mesh).get());
  ck_assert_uint_eq(info.odd_edges, 3);
  ck_assert_uint_eq(info.open_edges, 0);

  // A fin: a third triangle at an edge of the box.
  mesh = box_mesh({1, 1, 1});
  mesh.points.push_back({5, 5, 5});
  mesh.triangles.insert(mesh.triangles.end(), {0, 1, 8});
  info = info_of(make_mesh(mesh).get());
  ck_assert_uint_eq(info.odd_edges, 1);
  ck_assert_uint_eq(info.open_edges, 2);

  // Corners of its own for each triangle: no edge is shared, but the places close it.
  info = info_of(make_mesh(split_corners(box_mesh({1, 1, 1}))).get());
  ck_assert_uint_eq(info.open_edges, 36);
  ck_assert(!info.closed && info.has_inside);
  mesh = split_corners(box_mesh({1, 1, 1}));
  mesh.triangles.resize(33);
  ck_assert(!info_of(make_mesh(mesh).get()).has_inside);

  mesh = box_mesh({1, 1, 1});
  mesh.triangles.insert(mesh.triangles.end(), {0, 0, 1});
  const Shape shape = make_mesh(mesh);
  ck_assert_uint_eq(info_of(shape.get()).degenerate, 1);
  size_t count = 0;
  fs_shape_get_triangles(shape.get(), &count);
  ck_assert_uint_eq(count, 13);
}
END_TEST

START_TEST(shape_references) {
  fs_shape* shape = make_mesh(box_mesh({1, 1, 1})).release();
  ck_assert_ptr_eq(fs_shape_retain(shape), shape);
  fs_shape_destroy(shape);
  size_t count = 0;
  ck_assert_ptr_nonnull(fs_shape_get_points(shape, &count));
  fs_shape_destroy(shape);
  ck_assert_ptr_null(fs_shape_retain(nullptr));
  ck_assert_ptr_null(fs_curve_retain(nullptr));
}
END_TEST

static double progress_of(const fs_shape* shape) {
  double out = nan_;
  OK(fs_shape_get_progress(shape, &out));
  return out;
}

// Seen by other threads, of which one builds too: it only grows, and is 1 exactly when the tree is there.
// What a tool remembers of a mesh goes with it: another mesh of the same object is felt as by a new tool.
START_TEST(another_mesh_is_felt_at_once) {
  const Scene scene = make_scene();
  const Tool old_tool = make_tool(scene.get());
  const Shape large = make_mesh(sphere_mesh(0.5, 800)), small = make_mesh(moved(sphere_mesh(0.4, 800), at(0.35, 0, 0)));
  fs_object o = fs_object_init("ball", FS_PRIMITIVE_MESH);
  o.shape = large.get();
  o.front = o.back = fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_ATTRACTIVE, -10, 1, 1);
  OK(fs_object_set(scene.get(), &o));
  for (const double x : {0.001, 0.003, 0.00301, 0.003011}) force_at(old_tool.get(), {x, 0, 0});
  o.shape = small.get();
  OK(fs_object_set(scene.get(), &o));
  const Tool new_tool = make_tool(scene.get());
  const fs_vec3 expected = force_at(new_tool.get(), {0.003011, 0, 0});
  ck_assert_double_gt(norm(expected), 0.1);
  EXPECT_VECTOR(force_at(old_tool.get(), (fs_vec3{0.003011, 0, 0})), expected, 0);
}
END_TEST

START_TEST(progress_of_a_build) {
  const fs_vec3 ends[]{{0, 0, 0}, {1, 0, 0}};
  ck_assert_double_eq(progress_of(make_polyline(ends, 2, false).get()), 1);
  const Shape mesh = make_mesh(torus_mesh(0.05, 0.02, is_sanitized ? 20'000 : 200'000));
  ck_assert_double_eq(progress_of(mesh.get()), 0);
  std::atomic<int> wrong{0}, ready{0};
  size_t seen = 0;
  const auto watch = [&](size_t* different) {
    double last = 0;
    ++ready;
    while (last < 1) {
      const bool was_built = info_of(mesh.get()).built;
      const double now = progress_of(mesh.get());
      wrong += !(now >= last && now <= 1) || (was_built && now < 1) || (now == 1 && !info_of(mesh.get()).built);
      if (different) *different += now != last;
      last = now;
    }
  };
  std::thread first(watch, &seen), second(watch, nullptr);
  while (ready < 2) std::this_thread::yield();
  std::thread other([&] { wrong += fs_shape_build(mesh.get()) != FS_OK; });
  OK(fs_shape_build(mesh.get()));
  ck_assert_double_eq(progress_of(mesh.get()), 1);
  other.join();
  first.join();
  second.join();
  ck_assert_int_eq(wrong, 0);
  std::printf("  steps of the progress that were seen: %zu\n", seen);
}
END_TEST

static size_t threads_of_this_process() {
  const std::filesystem::directory_iterator tasks("/proc/self/task");
  return static_cast<size_t>(std::distance(begin(tasks), end(tasks)));
}

// Also in processes that were forked before the first build and after it, where a thread would be missing.
START_TEST(a_build_needs_no_other_thread) {
  const auto build = [] {
    const size_t before = threads_of_this_process();
    const Shape mesh = make_mesh(torus_mesh(0.05, 0.02, 20'000));
    return fs_shape_build(mesh.get()) == FS_OK && info_of(mesh.get()).built && threads_of_this_process() == before;
  };
  const auto build_in_fork = [&] {
    const pid_t child = fork();
    if (child == 0) {
      alarm(100);
      _exit(build() ? 0 : 1);
    }
    int status = -1;
    return waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
  };
  ck_assert(build_in_fork());
  ck_assert(build());
  ck_assert(build_in_fork());
  ck_assert(build());
}
END_TEST

START_TEST(tables) {
  const double forces[]{0, 3, 1, 1};
  const Curve curve = make_table(forces, 4, 0.5);
  fs_curve *too_long = nullptr;
  for (const size_t count : {SIZE_MAX, size_t{1} << 62}) EXPECT(FS_ERROR_MEMORY, fs_curve_create_table(forces, count, 0.5, &too_long));
  size_t count = 0;
  double step = 0;
  const double* got = fs_curve_get_table(curve.get(), &count, &step);
  ck_assert_uint_eq(count, 4);
  ck_assert_double_eq(step, 0.5);
  for (int i = 0; i < 4; ++i) ck_assert_double_eq(got[i], forces[i]);
  ck_assert_ptr_null(fs_curve_get_expression(curve.get()));

  fs_curve* none = nullptr;
  EXPECT(FS_ERROR_INVALID, fs_curve_create_table(forces, 1, 0.5, &none));
  EXPECT(FS_ERROR_INVALID, fs_curve_create_table(nullptr, 4, 0.5, &none));
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_curve_create_table(forces, 4, 0, &none), "step");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_curve_create_table(forces, 4, -1, &none), "step");
  EXPECT_SENTENCE(FS_ERROR_INVALID, fs_curve_create_table(forces, 4, nan_, &none), "step");
  ck_assert_ptr_null(none);

  const double odd[]{2, nan_, -3, infinite, 2};  // below 0 or not finite counts as 0
  const double distances[]{0, 1, 1.5, 2, 2.5, 3, 4, 9}, expected[]{2, 0, 0, 0, 0, 0, 2, 2};
  const Curve odd_curve = make_table(odd, 5, 1);
  fs_profile profile = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 9);
  profile.curve = odd_curve.get();
  double felt[8];
  OK(fs_profile_evaluate(&profile, 0, 0, distances, 8, felt));
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(felt[i], expected[i], 0);
}
END_TEST

START_TEST(expressions) {
  fs_curve* none = nullptr;
  EXPECT(FS_ERROR_INVALID, fs_curve_create_expression(nullptr, &none));
  if (!has_expressions()) {
    EXPECT(FS_ERROR_UNSUPPORTED, fs_curve_create_expression("d", &none));
    return;
  }
  const char* text = "3*(1+sin(12*t))*exp(-d/0.01)";
  const Curve curve = make_expression(text);
  ck_assert_str_eq(fs_curve_get_expression(curve.get()), text);
  size_t count = 9;
  double step = 9;
  ck_assert_ptr_null(fs_curve_get_table(curve.get(), &count, &step));
  ck_assert_uint_eq(count, 0);
  // What is no expression in d and t, with the place where it goes wrong.
  const char* bad[]{"3*(1+", "3*q", "1 2", "a=5", "d=3", "3,4", "1;2", "sin(", "exp(-d/0.01", ")", "d +* t",
                    "\"text\"", "d?1", "$"};
  for (const char* b : bad) {
    EXPECT(FS_ERROR_PARSE, fs_curve_create_expression(b, &none));
    ck_assert_uint_gt(std::strlen(fs_last_error()), 5);
  }
  for (const char* nothing : {"", "   "}) ck_assert_int_lt(fs_curve_create_expression(nothing, &none), 0);
  EXPECT(FS_ERROR_PARSE, fs_curve_create_expression("1+2+3+4+wrong+5", &none));
  ck_assert_msg(std::strpbrk(fs_last_error(), "0123456789"), "no place in \"%s\"", fs_last_error());
  std::string longest = "d";
  while (longest.size() + 2 <= 255) longest += "+1";
  make_expression(longest.c_str());
  const std::string too_long(256, ' ');
  const fs_status status = fs_curve_create_expression((longest + "+1").c_str(), &none);
  ck_assert(status == FS_ERROR_PARSE || status == FS_ERROR_INVALID);
  // Deep nesting ends in a sentence or a curve, not in a crash.
  const std::string deep = std::string(120, '(') + "d" + std::string(120, ')');
  if (fs_curve_create_expression(deep.c_str(), &none) == FS_OK) fs_curve_destroy(none);
}
END_TEST

// Mesh files.

static std::string write_file(const char* name, const std::string& text) {
  const std::string path = "/tmp/forceserver-test-" + std::to_string(getpid()) + "-" + name;
  std::ofstream(path, std::ios::binary) << text;
  return path;
}

static const char* const obj_text =
    "# a tetrahedron\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
static const char* const off_text = "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";
static const char* const ply_text =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\nelement face 4\n"
    "property list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";
static const char* const stl_text =
    "solid t\n"
    "facet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\n"
    "facet normal 0 -1 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet\n"
    "facet normal 1 1 1\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\n"
    "facet normal -1 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\nendfacet\nendsolid t\n";

START_TEST(mesh_files) {  // four ways to say one tetrahedron, in millimetres
  const struct {
    const char *name, *text;
  } files[]{{"a.obj", obj_text}, {"a.off", off_text}, {"a.ply", ply_text}, {"a.stl", stl_text}};
  for (const auto& file : files) {
    const std::string path = write_file(file.name, file.text);
    fs_shape* raw = nullptr;
    OK(fs_shape_load(path.c_str(), 0.001, &raw));
    const Shape shape(raw);
    const fs_shape_info info = info_of(shape.get());
    EXPECT_VECTOR(info.upper, (fs_vec3{0.001, 0.001, 0.001}), 0);
    size_t count = 0;
    fs_shape_get_triangles(shape.get(), &count);
    ck_assert_uint_eq(count, 4);
    // Felt alike: 0.2 mm under the ground face the hand is drawn up by its front.
    const Scene scene = make_scene();
    const Tool tool = make_tool(scene.get());
    fs_object o = fs_object_init("t", FS_PRIMITIVE_MESH);
    o.shape = shape.get();
    o.front = attract(1000, 5);
    OK(fs_object_set(scene.get(), &o));
    EXPECT_VECTOR(force_at(tool.get(), {2e-4, 2e-4, -2e-4}), (fs_vec3{0, 0, 0.2}), 1e-12);
    EXPECT_VECTOR(force_at(tool.get(), {2e-4, 2e-4, 1e-5}), (fs_vec3{}), 0);  // within: no back profile
    ck_assert_int_eq(unlink(path.c_str()), 0);
  }
}
END_TEST

START_TEST(faces_that_are_not_convex) {  // an L: nothing is felt in its notch
  const char* const vertices = "v 0 2 0\nv 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\n";
  const std::string points = "0 2 0\n0 0 0\n2 0 0\n2 1 0\n1 1 0\n1 2 0\n";
  const struct {
    const char* name;
    std::string text;
  } files[]{{"l.obj", std::string(vertices) + "f 1 2 3 4 5 6\n"},
            {"l.off", "OFF\n6 1 0\n" + points + "6 0 1 2 3 4 5\n"},
            {"l.ply", "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
                      "element face 1\nproperty list uchar int vertex_indices\nend_header\n" + points +
                      "6 0 1 2 3 4 5\n"}};
  for (const auto& file : files) {
    const std::string path = write_file(file.name, file.text);
    fs_shape* raw = nullptr;
    OK(fs_shape_load(path.c_str(), 1, &raw));
    unlink(path.c_str());
    const Shape shape(raw);
    size_t count = 0;
    fs_shape_get_triangles(shape.get(), &count);
    ck_assert_uint_eq(count, 4);
    const Scene scene = make_scene();
    fs_object o = fs_object_init("l", FS_PRIMITIVE_MESH);
    o.shape = shape.get();
    o.front = o.back = attract(100, 1000);
    OK(fs_object_set(scene.get(), &o));
    const fs_vec3 places[]{{1.5, 1.5, 0}, {1.75, 1.25, 0}, {0.5, 0.5, 0.25}, {0.5, 1.5, -0.25}};
    const fs_vec3 wanted[]{{-50, 0, 0}, {0, -25, 0}, {0, 0, -25}, {0, 0, 25}};
    fs_vec3 forces[4];
    OK(fs_evaluate_field(scene.get(), nullptr, FS_NOW, places, 4, forces));
    EXPECT_NEAR(norm(forces[0]), 50, 1e-9);  // to an edge of the notch, whichever
    for (int i = 1; i < 4; ++i) EXPECT_VECTOR(forces[i], wanted[i], 1e-9);
  }
}
END_TEST

START_TEST(bad_mesh_files) {
  fs_shape* none = nullptr;
  EXPECT_SENTENCE(FS_ERROR_NOT_FOUND, fs_shape_load("/tmp/there/is/no/such.obj", 1, &none), "such.obj");
  const struct {
    const char *name, *text;
    fs_status status;
  } files[]{
      {"empty.obj", "", FS_ERROR_PARSE},
      {"word.obj", "v 0 0 zero\n", FS_ERROR_PARSE},
      {"index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", FS_ERROR_PARSE},
      {"nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", FS_ERROR_PARSE},
      {"short.off", "OFF\n4 4 6\n0 0 0\n1 0 0\n", FS_ERROR_PARSE},
      {"huge.off", "OFF\n4000000000 4 6\n0 0 0\n", FS_ERROR_PARSE},
      {"huge.ply", "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty double x\nproperty double y\n"
                   "property double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n",
       FS_ERROR_PARSE},
      {"index.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", FS_ERROR_PARSE},
      {"cut.stl", "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", FS_ERROR_PARSE},
      {"other.xyz", "1 2 3\n", FS_ERROR_UNSUPPORTED},
  };
  for (const auto& file : files) {
    const std::string path = write_file(file.name, file.text);
    const fs_status status = fs_shape_load(path.c_str(), 1, &none);
    ck_assert_msg(status == file.status, "%s: %s (%s)", file.name, fs_status_name(status), fs_last_error());
    unlink(path.c_str());
  }
  const std::string empty = write_file("empty.stl", "");
  EXPECT_SENTENCE(FS_ERROR_PARSE, fs_shape_load(empty.c_str(), 1, &none),
                  "the file is empty; an STL file begins with \"solid\" or has at least 84 bytes");
  unlink(empty.c_str());
  // A binary STL that claims more triangles than it holds.
  std::string stl(84, '\0');
  stl[80] = stl[81] = stl[82] = '\x7f';
  const std::string path = write_file("claims.stl", stl);
  EXPECT(FS_ERROR_PARSE, fs_shape_load(path.c_str(), 1, &none));
  unlink(path.c_str());
  const std::string good = write_file("good.obj", obj_text);
  for (double bad : {0.0, -1.0, nan_, infinite}) {
    EXPECT_SENTENCE(FS_ERROR_INVALID, fs_shape_load(good.c_str(), bad, &none), "scale");
  }
  unlink(good.c_str());
  ck_assert_ptr_null(none);
}
END_TEST

// The builders of tests/scenes, so that other tests can trust them.

static double volume(const MeshData& mesh) {
  double six_volumes = 0;
  for (size_t i = 0; i < mesh.triangles.size(); i += 3) {
    six_volumes += dot(mesh.points[mesh.triangles[i]],
                       cross(mesh.points[mesh.triangles[i + 1]], mesh.points[mesh.triangles[i + 2]]));
  }
  return six_volumes / 6;
}

START_TEST(scenes_of_the_tests) {
  const double pi = std::numbers::pi;
  EXPECT_NEAR(volume(sphere_mesh(1, 4000)), 4 * pi / 3, 0.02);
  EXPECT_NEAR(volume(torus_mesh(1, 0.3, 4000)), 2 * pi * pi * 0.09, 0.02);
  EXPECT_NEAR(volume(box_mesh({1, 2, 3})), 48, 1e-12);
  for (const MeshData& mesh : {sphere_mesh(1, 200), torus_mesh(1, 0.3, 200), box_mesh({1, 1, 1})}) {
    const fs_shape_info info = info_of(make_mesh(mesh).get());
    ck_assert(info.closed);
    ck_assert_uint_eq(info.odd_edges, 0);
  }
  ck_assert(!info_of(make_mesh(terrain_mesh(1, 0.3, 200)).get()).closed);
  EXPECT_NEAR(sphere_mesh(1, 70000).triangles.size() / 3.0, 70000, 1000);
  for (const Named& named : all_scenes()) {
    const Scene scene = make_scene();
    const Content content = named.build();
    fill(scene.get(), content);
    ck_assert_uint_eq(object_count(scene.get()), content.objects.size());
  }
}
END_TEST

// ---- Closed meshes of several parts. ----

static MeshData prism_mesh(double radius, double half_height, int sides) {
  MeshData m;
  for (int i = 0; i < sides; ++i) {
    const double angle = 2 * std::numbers::pi * i / sides;
    for (const double z : {-half_height, half_height}) m.points.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
  }
  for (uint32_t i = 0, n = static_cast<uint32_t>(sides); i < n; ++i) {
    const uint32_t a = 2 * i, b = 2 * ((i + 1) % n);
    m.triangles.insert(m.triangles.end(), {a, b, a + 1, b, b + 1, a + 1});
    if (i > 0 && i + 1 < n) m.triangles.insert(m.triangles.end(), {0, b, a, 1, a + 1, b + 1});
  }
  return m;
}
static MeshData joined(const std::vector<MeshData>& parts) {
  MeshData out;
  for (const MeshData& part : parts) {
    const auto first = static_cast<uint32_t>(out.points.size());
    out.points.insert(out.points.end(), part.points.begin(), part.points.end());
    for (const uint32_t i : part.triangles) out.triangles.push_back(first + i);
  }
  return out;
}
static MeshData turned_inwards(MeshData m) {
  for (size_t t = 0; t < m.triangles.size(); t += 3) std::swap(m.triangles[t], m.triangles[t + 1]);
  return m;
}

// Three bodies in a row, a head, six legs of a thigh and a foot, each stuck into the next, as people make such models.
static std::vector<MeshData> ant() {
  std::vector<MeshData> parts;
  const auto put = [&](const MeshData& mesh, fs_vec3 at, fs_vec3 axis = {0, 0, 1}, double angle = 0) {
    parts.push_back(moved(mesh, {at, turn(axis, angle)}));
  };
  put(sphere_mesh(0.02, 150), {0, 0, 0});
  put(sphere_mesh(0.03, 150), {-0.04, 0, 0.002});
  put(sphere_mesh(0.016, 120), {0.03, 0.001, 0.004});
  for (int i = 0; i < 6; ++i) {
    const double x = 0.012 * (i / 2 - 1), side = i % 2 ? 1 : -1;
    put(prism_mesh(0.003, 0.022, 7), {x, side * 0.03, 0.003 + 0.0001 * i}, {1, 0, 0}, side * 1.5);
    put(box_mesh({0.002, 0.0025, 0.015}), {x + 0.001, side * 0.05, -0.008}, {1, 0, 0}, side * 0.2);
  }
  return parts;
}

// Whether x is in one of the parts, farther from its surface than `margin` (m).
static bool is_within(const std::vector<MeshData>& parts, fs_vec3 x, double margin) {
  return std::any_of(parts.begin(), parts.end(), [&](const MeshData& part) {
    fs_vec3 low = part.points[0], high = low;
    for (const fs_vec3& p : part.points) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    if (x.x < low.x || x.y < low.y || x.z < low.z || x.x > high.x || x.y > high.y || x.z > high.z) return false;
    if (std::fabs(winding(part, x)) < 0.5) return false;
    for (size_t t = 0; margin > 0 && t < part.triangles.size(); t += 3) {
      const fs_vec3 a = part.points[part.triangles[t]], b = part.points[part.triangles[t + 1]], c = part.points[part.triangles[t + 2]];
      const fs_vec3 n = unit(cross(b - a, c - a)), foot = x - dot(x - a, n) * n;
      const bool is_over = dot(cross(b - a, foot - a), n) > -1e-12 && dot(cross(c - b, foot - b), n) > -1e-12 &&
                           dot(cross(a - c, foot - c), n) > -1e-12;
      if (is_over && std::fabs(dot(x - a, n)) < margin) return false;
    }
    return true;
  });
}

// The force of 1 N/m to the surface, as seen from one side only, and from both.
struct Seen {
  fs_vec3 front, back;
};
static std::vector<Seen> seen(const MeshData& mesh, const std::vector<fs_vec3>& places, fs_vec3 moved_by = {}) {
  MeshData there = mesh;
  for (fs_vec3& p : there.points) p = p + moved_by;
  const Shape shape = make_mesh(there);
  std::vector<fs_vec3> xs = places, forces(places.size());
  for (fs_vec3& x : xs) x = x + moved_by;
  std::vector<Seen> out(places.size());
  for (const bool is_front : {true, false}) {
    const Scene scene = make_scene();
    fs_object o = fs_object_init("o", FS_PRIMITIVE_MESH);
    o.shape = shape.get();
    (is_front ? o.front : o.back) = attract(1, 1000);
    OK(fs_object_set(scene.get(), &o));
    OK(fs_evaluate_field(scene.get(), nullptr, 1, xs.data(), xs.size(), forces.data()));
    for (size_t i = 0; i < xs.size(); ++i) (is_front ? out[i].front : out[i].back) = forces[i];
  }
  return out;
}

// Against brute force: inside is what is in any part; the closest point lies in no part, and no place of their surfaces that lies in
// no other part is nearer.
static void check_union(const char* name, const std::vector<MeshData>& parts, uint64_t seed, int count) {
  const MeshData mesh = joined(parts);
  std::vector<fs_vec3> free;  // places on the surface of the union
  for (const MeshData& part : parts) {
    for (size_t t = 0; t < part.triangles.size(); t += 3) {
      const fs_vec3 a = part.points[part.triangles[t]], b = part.points[part.triangles[t + 1]], c = part.points[part.triangles[t + 2]];
      const fs_vec3 out = 1e-7 * unit(cross(b - a, c - a));
      const int n = 2 + static_cast<int>(std::sqrt(norm(cross(b - a, c - a))) / 0.005);
      for (int i = 0; i <= n; ++i) {
        for (int k = 0; k + i <= n; ++k) {
          const fs_vec3 x = a + (1.0 * i / n) * (b - a) + (1.0 * k / n) * (c - a);
          if (!is_within(parts, x, 1e-9) && !is_within(parts, x + out, 0)) free.push_back(x);  // not between two that touch
        }
      }
    }
  }
  fs_vec3 low{1e9, 1e9, 1e9}, high = -1.0 * low;
  for (const fs_vec3& p : mesh.points) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  Random random(seed);
  std::vector<fs_vec3> places;
  for (int i = 0; i < count; ++i) {
    const fs_vec3 x{random.between(low.x, high.x), random.between(low.y, high.y), random.between(low.z, high.z)};
    places.push_back(x);
    // Beside the surface, where the parts meet too.
    places.push_back(free[random.below(free.size())] + random.log_between(1e-7, 1e-2) * random.direction());
    // On an edge of surface that lies inside.
    const size_t t = 3 * random.below(mesh.triangles.size() / 3);
    const fs_vec3 a = mesh.points[mesh.triangles[t]], b = mesh.points[mesh.triangles[t + 1]];
    const fs_vec3 on = a + (1.0 / 16) * static_cast<double>(random.below(17)) * (b - a);
    if (is_within(parts, on, 1e-6)) places.push_back(on);
  }
  const std::vector<Seen> got = seen(mesh, places), turned = seen(turned_inwards(mesh), places);
  int inside = 0;
  for (size_t i = 0; i < places.size(); ++i) {
    const fs_vec3 x = places[i], force = got[i].front + got[i].back;
    const double distance = norm(force);
    const bool is_inside = is_within(parts, x, 0);
    inside += is_inside;
    ck_assert_msg((norm(got[i].back) > 0) == is_inside, "%s: (%.17g, %.17g, %.17g) is %s, but the force is %g N in front, %g N behind",
                  name, x.x, x.y, x.z, is_inside ? "inside" : "outside", norm(got[i].front), norm(got[i].back));
    ck_assert_msg(!is_within(parts, x + force, 1e-8), "%s: (%.17g, %.17g, %.17g): the closest point, %g m away, lies within a part",
                  name, x.x, x.y, x.z, distance);
    EXPECT_NEAR(norm(turned[i].front), norm(got[i].back), 1e-9);  // two places may be equally near
    EXPECT_NEAR(norm(turned[i].back), norm(got[i].front), 1e-9);
    for (const fs_vec3& p : free) {
      ck_assert_msg(norm(p - x) >= distance - 1e-8, "%s: (%.17g, %.17g, %.17g): %g m away, not %g m", name, x.x, x.y, x.z,
                    norm(p - x), distance);
    }
  }
  ck_assert_int_gt(inside, count / 50);
}

START_TEST(parts_that_cross_are_one_body) {
  // A beam stuck in a box: what pushes out of them goes on to do so on the way through the hidden end of the beam.
  const std::vector<MeshData> two{box_mesh({0.03, 0.03, 0.02}), moved(box_mesh({0.02, 0.01, 0.01}), at({0.04, 0, 0}))};
  const fs_shape_info info = info_of(make_mesh(joined(two)).get());
  ck_assert(info.closed);
  std::vector<fs_vec3> way;
  for (double z = 0.0199; z > -0.0195; z -= 0.0005) way.push_back({0.018, 0, z});
  for (const fs_vec3 far : {fs_vec3{}, fs_vec3{1e6, -2e6, 3e5}}) {
    const std::vector<Seen> felt = seen(joined(two), way, far);
    for (size_t i = 0; i < way.size(); ++i) {
      const double depth = std::min(0.02 - std::fabs(way[i].z), std::hypot(0.012, std::max(0.0, 0.01 - std::fabs(way[i].z)) > 0 ?
                                    0.01 - std::fabs(way[i].z) : 0.0));
      ck_assert_msg(norm(felt[i].front) == 0, "at z = %g it counts as outside", way[i].z);
      ck_assert_msg(std::fabs(norm(felt[i].back) - depth) < 1e-8, "at z = %g: %g m deep, not %g", way[i].z, norm(felt[i].back), depth);
    }
  }
  const int count = is_sanitized ? 50 : times(100, 300);
  check_union("box and beam", two, 1, count);
  check_union("ant", ant(), 2, count);
  check_union("split corners", {split_corners(two[0]), split_corners(two[1])}, 7, count);
  // Flush and equal parts, and parts within parts.
  check_union("flush", {box_mesh({0.03, 0.03, 0.02}), moved(box_mesh({0.01, 0.01, 0.01}), at({0, 0, 0.03}))}, 3, count);
  check_union("flush at an edge", {box_mesh({0.03, 0.03, 0.02}), moved(box_mesh({0.01, 0.01, 0.01}), at({0.04, 0.02, 0.01}))}, 4, count);
  check_union("within", {box_mesh({0.03, 0.03, 0.02}), moved(sphere_mesh(0.01, 100), at({0.005, 0, 0}))}, 5, count);
  check_union("twice", {box_mesh({0.03, 0.02, 0.02}), box_mesh({0.03, 0.02, 0.02}), moved(sphere_mesh(0.015, 200), at({0.03, 0, 0}))}, 6, count);
  for (int i = 0; i < (is_sanitized ? 1 : times(3, 12)); ++i) {
    Random random(100 + static_cast<uint64_t>(i));
    std::vector<MeshData> parts;
    for (uint64_t n = 2 + random.below(5); parts.size() < n;) {
      const double size = random.between(0.005, 0.03);
      const uint64_t kind = random.below(4);
      const MeshData one = kind == 0   ? box_mesh({size, random.between(0.002, 0.03), random.between(0.002, 0.03)})
                           : kind == 1 ? prism_mesh(size, random.between(0.002, 0.04), 3 + static_cast<int>(random.below(12)))
                           : kind == 2 ? sphere_mesh(size, 40 + random.below(200))
                                       : torus_mesh(0.02, 0.006, 150);
      parts.push_back(moved(one, random.pose(0.02)));
    }
    check_union(("scene " + std::to_string(i)).c_str(), parts, static_cast<uint64_t>(i), count / 2);
  }
}
END_TEST

// Parts that keep apart, and a hollow, are left as they are; so is what is not closed.
START_TEST(parts_that_keep_apart) {
  const MeshData shell = joined({sphere_mesh(0.03, 300), turned_inwards(sphere_mesh(0.02, 200))});
  const std::vector<Seen> felt = seen(shell, {{0, 0, 0.005}, {0, 0, 0.026}, {0, 0, 0.04}});
  ck_assert(norm(felt[0].front) > 0.01 && norm(felt[0].back) == 0);  // the hollow is outside
  ck_assert(norm(felt[1].back) > 0.003 && norm(felt[1].front) == 0);
  ck_assert(norm(felt[2].front) > 0.009 && norm(felt[2].back) == 0);
  const MeshData apart = joined({sphere_mesh(0.03, 300), moved(sphere_mesh(0.02, 200), at({0.06, 0, 0}))});
  for (const MeshData& mesh : {shell, apart, terrain_mesh(1, 0.3, 200), sphere_mesh(0.03, 300)}) {
    const Shape shape = make_mesh(mesh);
    OK(fs_shape_build(shape.get()));
    ck_assert(!info_of(shape.get()).united);
  }
  const Shape shape = make_mesh(joined(ant()));
  ck_assert(!info_of(shape.get()).united);  // before it is built nobody knows
  OK(fs_shape_build(shape.get()));
  ck_assert(info_of(shape.get()).united);
}
END_TEST

// Parts that cross so often that their union would take too long: the mesh is felt as it is, and says so.
START_TEST(parts_that_cross_too_often) {
  Random random(1);
  std::vector<MeshData> parts;
  for (int i = 0; i < 60; ++i) parts.push_back(moved(box_mesh({0.03, 0.03, 0.03}), random.pose(0.002)));
  const Shape shape = make_mesh(joined(parts));
  OK(fs_shape_build(shape.get()));
  ck_assert(info_of(shape.get()).built && info_of(shape.get()).closed && !info_of(shape.get()).united);
  const fs_vec3 x{0.2, 0, 0};
  const double felt = norm(seen(joined(parts), {x})[0].front);
  double nearest = 1;
  for (const MeshData& part : parts) nearest = std::min(nearest, norm(seen(part, {x})[0].front));
  EXPECT_NEAR(felt, nearest, 1e-12);
}
END_TEST

// ------------------------------------------------------------------------------------------------------------- content

using Content128 = std::array<uint64_t, 2>;
static Content128 content_of(const Shape& shape) {
  const fs_shape_info info = info_of(shape.get());
  return {info.content[0], info.content[1]};
}
static void expect_content(const Shape& shape, const Content128& wanted) {
  const Content128 content = content_of(shape);
  ck_assert_msg(content == wanted, "0x%016lx, 0x%016lx", static_cast<unsigned long>(content[0]),
                static_cast<unsigned long>(content[1]));
}
static const fs_vec3 corners[]{{1, 2, 3}, {-1, 5, 3}, {0, 0, 9}};
static const MeshData tetrahedron{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0.1}}, {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}};

// The numbers were worked out by another program, as the comments in lib/base/hash.h and lib/shape/shape.cpp say. They must never
// change: others store them.
START_TEST(content_is_the_same_for_ever) {
  expect_content(make_polyline(corners, 3, false), {0x6d9d13862ff692ea, 0x76a7293a27f92885});
  expect_content(make_polyline(corners, 3, true), {0x4555c91bda74b50c, 0xd7d2c61b3af39a09});
  expect_content(make_mesh(tetrahedron), {0x40bfffd1132a4743, 0x11f983cad4ff2007});
  const MeshData triangle{{{0, 0, 0}, {1, 0, 0}, {0, 1, -0.0}}, {0, 1, 2}};
  const Shape shape = make_mesh(triangle);
  expect_content(shape, {0x917e16eb8f2eeac1, 0x30e18b130efc99e8});
  OK(fs_shape_build(shape.get()));  // what is worked out does not count
  expect_content(shape, {0x917e16eb8f2eeac1, 0x30e18b130efc99e8});
}
END_TEST

START_TEST(other_content) {  // each bit counts
  std::set<Content128> found;
  std::set<uint64_t> halves[2];
  size_t count = 0;
  const auto add = [&](const Shape& shape) {
    const Content128 content = content_of(shape);
    ++count;
    found.insert(content);
    for (int k = 0; k < 2; ++k) halves[k].insert(content[k]);
    ck_assert_msg(found.size() == count && halves[0].size() == count && halves[1].size() == count, "shape %zu", count);
  };
  const MeshData torus = torus_mesh(0.05, 0.02, 300);
  add(make_mesh(torus));
  expect_content(make_mesh(torus), content_of(make_mesh(torus)));
  for (size_t i = 0; i < torus.points.size(); ++i) {
    for (uint64_t bit = 0; bit < 64; ++bit) {
      if (bit == 62) continue;  // such a coordinate would be too large
      MeshData other = torus;
      double& x = (&other.points[i].x)[bit % 3];
      x = std::bit_cast<double>(std::bit_cast<uint64_t>(x) ^ uint64_t{1} << bit);
      add(make_mesh(other));
    }
  }
  for (size_t i = 0; i < torus.triangles.size(); ++i) {
    for (uint32_t bit = 1; bit < 256; bit *= 2) {
      MeshData other = torus;
      other.triangles[i] ^= bit;
      if (other.triangles[i] < torus.points.size()) add(make_mesh(other));
    }
  }
  MeshData negative = torus, turned = torus, more = torus;
  negative.points.push_back({-0.0, 0, 0});
  more.points.push_back({0, 0, 0});
  std::rotate(turned.triangles.begin(), turned.triangles.begin() + 1, turned.triangles.begin() + 3);
  for (const MeshData& mesh : {negative, more, turned}) add(make_mesh(mesh));
  more.points.push_back({0, 0, 0});
  add(make_mesh(more));
  for (const bool closed : {false, true}) {
    for (size_t n = 2; n <= torus.points.size(); ++n) add(make_polyline(torus.points.data(), n, closed));
  }
}
END_TEST

START_TEST(content_is_for_those_who_know_it) {
  const Shape shape = make_mesh(tetrahedron);
  fs_shape_info info = fs_shape_info_init();
  info.struct_size = offsetof(fs_shape_info, content);
  info.content[0] = info.content[1] = 7;
  OK(fs_shape_get_info(shape.get(), &info));
  ck_assert(info.content[0] == 7 && info.content[1] == 7 && info.lower.x == 0 && info.upper.x == 1);
  info.struct_size = 8;
  EXPECT(FS_ERROR_INVALID, fs_shape_get_info(shape.get(), &info));
}
END_TEST

START_TEST(content_in_several_threads) {
  for (int k = 0; k < times(20, 100); ++k) {
    const Shape shape = make_mesh(torus_mesh(0.05, 0.02, 3000));
    const Content128 wanted = content_of(make_mesh(torus_mesh(0.05, 0.02, 3000)));
    std::atomic<int> good{0};
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&] {
        fs_shape_info info = fs_shape_info_init();
        const fs_status status = fs_shape_get_info(shape.get(), &info);
        good += status == FS_OK && info.content[0] == wanted[0] && info.content[1] == wanted[1];
      });
    }
    for (std::thread& thread : threads) thread.join();
    ck_assert_int_eq(good, 4);
  }
}
END_TEST

int main() {
  Suite* suite = suite_create("shape");
  add_case(suite, "shapes", {polylines, meshes, another_mesh_is_felt_at_once, edges_of_meshes, shape_references,
                             progress_of_a_build,
                            a_build_needs_no_other_thread, scenes_of_the_tests});
  add_case(suite, "races", {content_in_several_threads});
  if (seeks_races) return run_suite(suite);
  add_case(suite, "content", {content_is_the_same_for_ever, other_content, content_is_for_those_who_know_it});
  add_case(suite, "parts", {parts_that_cross_are_one_body, parts_that_keep_apart, parts_that_cross_too_often});
  add_case(suite, "curves", {tables, expressions});
  add_case(suite, "files", {mesh_files, faces_that_are_not_convex, bad_mesh_files});
  return run_suite(suite);
}
