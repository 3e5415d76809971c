#include "closest_methods.h"

#include <dlfcn.h>
#include <emmintrin.h>
#include <malloc.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "peer.h"
#include "shape/mesh/mesh_tree.h"
#include "shape/primitive.h"

namespace bench {
namespace {

using namespace fs;
constexpr double infinity = std::numeric_limits<double>::infinity();

Nearest nearest_of(const Mesh& mesh, size_t triangle, Vec3 x) {
  const uint32_t* v = mesh.corners.data() + 3 * triangle;
  return nearest_on_triangle(mesh.points[v[0]] - x, mesh.points[v[1]] - x, mesh.points[v[2]] - x);
}

struct BruteForce : Method {
  const Mesh& mesh;
  explicit BruteForce(const Mesh& m) : mesh(m) { name = "brute force"; }
  Answer closest(Vec3 x) override {
    Nearest best;
    for (size_t i = 0; i < mesh.count(); ++i) {
      const Nearest here = nearest_of(mesh, i, x);
      if (here.squared < best.squared) best = here;
    }
    return {std::sqrt(best.squared), best.offset};
  }
};

struct Cold : Method {
  const MeshTree& tree;
  explicit Cold(const Shape& shape) : tree(*shape.tree()) {
    name = "ours, cold";
    bytes = static_cast<double>(tree.size());
  }
  Answer closest(Vec3 x) override {
    const MeshTree::Found found = tree.find({x, infinity});
    return {std::sqrt(found.nearest.squared), found.nearest.offset};
  }
};

struct Warm : Method {
  const MeshTree& tree;
  uint32_t hint = MeshTree::no_triangle;
  explicit Warm(const Shape& shape) : tree(*shape.tree()) {
    name = "ours, warm";
    bytes = static_cast<double>(tree.size());
  }
  Answer closest(Vec3 x) override {
    const MeshTree::Found found = tree.find({x, infinity, hint});
    hint = found.triangle;
    return {std::sqrt(found.nearest.squared), found.nearest.offset};
  }
  void forget() override { hint = MeshTree::no_triangle; }
};

struct Felt : Method {
  const Shape& shape;
  Hint hint;
  double range;  // m
  Felt(const Shape& s, double the_range) : shape(s), range(the_range) {
    name = "ours, warm, range and skip";
    bytes = static_cast<double>(s.tree()->size());
  }
  Answer closest(Vec3 x) override {
    Closest out;
    if (!closest_point(FS_PRIMITIVE_MESH, &shape, x, range, out, &hint)) return {};
    return {out.distance, out.point - x};
  }
  void forget() override { hint = {}; }
};

// The last distance and the way since then bound the next distance.
class WarmRadius {
 public:
  double bound(Vec3 x) const { return last_ + norm(x - from_) * 1.0001 + 1e-9; }
  void set(Vec3 x, double distance) {
    from_ = x;
    last_ = distance;
  }
  void forget() { last_ = infinity; }

 private:
  double last_ = infinity;
  Vec3 from_{};
};

bool count_bytes(void* bytes, ssize_t change, bool) {
  *static_cast<double*>(bytes) += static_cast<double>(change);
  return true;
}

// Embree has its tree of boxes in single precision; the function that tests a triangle is the caller's.
class EmbreeScene : public Method {
 public:
  EmbreeScene(const Mesh& mesh, RTCPointQueryFunction test) : mesh_(mesh) {
    rtcSetDeviceMemoryMonitorFunction(device_, count_bytes, &bytes);
    scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    corners_ = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12,
                                                           mesh.points.size()));
    for (size_t i = 0; i < mesh.points.size(); ++i) {
      corners_[3 * i] = static_cast<float>(mesh.points[i].x);
      corners_[3 * i + 1] = static_cast<float>(mesh.points[i].y);
      corners_[3 * i + 2] = static_cast<float>(mesh.points[i].z);
    }
    void* const indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, mesh.count());
    std::memcpy(indices, mesh.corners.data(), sizeof(uint32_t) * mesh.corners.size());
    rtcSetGeometryPointQueryFunction(geometry, test);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
  }
  ~EmbreeScene() override {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  void forget() override { radius_.forget(); }

  Answer closest(Vec3 x) override {
    RTCPointQuery query{static_cast<float>(x.x), static_cast<float>(x.y), static_cast<float>(x.z), 0,
                        static_cast<float>(radius_.bound(x) * 1.000001)};
    asked_ = x;
    best_ = {};
    RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    rtcPointQuery(scene_, &query, &context, nullptr, this);
    const double distance = std::sqrt(best_.squared);
    radius_.set(x, distance);
    return {distance, best_.offset};
  }

  static bool test_exactly(RTCPointQueryFunctionArguments* arguments) {
    auto& me = *static_cast<EmbreeScene*>(arguments->userPtr);
    const Nearest here = nearest_of(me.mesh_, arguments->primID, me.asked_);
    if (!(here.squared < me.best_.squared)) return false;
    me.best_ = here;
    arguments->query->radius = static_cast<float>(std::sqrt(here.squared) * 1.000001);
    return true;
  }
  static bool test_singly(RTCPointQueryFunctionArguments* arguments);

 protected:
  const Mesh& mesh_;
  const RTCDevice device_ = rtcNewDevice("threads=1");
  RTCScene scene_;
  const float* corners() const { return corners_; }

 private:
  float* corners_;
  Vec3 asked_{};
  Nearest best_;
  WarmRadius radius_;
};

struct Single3 {
  float x, y, z;
};
Single3 operator-(Single3 a, Single3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Single3 operator+(Single3 a, Single3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Single3 operator*(float s, Single3 a) { return {s * a.x, s * a.y, s * a.z}; }
float dot(Single3 a, Single3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// After Ericson, "Real-Time Collision Detection" (2005), 5.1.5: by the regions of the plane about the triangle.
Single3 closest_singly(Single3 p, Single3 a, Single3 b, Single3 c) {
  const Single3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const float d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d1 <= 0 && d2 <= 0) return a;
  if (d3 >= 0 && d4 <= d3) return b;
  if (d6 >= 0 && d5 <= d6) return c;
  const float vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const float sum = 1 / (va + vb + vc);
  return a + vb * sum * ab + vc * sum * ac;
}

bool EmbreeScene::test_singly(RTCPointQueryFunctionArguments* arguments) {
  auto& me = *static_cast<EmbreeScene*>(arguments->userPtr);
  const uint32_t* v = me.mesh_.corners.data() + size_t{3} * arguments->primID;
  const auto at = [&](int k) {
    const float* f = me.corners_ + size_t{3} * v[k];
    return Single3{f[0], f[1], f[2]};
  };
  const Single3 x{arguments->query->x, arguments->query->y, arguments->query->z};
  const Single3 offset = closest_singly(x, at(0), at(1), at(2)) - x;
  const float squared = dot(offset, offset);
  if (!(squared < me.best_.squared)) return false;
  me.best_.squared = squared;
  me.best_.offset = {offset.x, offset.y, offset.z};
  arguments->query->radius = std::sqrt(squared);
  return true;
}

class Peer : public Method {
 public:
  Peer(const Mesh& mesh, const char* file) : library_(dlopen(file, RTLD_NOW | RTLD_LOCAL)) {
    if (!library_) {
      std::fprintf(stderr, "%s\n", dlerror());
      std::exit(1);
    }
    const auto build = function<decltype(peer_build)>("peer_build");
    name = function<decltype(peer_name)>("peer_name")();
    closest_ = function<decltype(peer_closest)>("peer_closest");
    destroy_ = function<decltype(peer_destroy)>("peer_destroy");
    peer_ = build(&mesh.points[0].x, mesh.points.size(), mesh.corners.data(), mesh.count());
  }
  ~Peer() override { destroy_(peer_); }
  void forget() override { radius_.forget(); }
  Answer closest(Vec3 x) override {
    Answer out;
    out.distance = closest_(peer_, &x.x, radius_.bound(x), &out.offset.x);
    radius_.set(x, out.distance * (1 + 1e-6));  // it may work in single precision
    return out;
  }

 private:
  template <class F>
  F* function(const char* symbol) const {
    void* const found = dlsym(library_, symbol);
    if (!found) {
      std::fprintf(stderr, "%s\n", dlerror());
      std::exit(1);
    }
    return reinterpret_cast<F*>(found);
  }
  void* const library_;
  void* peer_;
  decltype(&peer_closest) closest_;
  decltype(&peer_destroy) destroy_;
  WarmRadius radius_;
};

// Makes a method and notes the time and, unless it counts them itself, the bytes.
template <class M, class... Arguments>
std::unique_ptr<Method> built(Arguments&&... arguments) {
  const double before = heap_bytes(), start = seconds_now();
  auto out = std::make_unique<M>(std::forward<Arguments>(arguments)...);
  out->build_time = seconds_now() - start;
  if (out->bytes == 0) out->bytes = heap_bytes() - before;
  return out;
}

}  // namespace

double heap_bytes() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd);
}

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

fs::Ref<const fs::Shape> shape_of(const Mesh& mesh, double* tree_time) {
  auto shape = fs::make_mesh(mesh.points.data(), mesh.points.size(), mesh.corners.data(), mesh.count());
  const double start = seconds_now();
  shape->build();
  if (tree_time) *tree_time = seconds_now() - start;
  return shape;
}

std::unique_ptr<Method> brute_force(const Mesh& mesh) { return std::make_unique<BruteForce>(mesh); }
std::unique_ptr<Method> ours_cold(const fs::Shape& shape) { return std::make_unique<Cold>(shape); }
std::unique_ptr<Method> ours_warm(const fs::Shape& shape) { return std::make_unique<Warm>(shape); }
std::unique_ptr<Method> ours_felt(const fs::Shape& shape, double range) {
  return std::make_unique<Felt>(shape, range);
}
std::unique_ptr<Method> embree_exact(const Mesh& mesh) {
  auto out = built<EmbreeScene>(mesh, EmbreeScene::test_exactly);
  out->name = "Embree, warm radius, exact";
  return out;
}
std::unique_ptr<Method> embree_single(const Mesh& mesh) {
  auto out = built<EmbreeScene>(mesh, EmbreeScene::test_singly);
  out->name = "Embree, warm radius, float";
  return out;
}
std::unique_ptr<Method> peer(const Mesh& mesh, const char* file) { return built<Peer>(mesh, file); }

void evict_caches() {
  std::ifstream maps("/proc/self/maps");
  std::string line;
  while (std::getline(maps, line)) {
    uintptr_t begin, end;
    unsigned long inode;
    char rights[8];
    if (std::sscanf(line.c_str(), "%lx-%lx %7s %*s %*s %lu", &begin, &end, rights, &inode) != 4) continue;
    if (std::strncmp(rights, "rw", 2) != 0 || inode != 0) continue;
    for (uintptr_t at = begin; at < end; at += 64) _mm_clflush(reinterpret_cast<const void*>(at));
  }
  _mm_mfence();
}

}  // namespace bench
