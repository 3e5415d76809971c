// The search of a MeshTree for the closest point, and what that point tells.
#include <cmath>

#include "shape/mesh/mesh_tree.h"
#include "shape/mesh/packet_triangles.h"
#include "shape/mesh/wide_search.h"

namespace fs {

using namespace wide;

// In the tests of a leaf a packet nominates, and the exact test of a triangle decides. The range of the search is a square
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
  const WideTree& tree = union_ ? union_->tree : tree_;
  const Packet* const packets = union_ ? union_->packets.data() : packets_.data();
  if (is_item(query.hint)) take(query.hint);
  const Vec3 at = frame_.local(x);
  const From from{at};
  uint32_t visits = query.visits;
  const auto test = [&](uint32_t leaf, typename From::Real& range) __attribute__((always_inline)) {
    const Packet& packet = packets[leaf];
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
        range = rounded_up<From>(local(most));
        if (rest) rest &= estimate.within(std::sqrt(local(most)));
      }
    }
  };
  const auto expect = [&](uint32_t leaf) __attribute__((always_inline)) { prefetch(packets + leaf); };
  const double unseen = search(tree, from, rounded_up<From>(local(most)), visits, test, expect);
  const double distance = std::sqrt(best.squared);
  if (!(distance <= query.range)) out.triangle = no_triangle;
  out.least = std::min(std::min(distance, query.range), std::sqrt(unseen) / scale);
  out.visits = query.visits - visits;
  out.is_cut = unseen < std::numeric_limits<double>::infinity();
  return out;
}

FS_INLINE MeshTree::Found MeshTree::find_in(const MeshTree& tree, const Query& query) noexcept {
  const bool is_near = largest_coordinate(tree.frame_.local(query.x)) < far;
  return is_near ? tree.find_from<Near>(query) : tree.find_from<Far>(query);
}

MeshTree::Found MeshTree::find(const Query& query) const noexcept { return lanes::run<find_in>(*this, query); }

// At an edge or a corner of a triangle that another part meets, its neighbours in its own part do not tell the side.
Closest MeshTree::tell_met(Vec3 x, const Found& found, Effort* effort) const noexcept {
  const bool is_piece = found.triangle >= triangle_count();
  const uint32_t triangle = is_piece ? union_->pieces[found.triangle - triangle_count()].triangle : found.triangle;
  const Nearest& nearest = found.nearest;
  const Vec3 normal = normals_.face(triangle);
  Closest hit;
  hit.point = x + nearest.offset;
  hit.triangle = found.triangle;
  hit.distance = std::sqrt(nearest.squared);
  double largest = largest_coordinate(x);
  for (int k = 0; k < 3; ++k) largest = std::max(largest, largest_coordinate(corner(found.triangle, k)));
  const double height = -dot(nearest.offset, normal);
  const bool is_above = std::fabs(height) >= (1 - 1e-14) * hit.distance;  // it is a joint within the triangle
  if (nearest.part == Part::face || is_above) {
    hit.feature = Feature::face;
  } else if (nearest.part < Part::corner_a) {
    const int k = static_cast<int>(nearest.part) - static_cast<int>(Part::edge_ab);
    hit.feature = Feature::edge;
    hit.tangent = normalized(corner(found.triangle, (k + 1) % 3) - corner(found.triangle, k));
  }
  if (hit.distance <= coordinate_rounding(largest)) {
    hit.distance = 0;
    hit.direction = normal;
    return hit;
  }
  hit.side = height >= 0 ? Side::front : Side::back;
  if (hit.feature == Feature::face) {
    hit.direction = hit.side == Side::front ? normal : -normal;
    return hit;
  }
  hit.direction = normalized(-nearest.offset);
  // All places nearer to x than the closest point are on its side. Of a place whose ways out all meet an edge, also one of
  // surface that the union lacks, it is not known; then another place is asked.
  constexpr Vec3 asides[] = {{0, 0, 0}, {0.21, -0.37, 0.29}, {-0.33, 0.19, 0.23}};
  for (const Vec3& aside : asides) {
    bool is_known = true;
    const bool is_inside = winding(x + hit.distance * aside, is_known, effort ? &effort->visits : nullptr) != 0;
    if (effort && effort->visits == 0) {  // on which side x is was not found out
      effort->is_cut = true;
      effort->least = hit.distance;
      break;
    }
    if (!is_known) continue;
    hit.side = is_inside == union_->is_inward[found.triangle] ? Side::front : Side::back;
    break;
  }
  return hit;
}

Closest MeshTree::tell(Vec3 x, const Found& found, Effort* effort) const noexcept {
  if (union_ && (found.triangle >= triangle_count() || union_->is_met[found.triangle])) return tell_met(x, found, effort);
  const Nearest& nearest = found.nearest;
  const uint32_t* v = corners_.data() + size_t{3} * found.triangle;
  const Vec3 corners[3] = {points_[v[0]], points_[v[1]], points_[v[2]]};
  int part = static_cast<int>(nearest.part);
  bool on_edge = nearest.part == Part::edge_ab || nearest.part == Part::edge_bc || nearest.part == Part::edge_ca;
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
    if (!has_face && nearest.part == Part::face) {
      normal = normals_.side(found.triangle, 0);
      on_edge = true;
      part = static_cast<int>(Part::edge_ab);
    }
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

}  // namespace fs
