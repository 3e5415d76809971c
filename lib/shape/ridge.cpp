#include "shape/ridge.h"

#include <algorithm>
#include <cmath>

#include "shape/mesh/mesh_tree.h"
#include "shape/mixture.h"
#include "shape/triangle.h"

namespace fs {
namespace {

constexpr int most_searches = 12;

// A part of the surface that may be nearest: the plane, the line or the point that it is near its closest point.
struct Piece {
  Vec3 point;      // m
  Vec3 direction;  // of a face: its normal, towards x
  Vec3 tangent;    // of an edge
  Feature feature;
  uint32_t triangle;

  Piece() = default;
  explicit Piece(const Closest& c)
      : point(c.point), direction(c.direction), tangent(c.tangent), feature(c.feature), triangle(c.triangle) {}

  // The distance from it to y, and the direction in which that grows.
  double distance(Vec3 y, Vec3& up) const noexcept {
    up = y - point;
    if (feature == Feature::face) {
      const double out = dot(direction, up);
      up = direction;
      return out;
    }
    if (feature == Feature::edge) up += -dot(tangent, up) * tangent;
    const double out = norm(up);
    up = normalized(up);
    return out;
  }
  double distance(Vec3 y) const noexcept {
    Vec3 up;
    return distance(y, up);
  }
};

// The closest point of one triangle or segment, relative to y.
Nearest nearest_on_item(const Shape& shape, uint32_t item, Vec3 y) noexcept {
  const auto point = [&](size_t i) { return shape.points[i] - y; };
  if (shape.primitive == FS_PRIMITIVE_MESH) return shape.tree()->nearest_on(item, y);
  Nearest out;
  nearest_on_segment(point(item), point(item + 1 < shape.points.size() ? item + 1 : 0), Part::edge_ab, Part::corner_a,
                     Part::corner_b, out);
  return out;
}

Closest closest_on_item(const Shape& shape, uint32_t item, Vec3 y) noexcept {
  const Nearest nearest = nearest_on_item(shape, item, y);
  Closest out;
  out.point = y + nearest.offset;
  out.distance = std::sqrt(nearest.squared);
  out.direction = normalized(-nearest.offset);
  out.triangle = item;
  if (nearest.part == Part::face) {
    out.feature = Feature::face;
  } else if (nearest.part < Part::corner_a) {
    out.feature = Feature::edge;
    if (shape.primitive == FS_PRIMITIVE_MESH) {
      const int k = static_cast<int>(nearest.part) - static_cast<int>(Part::edge_ab);
      out.tangent = normalized(shape.tree()->corner(item, (k + 1) % 3) - shape.tree()->corner(item, k));
    } else {
      const size_t to = item + 1 < shape.points.size() ? item + 1 : 0;
      out.tangent = normalized(shape.points[to] - shape.points[item]);
    }
  }
  return out;
}

// The pieces that are known, and y for these.
class Pieces {
 public:
  Pieces(Vec3 x, double l) : x_(x), l_(l), y_(x) {}

  // solve() is to follow.
  void add(const Piece& piece) noexcept {
    int i = count_;
    if (count_ < Mixture::most) {
      ++count_;
    } else {  // in place of one that has no part in the mixture: at most four have
      for (i = 0; mixture_.parts[i] > 0;) ++i;
    }
    pieces_[i] = piece;
  }

  // The distance to a face is linear; the others are taken as they are at y, a few times.
  void solve() noexcept {
    if (count_ == 1) {  // as mostly
      pieces_[0].distance(x_, mixture_.mean);
      mixture_.size = 1;
      mixture_.parts[0] = 1;
      y_ = x_ + l_ * mixture_.mean;
      return;
    }
    for (int round = 0; round < 40; ++round) {
      bool is_linear = true;
      mixture_.size = count_;
      for (int i = 0; i < count_; ++i) {
        const double there = pieces_[i].distance(y_, mixture_.directions[i]);
        mixture_.costs[i] = (there + dot(mixture_.directions[i], x_ - y_)) / l_;
        is_linear &= pieces_[i].feature == Feature::face;
      }
      mixture_.mix();
      const Vec3 before = y_;
      y_ = x_ + l_ * mixture_.mean;
      if (is_linear || norm(y_ - before) <= 1e-8 * l_) break;
    }
  }

  Vec3 goal() const noexcept { return y_; }
  Vec3 mixed() const noexcept { return mixture_.mean; }
  // The distance from y to the nearest piece.
  double distance(Vec3 y) const noexcept {
    double out = pieces_[0].distance(y);
    for (int i = 1; i < count_; ++i) out = std::min(out, pieces_[i].distance(y));
    return out;
  }
  // Faces and edges were taken as if they went on for ever. Those of the mixture that do not reach as far as y become what
  // they are from there. False: all do.
  bool correct(fs_primitive primitive, const Shape& shape, double tolerance, Effort* effort) noexcept {
    bool is_changed = false;
    for (int i = 0; i < count_; ++i) {
      Piece& piece = pieces_[i];
      if (mixture_.parts[i] == 0 || piece.feature == Feature::vertex) continue;
      Vec3 up;
      const double distance = piece.distance(y_, up);
      const Closest here = closest_on_item(shape, piece.triangle, y_);
      if (here.distance <= distance + tolerance) continue;
      Closest foot;  // in a neighbouring triangle?
      if (closest_point(primitive, &shape, y_ - distance * up, tolerance, foot, nullptr, effort)) {
        piece.triangle = foot.triangle;
        continue;
      }
      piece = Piece(here);
      is_changed = true;
    }
    if (is_changed) solve();
    return is_changed;
  }
  bool is_ridge() const noexcept { return mixture_.count() > 1; }
  Mat3 across() const noexcept { return mixture_.across(); }
  void remember(Hint& hint) const noexcept {
    hint.ahead = y_ - x_;
    hint.item_count = 0;
    for (int i = 0; i < count_; ++i) {
      if (mixture_.parts[i] > 0) hint.items[hint.item_count++] = pieces_[i].triangle;
    }
  }

 private:
  Vec3 x_;
  double l_;
  Vec3 y_;
  int count_ = 0;
  Piece pieces_[Mixture::most];
  Mixture mixture_;
};

bool search_ridge(fs_primitive primitive, const Shape& shape, Vec3 x, const Closest& closest, double l, Ridge& out, Hint* hint,
                  Effort* effort) noexcept {
  const double tolerance = 1e-8 * l + 4 * coordinate_rounding(largest_coordinate(x) + closest.distance + l);
  if (!(tolerance < 1e-2 * l)) return false;
  Pieces pieces(x, l);
  // What was near y, if it is seen from the same side. It comes first: of equal pieces the first has its part in the mixture,
  // and these probably reach as far as y.
  for (uint32_t i = 0; hint && i < hint->item_count; ++i) {
    const Piece piece(closest_on_item(shape, hint->items[i], x + hint->ahead));
    if (piece.distance(x) >= closest.distance - tolerance) pieces.add(piece);
  }
  pieces.add(Piece(closest));
  pieces.solve();
  Vec3 seen = x, y = pieces.goal();    // the way from x to `seen` is free,
  double free = closest.distance;      // and so is a ball of this radius about it
  for (int searches = 0; searches < most_searches; ++searches) {
    const double known = pieces.distance(y);
    Closest found;
    const bool is_found = closest_point(primitive, &shape, y, known - tolerance, found, nullptr, effort);
    if (effort && effort->is_cut) return false;
    const double least = is_found ? found.distance : known;
    if (const Vec3 way = y - seen; norm(way) > free + least) {  // y may lie beyond another wall
      y = seen + std::max(0.5, 0.9 * free / norm(way)) * way;
      continue;
    }
    seen = y;
    free = least;
    if (is_found) {
      pieces.add(Piece(found));
      pieces.solve();
    } else if (y == pieces.goal() && !(pieces.is_ridge() && pieces.correct(primitive, shape, tolerance, effort))) {
      break;
    }
    y = pieces.goal();
  }
  if (!pieces.is_ridge()) return false;
  if (hint) pieces.remember(*hint);
  out = {pieces.mixed(), pieces.across()};
  return true;
}

}  // namespace

bool find_ridge(fs_primitive primitive, const Shape* shape, Vec3 x, const Closest& closest, double l, Ridge& out, Hint* hint,
                Effort* effort) noexcept {
  const bool has_ridges = primitive == FS_PRIMITIVE_MESH || (primitive == FS_PRIMITIVE_POLYLINE && !shape->is_straight);
  if (!has_ridges || !(l > 0) || !(closest.distance > 0) || closest.direction == Vec3{}) return false;
  if (hint && l <= hint->free) return false;
  const Effort before = effort ? *effort : Effort{};
  const bool is_ridge = search_ridge(primitive, *shape, x, closest, l, out, hint, effort);
  if (hint && !is_ridge) {
    // On a face the direction stays, so that the next search may be from there; a little farther, as l changes, too.
    hint->ahead = closest.feature == Feature::face ? (1.1 * l) * closest.direction : Vec3{};
    hint->item_count = 0;
  }
  if (effort) {  // is_cut and least again describe the search from x
    effort->is_ridge_cut = effort->is_cut && !is_ridge;
    effort->is_cut = before.is_cut;
    effort->least = before.least;
  }
  return is_ridge;
}

bool closest_point_ahead(fs_primitive primitive, const Shape* shape, Vec3 x, double max_distance, Closest& out, Hint* hint,
                         Effort* effort) noexcept {
  if (!hint || primitive != FS_PRIMITIVE_MESH) return closest_point(primitive, shape, x, max_distance, out, hint, effort);
  hint->free = 0;
  if (hint->item_count == 0 && !(hint->ahead == Vec3{})) {
    const double way = norm(hint->ahead);
    Closest found;
    if (closest_point(primitive, shape, x + hint->ahead, max_distance + way, found, hint, effort) &&
        !(effort && effort->is_cut)) {
      const Nearest nearest = nearest_on_item(*shape, found.triangle, x);
      if (std::sqrt(nearest.squared) + way <= found.distance + 1e-9 * way) {
        hint->free = way;
        if (!(std::sqrt(nearest.squared) <= max_distance)) return false;
        out = shape->tree()->tell(x, {.nearest = nearest, .triangle = found.triangle}, effort);
        return true;
      }
    }
    hint->ahead = {};
  }
  return closest_point(primitive, shape, x, max_distance, out, hint, effort);
}

}  // namespace fs
