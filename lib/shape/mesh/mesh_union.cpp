#include "shape/mesh/mesh_union.h"

#include <algorithm>
#include <numeric>

#include "shape/mesh/mesh_tree.h"
#include "shape/triangle.h"

namespace fs {
namespace {

constexpr uint32_t none = UINT32_MAX;
constexpr int pair_cost = 8;  // of parts that may meet, in steps: each pair takes memory

bool meet(const Box& a, const Box& b) {
  return a.lower.x <= b.upper.x && b.lower.x <= a.upper.x && a.lower.y <= b.upper.y && b.lower.y <= a.upper.y &&
         a.lower.z <= b.upper.z && b.lower.z <= a.upper.z;
}

using Polygon = std::vector<Vec3>;  // convex

struct Range {
  double low, high;
};
// Of the distances of points from a plane.
template <class Points>
Range heights(const Points& points, Vec3 at, Vec3 normal) {
  Range out{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (const Vec3& p : points) {
    const double h = dot(normal, p - at);
    out.low = std::min(out.low, h);
    out.high = std::max(out.high, h);
  }
  return out;
}

// Where parts cross so often that this takes too long, `work_left_` ends and nothing is decided.
class UnionBuilder {
 public:
  UnionBuilder(const MeshTree& mesh, std::span<const Vec3> points, std::span<const uint32_t> corners, const MeshParts& parts,
               StopToken& stop)
      : mesh_(mesh), points_(points), corners_(corners), parts_(parts), stop_(stop), count_(corners.size() / 3),
        work_left_(2'000'000 + int64_t{400} * count_) {}

  std::unique_ptr<MeshUnion> build() {
    find_partners();
    if (!has_partners_ || work_left_ <= 0) return nullptr;
    out_ = std::make_unique<MeshUnion>();
    out_->counts.assign(count_, true);
    out_->is_met.assign(count_, false);
    out_->is_inward.assign(count_, false);
    for (uint32_t t = 0; t < count_ && work_left_ > 0; ++t) cut(t);
    if (work_left_ > 0) fill();
    if (work_left_ <= 0) return nullptr;
    const bool is_all = std::find(out_->counts.begin(), out_->counts.end(), false) == out_->counts.end();
    const bool is_none = out_->pieces.empty() && std::find(out_->counts.begin(), out_->counts.end(), true) == out_->counts.end();
    const bool is_any_met = std::find(out_->is_met.begin(), out_->is_met.end(), true) != out_->is_met.end();
    if (is_none || (is_all && !is_any_met)) return nullptr;
    return std::move(out_);
  }

 private:
  Vec3 corner(uint32_t t, int k) const { return points_[corners_[size_t{3} * t + k]]; }
  Vec3 normal_of(uint32_t t) const { return triangle_normal(corner(t, 0), corner(t, 1), corner(t, 2)); }
  Box box_of(uint32_t t) const {
    Box out;
    for (int k = 0; k < 3; ++k) out.add(corner(t, k));
    return out;
  }
  Box widened(const Box& box) const {
    const Vec3 by{tolerance_, tolerance_, tolerance_};
    Box out = box;
    out.lower = box.lower - by;
    out.upper = box.upper + by;
    return out;
  }

  // Which parts have boxes that meet, along the axis on which they are spread most.
  void find_partners() {
    boxes_.resize(parts_.count);
    Box all;
    for (uint32_t t = 0; t < count_; ++t) {
      stop_.check();
      boxes_[parts_.of[t]].add(box_of(t));
    }
    for (const Box& box : boxes_) all.add(box);
    const double size = norm(all.upper - all.lower);
    const double largest = std::max(largest_coordinate(all.lower), largest_coordinate(all.upper));
    tolerance_ = 1e-12 * size + 4 * coordinate_rounding(largest);
    aside_ = std::max(1e-9 * size, 16 * tolerance_);
    for (Box& box : boxes_) box = widened(box);
    partners_.resize(parts_.count);
    std::vector<uint32_t> order(parts_.count);
    std::iota(order.begin(), order.end(), 0u);
    const Vec3 spread = all.upper - all.lower;
    const auto axis = spread.x >= spread.y && spread.x >= spread.z ? &Vec3::x : spread.y >= spread.z ? &Vec3::y : &Vec3::z;
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
      stop_.check();
      return boxes_[a].lower.*axis != boxes_[b].lower.*axis ? boxes_[a].lower.*axis < boxes_[b].lower.*axis : a < b;
    });
    for (size_t i = 0; i < order.size() && work_left_ > 0; ++i) {
      for (size_t k = i + 1; k < order.size() && boxes_[order[k]].lower.*axis <= boxes_[order[i]].upper.*axis; ++k) {
        stop_.check();
        if (--work_left_ <= 0) return;
        if (!meet(boxes_[order[i]], boxes_[order[k]])) continue;
        partners_[order[i]].push_back(order[k]);
        partners_[order[k]].push_back(order[i]);
        has_partners_ = true;
        work_left_ -= pair_cost;
      }
    }
  }

  // Decides a triangle that another part meets, in pieces where one passes through it.
  void cut(uint32_t t) {
    stop_.check();
    const std::vector<uint32_t>& partners = partners_[parts_.of[t]];
    const Box box = widened(box_of(t));
    if (partners.empty()) return;
    const bool are_few = partners.size() <= 16;  // to look at many takes longer than to search the mesh
    if (are_few && std::none_of(partners.begin(), partners.end(), [&](uint32_t part) { return meet(box, boxes_[part]); })) return;
    const Vec3 normal = normal_of(t), at = corner(t, 0);
    if (normal == Vec3{}) return;
    near_.clear();
    mesh_.collect(box, near_);
    std::sort(near_.begin(), near_.end());
    const Vec3 ours[3] = {at, corner(t, 1), corner(t, 2)};
    polygons_.assign(1, {at, ours[1], ours[2]});
    bool is_met = false;
    for (const uint32_t other : near_) {
      stop_.check();
      if (--work_left_ <= 0) return;
      if (parts_.of[other] == parts_.of[t] || !meet(box, box_of(other))) continue;
      const Vec3 theirs[3] = {corner(other, 0), corner(other, 1), corner(other, 2)};
      const Vec3 their_normal = normal_of(other);
      const Range over = heights(theirs, at, normal);
      if (their_normal == Vec3{} || over.low > tolerance_ || over.high < -tolerance_) continue;
      const Range under = heights(ours, theirs[0], their_normal);
      if (under.low > tolerance_ || under.high < -tolerance_) continue;
      is_met = true;
      const size_t before = polygons_.size();
      for (size_t i = 0; i < before && work_left_ > 0; ++i) {
        stop_.check();
        --work_left_;
        cut(i, theirs, their_normal);
      }
    }
    if (!is_met) return;
    out_->is_met[t] = true;
    if (polygons_.size() == 1) {
      bool is_inward;
      out_->counts[t] = is_boundary(polygons_[0], normal, is_inward);
      out_->is_inward[t] = is_inward;
      return;
    }
    out_->counts[t] = false;
    for (const Polygon& polygon : polygons_) {
      bool is_inward;
      if (work_left_ <= 0) return;
      if (!is_boundary(polygon, normal, is_inward)) continue;
      for (size_t i = 2; i < polygon.size(); ++i) {
        out_->pieces.push_back({{polygon[0], polygon[i - 1], polygon[i]}, t});
        out_->is_inward.push_back(is_inward);
      }
    }
  }

  // Cuts a polygon in two along the plane of a triangle that passes through it: the part in front becomes a new polygon.
  void cut(size_t i, const Vec3 (&other)[3], Vec3 plane) {
    const Range range = heights(polygons_[i], other[0], plane);
    if (!(range.low < -tolerance_ && range.high > tolerance_)) return;
    Polygon front, back;
    Vec3 ends[2];  // of the cut
    int end_count = 0;
    const Polygon& polygon = polygons_[i];
    for (size_t k = 0; k < polygon.size(); ++k) {
      const Vec3 p = polygon[k], q = polygon[(k + 1) % polygon.size()];
      const double hp = dot(plane, p - other[0]), hq = dot(plane, q - other[0]);
      if (hp >= -tolerance_) front.push_back(p);
      if (hp <= tolerance_) back.push_back(p);
      if (std::fabs(hp) <= tolerance_ && end_count < 2) ends[end_count++] = p;
      if (!((hp < -tolerance_ && hq > tolerance_) || (hp > tolerance_ && hq < -tolerance_))) continue;
      const Vec3 between = p + (hp / (hp - hq)) * (q - p);
      front.push_back(between);
      back.push_back(between);
      if (end_count < 2) ends[end_count++] = between;
    }
    if (end_count < 2 || front.size() < 3 || back.size() < 3) return;
    // How much of the cut lies in the triangle.
    const Vec3 way = ends[1] - ends[0];
    double from = 0, to = 1;
    for (int k = 0; k < 3; ++k) {
      const Vec3 inwards = normalized(cross(plane, other[(k + 1) % 3] - other[k]));
      const double start = dot(inwards, ends[0] - other[k]) + tolerance_, change = dot(inwards, way);
      if (change > 0) from = std::max(from, -start / change);
      if (change < 0) to = std::min(to, -start / change);
      if (change == 0 && start < 0) return;
    }
    if (!((to - from) * norm(way) > 4 * tolerance_)) return;
    polygons_[i] = std::move(back);
    polygons_.push_back(std::move(front));
  }

  bool is_boundary(const Polygon& polygon, Vec3 normal, bool& is_inward) {
    work_left_ -= 100;  // about so much more than a cut
    Vec3 middle{};
    for (const Vec3& p : polygon) middle += (1.0 / static_cast<double>(polygon.size())) * (p - polygon[0]);
    middle += polygon[0];
    bool is_known = true;
    const bool is_above = mesh_.winding(middle + aside_ * normal, is_known) != 0;
    const bool is_below = mesh_.winding(middle - aside_ * normal, is_known) != 0;
    is_inward = is_above;
    return !is_known || is_above != is_below;
  }

  // Triangles that no other part meets are as their neighbours: one of them tells for all.
  void fill() {
    const MeshEdges edges(corners_, points_.size(), stop_);
    std::vector<uint32_t> first(edges.kinds.size(), none), second(edges.kinds.size(), none);
    for (uint32_t i = 0; i < corners_.size(); ++i) {
      uint32_t& one = first[edges.of_side[i]];
      (one == none ? one : second[edges.of_side[i]]) = i / 3;
    }
    std::vector<bool> is_done(count_);
    std::vector<uint32_t> region;
    for (uint32_t t = 0; t < count_; ++t) {
      stop_.check();
      if (is_done[t] || out_->is_met[t] || partners_[parts_.of[t]].empty()) continue;
      region.assign(1, t);
      is_done[t] = true;
      uint32_t told = none;
      for (size_t i = 0; i < region.size(); ++i) {
        stop_.check();
        if (told == none && !(normal_of(region[i]) == Vec3{})) told = region[i];
        for (int k = 0; k < 3; ++k) {
          const uint32_t edge = edges.of_side[size_t{3} * region[i] + k];
          if (edges.kinds[edge] == MeshEdges::Kind::none) continue;
          for (const uint32_t next : {first[edge], second[edge]}) {
            if (next == none || is_done[next] || out_->is_met[next]) continue;
            is_done[next] = true;
            region.push_back(next);
          }
        }
      }
      bool is_inward = false;
      const bool counts =
          told != none && is_boundary({corner(told, 0), corner(told, 1), corner(told, 2)}, normal_of(told), is_inward);
      for (const uint32_t each : region) out_->counts[each] = counts;
    }
  }

  const MeshTree& mesh_;
  const std::span<const Vec3> points_;
  const std::span<const uint32_t> corners_;
  const MeshParts& parts_;
  StopToken& stop_;
  const uint32_t count_;
  int64_t work_left_;
  std::unique_ptr<MeshUnion> out_;
  double tolerance_ = 0;  // m, within which a place is on a plane
  double aside_ = 0;      // m, so far beside a piece of surface it is asked what is inside
  bool has_partners_ = false;
  std::vector<Box> boxes_;                        // of the parts
  std::vector<std::vector<uint32_t>> partners_;   // of each part: those whose box meets its own
  std::vector<uint32_t> near_;
  std::vector<Polygon> polygons_;
};

}  // namespace

MeshParts::MeshParts(std::span<const uint32_t> corners, const MeshEdges& edges, StopToken& stop) {
  const auto triangles = static_cast<uint32_t>(corners.size() / 3);
  std::vector<uint32_t> above(triangles);  // a triangle of the same part with a lower number; itself: there is none
  std::iota(above.begin(), above.end(), 0u);
  const auto lowest = [&](uint32_t t) {
    while (above[t] != t) t = above[t] = above[above[t]];
    return t;
  };
  std::vector<uint32_t> first(edges.kinds.size(), none);
  count = triangles;
  for (uint32_t i = 0; i < corners.size(); ++i) {
    stop.check();
    // Triangles with a repeated corner are parts by themselves, unless they lie on an edge of others.
    if (edges.kinds[edges.of_side[i]] == MeshEdges::Kind::none) continue;
    uint32_t& one = first[edges.of_side[i]];
    if (one == none) {
      one = i / 3;
      continue;
    }
    const uint32_t a = lowest(one), b = lowest(i / 3);
    if (a == b) continue;
    above[std::max(a, b)] = std::min(a, b);
    --count;
  }
  if (count == 1) return;
  of.resize(triangles);
  uint32_t next = 0;
  for (uint32_t t = 0; t < triangles; ++t) of[t] = above[t] == t ? next++ : of[lowest(t)];
}

std::unique_ptr<MeshUnion> MeshUnion::of(const MeshTree& mesh, std::span<const Vec3> points, std::span<const uint32_t> corners,
                                         const MeshParts& parts, StopToken& stop) {
  return parts.of.empty() ? nullptr : UnionBuilder(mesh, points, corners, parts, stop).build();
}

}  // namespace fs
