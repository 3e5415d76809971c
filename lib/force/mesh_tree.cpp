#include "force/mesh_tree.h"

#include <sys/mman.h>

#include <cmath>

#include "base/processor.h"
#include "force/wide_search.h"

namespace fs {
namespace {

using namespace wide;

// What a packet says about its triangles as seen from a point. A triangle may be at a distance d of the point (local units)
// only if its squared distance is at most (d * per_unit + slack)^2.
struct Estimate {
  Floats squared;   // in steps
  float slack;      // in steps
  float per_unit;   // 0: nothing is known
  uint32_t filled;  // bit i: there is a triangle in lane i

  // Bit i: triangle i may be within a distance (local units).
  FS_INLINE uint32_t within(double distance) const {
    const double steps = distance * per_unit * (1 + 1e-6) + slack;
    if (!(steps < 1e15)) return filled;
    const auto most = static_cast<float>(steps);
    return bits(squared <= all(most * most)) & filled;
  }
};

FS_INLINE Floats squared_to_segment(Floats ex, Floats ey, Floats ez, Floats length, Floats x, Floats y, Floats z) {
  Floats t = (x * ex + y * ey + z * ez) / most(length, all(1));
  t = least(most(t, all(0)), all(1));
  x -= t * ex;
  y -= t * ey;
  z -= t * ez;
  return x * x + y * y + z * z;
}

FS_INLINE Estimate estimate_of(const Packet& packet, Vec3 from) {
  Ints id;
  std::memcpy(&id, packet.triangle, sizeof id);
  Estimate out{{}, 0, packet.per_unit, bits(id != -1)};
  const double per_unit = packet.per_unit;
  const double u = (from.x - packet.lower[0]) * per_unit, v = (from.y - packet.lower[1]) * per_unit,
               w = (from.z - packet.lower[2]) * per_unit;
  const double largest = std::max(std::max(std::fabs(u), std::fabs(v)), std::fabs(w));
  if (!(largest < 1e9)) {  // far away all of them are one point
    out.per_unit = 0;
    return out;
  }
  const Floats x = all(static_cast<float>(u)), y = all(static_cast<float>(v)), z = all(static_cast<float>(w));
  const Ints a = load(packet.corners[0]), b = load(packet.corners[1]), c = load(packet.corners[2]);
  const Floats a_x = field(a, 0, 10), a_y = field(a, 10, 10), a_z = field(a, 20, 10);
  const Floats b_x = field(b, 0, 10), b_y = field(b, 10, 10), b_z = field(b, 20, 10);
  const Floats c_x = field(c, 0, 10), c_y = field(c, 10, 10), c_z = field(c, 20, 10);
  const Floats ab_x = b_x - a_x, ab_y = b_y - a_y, ab_z = b_z - a_z;
  const Floats bc_x = c_x - b_x, bc_y = c_y - b_y, bc_z = c_z - b_z;
  const Floats ca_x = a_x - c_x, ca_y = a_y - c_y, ca_z = a_z - c_z;
  const Floats ax = x - a_x, ay = y - a_y, az = z - a_z;
  const Floats bx = x - b_x, by = y - b_y, bz = z - b_z;
  const Floats cx = x - c_x, cy = y - c_y, cz = z - c_z;
  const Floats ab = ab_x * ab_x + ab_y * ab_y + ab_z * ab_z;
  const Floats bc = bc_x * bc_x + bc_y * bc_y + bc_z * bc_z;
  const Floats ca = ca_x * ca_x + ca_y * ca_y + ca_z * ca_z;

  const Floats edges = least(least(squared_to_segment(ab_x, ab_y, ab_z, ab, ax, ay, az),
                                   squared_to_segment(bc_x, bc_y, bc_z, bc, bx, by, bz)),
                             squared_to_segment(ca_x, ca_y, ca_z, ca, cx, cy, cz));
  // The normal, twice the area long and exact, as the corners are small integers; the planes through the edges along it tell
  // whether the point is over the triangle.
  const Floats n_x = ab_z * ca_y - ab_y * ca_z, n_y = ab_x * ca_z - ab_z * ca_x, n_z = ab_y * ca_x - ab_x * ca_y;
  const Floats n = n_x * n_x + n_y * n_y + n_z * n_z;
  const auto inside = [&](Floats ex, Floats ey, Floats ez, Floats px, Floats py, Floats pz) __attribute__((always_inline)) {
    return (ey * pz - ez * py) * n_x + (ez * px - ex * pz) * n_y + (ex * py - ey * px) * n_z >= all(0);
  };
  const Ints is_over = inside(ab_x, ab_y, ab_z, ax, ay, az) & inside(bc_x, bc_y, bc_z, bx, by, bz) &
                       inside(ca_x, ca_y, ca_z, cx, cy, cz);
  const Floats height = ax * n_x + ay * n_y + az * n_z;
  out.squared = is_over & (n > all(0)) ? height / most(n, all(1)) * height : edges;
  // A corner stands up to 0.87 steps beside its place, and the distance is rounded.
  out.slack = static_cast<float>(0.9 + 4e-6 * (largest + Packet::most_steps));
  return out;
}

// Asks the system to keep memory that is in use already in large pages, as far as it likes: a search that meets empty caches
// then waits less for addresses.
void use_large_pages(const void* memory, size_t bytes) {
#ifdef MADV_COLLAPSE
  constexpr int collapse = MADV_COLLAPSE;
#else
  constexpr int collapse = 25;  // Linux 6.1; an older one refuses it
#endif
  constexpr uintptr_t large = 1 << 21;
  const uintptr_t at = reinterpret_cast<uintptr_t>(memory);
  const uintptr_t begin = (at + large - 1) / large * large, end = (at + bytes) / large * large;
  if (begin < end) madvise(reinterpret_cast<void*>(begin), end - begin, collapse);
}
template <class T>
void use_large_pages(std::span<const T> items) {
  use_large_pages(items.data(), items.size_bytes());
}

LocalFrame frame_of(std::span<const Vec3> points, std::span<const uint32_t> corners, Wanted& wanted) {
  wanted.begin_part(0.01, static_cast<double>(corners.size()));
  Box box;
  for (const uint32_t i : corners) {
    wanted.step();
    box.add(points[i]);
  }
  return LocalFrame(box);
}

std::vector<Box> boxes_of(std::span<const Vec3> points, std::span<const uint32_t> corners, const LocalFrame& frame,
                          Wanted& wanted) {
  wanted.begin_part(0.11, 1.35 * static_cast<double>(corners.size()));  // with the start of the tree
  std::vector<Box> boxes(corners.size() / 3);
  for (size_t i = 0; i < corners.size(); ++i) {
    wanted.step();
    boxes[i / 3].add(frame.local(points[corners[i]]));
  }
  return boxes;
}


// A box in the local frame, rounded outwards as far as single precision asks for.
struct Span {
  double lower[3], upper[3];

  Span(Vec3 a, Vec3 b) {
    const double p[3] = {a.x, a.y, a.z}, q[3] = {b.x, b.y, b.z};
    for (int k = 0; k < 3; ++k) {
      const double margin = 1e-6 * (std::fabs(p[k]) + std::fabs(q[k])) + 1e-12;
      lower[k] = std::min(p[k], q[k]) - margin;
      upper[k] = std::max(p[k], q[k]) + margin;
    }
  }
};

// Bit i: the box of child i meets the span.
FS_INLINE uint32_t children_in(const WideTree::Node& node, const Span& span) {
  const Ints low = load(node.lower), high = load(node.upper);
  const float per_step = 1 / node.step;
  Ints meets = {-1, -1, -1, -1, -1, -1, -1, -1};
  for (int k = 0; k < 3; ++k) {
    // Within what a byte can say, so that nothing large is rounded.
    const double lower = (span.lower[k] - node.origin[k]) * per_step, upper = (span.upper[k] - node.origin[k]) * per_step;
    meets &= (field(low, 8 * k, 8) <= all(static_cast<float>(std::min(upper, 300.0) + 0.01))) &
             (field(high, 8 * k, 8) >= all(static_cast<float>(std::max(lower, -300.0) - 0.01)));
  }
  return bits(meets) & node.filled;
}

// Bit i: the box of triangle i may meet the span.
FS_INLINE uint32_t triangles_in(const Packet& packet, const Span& span) {
  Ints id;
  std::memcpy(&id, packet.triangle, sizeof id);
  Ints meets = id != -1;
  if (packet.per_unit > 0) {
    const Ints a = load(packet.corners[0]), b = load(packet.corners[1]), c = load(packet.corners[2]);
    for (int k = 0; k < 3; ++k) {
      const Floats x = field(a, 10 * k, 10), y = field(b, 10 * k, 10), z = field(c, 10 * k, 10);
      const double lower = (span.lower[k] - packet.lower[k]) * packet.per_unit,
                   upper = (span.upper[k] - packet.lower[k]) * packet.per_unit;
      meets &= (least(least(x, y), z) <= all(static_cast<float>(std::min(upper, 2000.0) + 1))) &
               (most(most(x, y), z) >= all(static_cast<float>(std::max(lower, -2000.0) - 1)));
    }
  }
  return bits(meets);
}

}  // namespace

MeshTree::MeshTree(std::span<const Vec3> points, std::span<const uint32_t> corners, std::unique_ptr<MeshEdges> edges,
                   Wanted& wanted)
    : points_(points),
      corners_(corners),
      frame_(frame_of(points, corners, wanted)),
      tree_(boxes_of(points, corners, frame_, wanted), wanted),
      normals_(points, corners, std::move(edges), wanted) {
  wanted.begin_part(1, 3 * static_cast<double>(tree_.leaves().size()));
  std::vector<Vec3> places;  // of the corners, in the order of the leaves
  places.reserve(corners.size());
  for (const uint32_t triangle : tree_.items()) {
    wanted.step();
    for (int k = 0; k < 3; ++k) places.push_back(frame_.local(points[corners[size_t{3} * triangle + k]]));
  }
  tree_.add_discs(places, wanted);
  packets_.reserve(tree_.leaves().size());
  for (const WideTree::Leaf leaf : tree_.leaves()) {
    wanted.step();
    packets_.emplace_back(tree_.items().data() + leaf.begin, places.data() + size_t{3} * leaf.begin, leaf.end - leaf.begin);
  }
  tree_.forget_items();
  use_large_pages(points_);
  use_large_pages(corners_);
  use_large_pages(std::span<const Packet>(packets_));
  tree_.for_each_array([](const void* memory, size_t bytes) { use_large_pages(memory, bytes); });
}

// In the tests of a leaf a packet nominates, and the exact test of a triangle decides. The bound of the search is a square
// in local units and slightly enlarged; the exact comparison is that of squares in metres.
template <class From>
FS_INLINE MeshTree::Found MeshTree::find_from(const Query& query) const noexcept {
  const Vec3 x = query.x;
  Found out;
  Nearest& best = out.nearest;
  double most = query.range * query.range * (1 + 1e-15) + std::numeric_limits<double>::min();  // m^2
  const auto take = [&](uint32_t triangle) __attribute__((always_inline)) {
    const Nearest here = nearest_on(triangle, x);
    if (here.squared > most || (here.squared == best.squared && triangle > out.triangle)) return;
    best = here;
    out.triangle = triangle;
    most = here.squared;
  };
  const double scale = frame_.scale;
  const auto local = [&](double squared) __attribute__((always_inline)) { return squared * scale * scale; };
  if (query.hint < corners_.size() / 3) take(query.hint);
  const Vec3 at = frame_.local(x);
  const From from{at};
  uint32_t visits = query.visits;
  const auto test = [&](uint32_t leaf, typename From::Real& bound) __attribute__((always_inline)) {
    const Packet& packet = packets_[leaf];
    const Estimate estimate = estimate_of(packet, at);
    float squared[Packet::width];
    store(squared, estimate.squared);
    uint32_t rest = estimate.within(std::sqrt(local(most)));
    while (rest) {
      // The one that looks nearest first: then the others mostly fall away.
      uint32_t first = static_cast<uint32_t>(std::countr_zero(rest));
      for (uint32_t others = rest & (rest - 1); others; others &= others - 1) {
        const auto i = static_cast<uint32_t>(std::countr_zero(others));
        if (squared[i] < squared[first]) first = i;
      }
      rest &= ~(1u << first);
      const double before = most;
      if (packet.triangle[first] != query.hint) {
        take(packet.triangle[first]);
        if (visits > 0) --visits;
      }
      if (most < before) {
        bound = rounded_up<From>(local(most));
        if (rest) rest &= estimate.within(std::sqrt(local(most)));
      }
    }
  };
  const auto expect = [&](uint32_t leaf) __attribute__((always_inline)) { prefetch(packets_.data() + leaf); };
  const double unseen = search(tree_, from, rounded_up<From>(local(most)), visits, test, expect);
  const double distance = std::sqrt(best.squared);
  if (!(distance <= query.range)) out.triangle = no_triangle;
  out.least = std::min(std::min(distance, query.range), std::sqrt(unseen) / scale);
  out.visits = query.visits - visits;
  out.is_cut = unseen < std::numeric_limits<double>::infinity();
  return out;
}

MeshTree::Found MeshTree::find_plain(const Query& query) const noexcept {
  return largest_coordinate(frame_.local(query.x)) < far ? find_from<Near>(query) : find_from<Far>(query);
}

#ifdef __x86_64__
__attribute__((target("avx2"))) MeshTree::Found MeshTree::find_avx2(const Query& query) const noexcept {
  return largest_coordinate(frame_.local(query.x)) < far ? find_from<Near>(query) : find_from<Far>(query);
}
#endif

MeshTree::Found MeshTree::find(const Query& query) const noexcept {
#ifdef __x86_64__
  if (has_avx2) return find_avx2(query);
#endif
  return find_plain(query);
}

// Returns the triangle, or none.
FS_INLINE uint32_t MeshTree::cross(Side side, Vec3 from, Vec3 to, double& part) const noexcept {
  const Vec3 start = frame_.local(from), way = frame_.local(to) - start;
  uint32_t out = no_triangle;
  part = std::numeric_limits<double>::infinity();
  Span span(start, start + way);
  uint32_t stack[WideTree::most_depth * (WideTree::width - 1) + 1];
  uint32_t size = 0;
  stack[size++] = tree_.nodes() ? WideTree::root : WideTree::leaf_bit;
  while (size > 0) {
    const uint32_t child = stack[--size];
    if (!(child & WideTree::leaf_bit)) {
      const WideTree::Node& node = tree_.nodes()[child];
      for (uint32_t near = children_in(node, span); near; near &= near - 1) {
        stack[size++] = node.child[std::countr_zero(near)];
      }
      continue;
    }
    const Packet& packet = packets_[child & ~WideTree::leaf_bit];
    for (uint32_t near = triangles_in(packet, span); near; near &= near - 1) {
      const uint32_t triangle = packet.triangle[std::countr_zero(near)];
      const uint32_t* v = corners_.data() + size_t{3} * triangle;
      double here;
      if (!crosses_triangle(points_[v[0]], points_[v[1]], points_[v[2]], side, from, to, here)) continue;
      if (here > part || (here == part && triangle > out)) continue;
      part = here;
      out = triangle;
      span = Span(start, start + part * way);
    }
  }
  return out;
}

#ifdef __x86_64__
__attribute__((target("avx2"))) uint32_t MeshTree::cross_avx2(Side side, Vec3 from, Vec3 to, double& part) const noexcept {
  return cross(side, from, to, part);
}
#endif

bool MeshTree::first_crossing(Side side, Vec3 from, Vec3 to, Crossing& out) const noexcept {
  double part;
#ifdef __x86_64__
  const uint32_t triangle = has_avx2 ? cross_avx2(side, from, to, part) : cross(side, from, to, part);
#else
  const uint32_t triangle = cross(side, from, to, part);
#endif
  if (triangle == no_triangle) return false;
  out.part = part;
  out.point = from + part * (to - from);
  out.triangle = triangle;
  out.normal = normals_.face(triangle);
  if (side == Side::back) out.normal = -out.normal;
  if (out.normal == Vec3{}) out.normal = normalized(from - to);  // its area is only rounding error
  return true;
}

Closest MeshTree::tell(Vec3 x, const Found& found) const noexcept {
  const Nearest& nearest = found.nearest;
  const uint32_t* v = corners_.data() + size_t{3} * found.triangle;
  const Vec3 corners[3] = {points_[v[0]], points_[v[1]], points_[v[2]]};
  const int part = static_cast<int>(nearest.part);
  const bool on_edge = nearest.part == Part::edge_ab || nearest.part == Part::edge_bc || nearest.part == Part::edge_ca;
  Pseudonormals::Normal normal{{}, true};
  if (on_edge) {
    normal = normals_.side(found.triangle, part - 1);
  } else if (nearest.part != Part::face) {
    normal = normals_.corner(found.triangle, part - static_cast<int>(Part::corner_a));
  }
  if (normal.is_flat) {
    const Vec3 face = normals_.face(found.triangle);
    const bool has_face = !(face == Vec3{0, 0, 0});
    // A point "inside" a triangle without area counts as on its first edge; any edge would do.
    if (!has_face && nearest.part == Part::face) normal = normals_.side(found.triangle, 0);
    if (has_face) normal.vector = face;
  }
  const bool on_face = normal.is_flat;

  Closest hit;
  hit.point = x + nearest.offset;
  hit.triangle = found.triangle;
  if (on_face) {
    hit.feature = Feature::face;
  } else if (on_edge) {
    hit.feature = Feature::edge;
    hit.tangent = normalized(corners[part % 3] - corners[part - 1]);
  } else {
    hit.feature = Feature::vertex;
  }
  double largest = largest_coordinate(x);
  for (const Vec3& corner : corners) largest = std::max(largest, largest_coordinate(corner));
  hit.distance = std::sqrt(nearest.squared);
  if (hit.distance <= coordinate_rounding(largest)) {
    hit.distance = 0;
    hit.direction = normal.vector;
  } else {
    hit.side = dot(nearest.offset, normal.vector) <= 0 ? Side::front : Side::back;
    // At a tiny distance the offset is mostly rounding error; on a face the normal is exact.
    if (!on_face) {
      hit.direction = normalized(-nearest.offset);
    } else {
      hit.direction = hit.side == Side::front ? normal.vector : -normal.vector;
    }
  }
  return hit;
}

size_t MeshTree::size() const noexcept {
  return tree_.size() + packets_.size() * sizeof(Packet) + normals_.size();
}

}  // namespace fs
