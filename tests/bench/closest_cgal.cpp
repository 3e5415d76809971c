// CGAL's tree of axis-aligned boxes, in doubles. In a file of its own as CGAL takes long to compile.
#include "closest_methods.h"

#ifdef HAS_CGAL
#include <cmath>

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>

namespace bench {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Triangles = std::vector<Kernel::Triangle_3>;
using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>>>;

class Cgal : public Method {
 public:
  explicit Cgal(const Mesh& mesh) {
    const double before = heap_bytes(), start = seconds_now();
    const auto at = [&](uint32_t i) {
      const fs::Vec3 p = mesh.points[i];
      return Kernel::Point_3(p.x, p.y, p.z);
    };
    triangles_.reserve(mesh.count());
    for (size_t i = 0; i < mesh.corners.size(); i += 3) {
      triangles_.emplace_back(at(mesh.corners[i]), at(mesh.corners[i + 1]), at(mesh.corners[i + 2]));
    }
    tree_.insert(triangles_.begin(), triangles_.end());
    tree_.do_not_accelerate_distance_queries();  // a tree of points, which is used where there is no hint
    tree_.build();
    hint_ = at(0);
    name = "CGAL, hint";
    build_time = seconds_now() - start;
    bytes = heap_bytes() - before;
  }
  Answer closest(fs::Vec3 x) override {
    hint_ = tree_.closest_point({x.x, x.y, x.z}, hint_);
    const fs::Vec3 offset{hint_.x() - x.x, hint_.y() - x.y, hint_.z() - x.z};
    return {fs::norm(offset), offset};
  }

 private:
  Triangles triangles_;
  Tree tree_;
  Kernel::Point_3 hint_;
};

}  // namespace

std::unique_ptr<Method> cgal(const Mesh& mesh) { return std::make_unique<Cgal>(mesh); }

}  // namespace bench
#else
std::unique_ptr<bench::Method> bench::cgal(const Mesh&) { return nullptr; }
#endif
