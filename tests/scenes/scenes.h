// Scenes by name, as data, for tests and benchmarks. Only the C functions are used here.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "scenes/handles.h"
#include "scenes/random.h"

namespace scenes {

// The function of a curve, f(d, t) in N, so that the reference needs no curve of the library.
using Function = std::function<long double(long double d, long double t)>;

// The force-objects of a scene, and the handles that they use.
struct Content {
  std::vector<fs_object> objects;
  std::vector<Shape> shapes;
  std::vector<Curve> curves;
  std::map<const fs_curve*, Function> functions;  // of all curves

  fs_object& add(const std::string& name, fs_primitive primitive, fs_vec3 position = {});
  fs_object& add_shape(const std::string& name, Shape shape, fs_vec3 position = {});  // polyline or mesh
  fs_curve* keep(Curve curve, Function function);
};
void fill(fs_scene* scene, const Content& content);  // with fs_object_set, as one group

// The triangles and points of a mesh before it becomes a shape.
struct MeshData {
  std::vector<fs_vec3> points;
  std::vector<uint32_t> triangles;
};
// Meshes of about `triangles` triangles, which are counter-clockwise as seen from outside; the terrain is open, its
// triangles are counter-clockwise as seen from above.
MeshData sphere_mesh(double radius, size_t triangles);
MeshData torus_mesh(double radius, double tube_radius, size_t triangles);
MeshData terrain_mesh(double half_width, double height, size_t triangles);
MeshData box_mesh(fs_vec3 half_size);
MeshData soup_mesh(Random& random, double half, size_t triangles);  // loose triangles that intersect each other
MeshData moved(MeshData mesh, const fs_pose& pose);
MeshData split_corners(const MeshData& mesh);  // each triangle has three points of its own, as in an export for flat shading
Shape make_mesh(const MeshData& mesh);
std::vector<fs_vec3> helix(double radius, double height, double turns, size_t points);

fs_profile attract(double stiffness, double limit);  // linear increasing
fs_profile constant(fs_sense sense, double force);
std::vector<fs_profile> all_profiles(Content& content, fs_sense sense, double limit);  // one of each kind, 10 mm wide

// Named scenes. All but `crowd` fit into a workspace of 100 mm about the origin.
Content hello();                          // one point that draws the hand
Content profiles();                       // every primitive with every kind of profile, on a grid
Content path();                           // a curved line that guides
Content ball(size_t triangles);           // a mesh pushes out of itself: sphere, torus or terrain
Content ring(size_t triangles);
Content ground(size_t triangles);
Content moving(double time);              // one object of each primitive, each with a twist, poses at `time` (s)
Content crowd(size_t count);              // points in a cube, each felt within 5 mm: few at a time
Content testbed();                        // after the paper: ground, obstacles, a path, a goal and the reach of an arm
struct Named {
  const char* name;
  Content (*build)();
};
const std::vector<Named>& all_scenes();   // of moderate size

struct RandomOptions {
  size_t count = 6;
  double half = 0.1;                      // m: objects in a cube of this half-size
  size_t mesh_triangles = 200;            // 0: no meshes
  double time = 100;                      // s, about when they are evaluated
  bool moves = false, damps = false, masks = false, disables = false;
};
Content random_content(Random& random, const RandomOptions& options);
fs_profile random_profile(Random& random, Content& content);

bool has_expressions();                   // whether the library was built with them
// A monotone cubic through f(0), f(step)... with the slopes of Fritsch & Butland (1984), and three-point slopes at the
// ends.
Function monotone_cubic(std::vector<double> forces, double step);

}  // namespace scenes
