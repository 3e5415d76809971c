// Ways to find the closest point of a mesh: those of this library, and what others offer.
#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "meshes.h"
#include "shape/shape.h"

namespace bench {

struct Answer {
  double distance = std::numeric_limits<double>::infinity();  // m; infinite: nothing is within range
  fs::Vec3 offset{};                                          // m, from the asked point to the closest one
};

class Method {
 public:
  virtual ~Method() = default;
  // A method may remember its last answer to be faster with a place beside the last one.
  virtual Answer closest(fs::Vec3 x) = 0;
  virtual void forget() {}

  std::string name;
  double bytes = 0;         // beside the mesh's own points and corners in doubles
  double build_time = 0;    // s
};
using Methods = std::vector<std::unique_ptr<Method>>;

inline constexpr double felt_range = 0.02;  // m, of the method that is told a range

// The mesh as a shape of the library, with its tree built. tree_time: s, what that took.
fs::Ref<const fs::Shape> shape_of(const Mesh& mesh, double* tree_time = nullptr);

// These look at the mesh as long as they live.
std::unique_ptr<Method> brute_force(const Mesh& mesh);
std::unique_ptr<Method> ours_cold(const fs::Shape& shape);
std::unique_ptr<Method> ours_warm(const fs::Shape& shape);   // told the last triangle
std::unique_ptr<Method> ours_felt(const fs::Shape& shape, double range = felt_range);  // warm, with a range and the skip: what
                                                                                        // a servo asks
std::unique_ptr<Method> embree_exact(const Mesh& mesh);      // warm radius; the triangles are tested in doubles
std::unique_ptr<Method> embree_single(const Mesh& mesh);     // warm radius; all in single precision
std::unique_ptr<Method> cgal(const Mesh& mesh);              // told the last point; null: built without CGAL
// Another library, from a shared library that has the functions of peer.h. Ends the program if it cannot be used.
std::unique_ptr<Method> peer(const Mesh& mesh, const char* file);

double heap_bytes();                     // that this process has allocated
double seconds_now();
// Ends when the caches of the processor hold nothing of what this process has in memory.
void evict_caches();

}  // namespace bench
