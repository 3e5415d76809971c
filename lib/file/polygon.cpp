#include "file/polygon.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>
#include <utility>

#include "base/whole_file.h"

namespace fs {
namespace {

// A corner in the plane of its polygon, on a grid of 2^-51 of the polygon's size: as fine as the coordinates, and
// coarse enough that 128 bits hold an orientation exactly.
struct Place {
  int64_t x, y;
  bool operator==(const Place&) const = default;
};
__extension__ typedef __int128 Area;

// Twice the area of the triangle a b c: > 0 where it runs counter-clockwise.
Area orientation(Place a, Place b, Place c) {
  return static_cast<Area>(b.x - a.x) * (c.y - a.y) - static_cast<Area>(b.y - a.y) * (c.x - a.x);
}

// A point whose orientation to the line a b is at most this counts as on the line, because rounding moves a corner by
// about one step of the grid.
Area blur(Place a, Place b) { return static_cast<Area>(8) * (std::abs(b.x - a.x) + std::abs(b.y - a.y)); }

// Projects the corners to the plane of their polygon, with its normal (after Newell) towards the viewer. False when the
// polygon has no area.
bool project(const std::vector<Vec3>& points, std::span<const uint32_t> corners, std::vector<Place>& places) {
  const Vec3 origin = 0.5 * points[corners[0]];  // halves, because the difference of two doubles can overflow
  double size = 0;
  for (const uint32_t corner : corners) {
    const Vec3 p = 0.5 * points[corner] - origin;
    size = std::fmax(size, std::fmax(std::fabs(p.x), std::fmax(std::fabs(p.y), std::fabs(p.z))));
  }
  if (!(size > 0)) return false;
  const int exponent = -std::ilogb(size) - 1;  // makes |coordinates| < 1, so that no product overflows or underflows
  const auto scaled = [&](uint32_t corner) {
    const Vec3 p = 0.5 * points[corner] - origin;
    return Vec3{std::ldexp(p.x, exponent), std::ldexp(p.y, exponent), std::ldexp(p.z, exponent)};
  };
  Vec3 sum{};
  Vec3 before = scaled(corners.back());
  for (const uint32_t corner : corners) {
    const Vec3 here = scaled(corner);
    sum += cross(before, here);
    before = here;
  }
  if (!(norm(sum) > 0x1p-46)) return false;  // only rounding error: no area
  const Vec3 normal = normalized(sum);
  // In a plane perpendicular to an axis, u and v are axes too, so nothing is rounded.
  const Vec3 other =
      std::fabs(normal.x) > std::fabs(normal.z) || std::fabs(normal.y) > std::fabs(normal.z) ? Vec3{0, 0, 1} : Vec3{0, 1, 0};
  const Vec3 u = normalized(cross(other, normal)), v = cross(normal, u);
  places.clear();
  for (const uint32_t corner : corners) {
    const Vec3 p = scaled(corner);
    places.push_back({std::llrint(std::ldexp(dot(p, u), 51)), std::llrint(std::ldexp(dot(p, v), 51))});
  }
  return true;
}

// True when every corner turns left and the fan from the first corner does not overlap.
bool is_convex(const std::vector<Place>& p) {
  const size_t n = p.size();
  for (size_t i = 0; i < n; ++i) {
    const Place a = p[i], b = p[(i + 1) % n], c = p[(i + 2) % n];
    if (orientation(a, b, c) <= blur(a, c)) return false;
    if (i > 0 && i + 1 < n && orientation(p[0], a, b) <= 0) return false;
  }
  return true;
}

// Bounds of some places, in steps of the grid: a rectangle along their main direction. Corners often lie on one line;
// the rectangle is then that line, whatever its direction.
struct Rectangle {
  double x, y;              // the middle
  double along_x, along_y;  // a unit vector
  double length, width;     // half of each
};

// The triangle a b c; tells quickly, and never wrongly, that a rectangle misses it.
class Region {
 public:
  Region(Place a, Place b, Place c) : corners_{{at(a), at(b), at(c)}} {
    for (size_t i = 0; i < 3; ++i) {
      const Point from = corners_[i], to = corners_[(i + 1) % 3];
      const double length = std::hypot(to.x - from.x, to.y - from.y);
      inwards_[i] = length > 0 ? Point{(from.y - to.y) / length, (to.x - from.x) / length} : Point{0, 0};
    }
  }

  bool misses(const Rectangle& r) const {
    for (size_t i = 0; i < 3; ++i) {  // is the whole rectangle outside of an edge?
      const double across = inwards_[i].x * r.along_x + inwards_[i].y * r.along_y;
      const double beside = inwards_[i].y * r.along_x - inwards_[i].x * r.along_y;
      const double middle = inwards_[i].x * (r.x - corners_[i].x) + inwards_[i].y * (r.y - corners_[i].y);
      if (middle + std::fabs(across) * r.length + std::fabs(beside) * r.width < -margin) return true;
    }
    double least_along = 1e300, most_along = -1e300, least_beside = 1e300, most_beside = -1e300;
    for (const Point corner : corners_) {
      const double x = corner.x - r.x, y = corner.y - r.y;
      const double along = x * r.along_x + y * r.along_y, beside = y * r.along_x - x * r.along_y;
      least_along = std::fmin(least_along, along), most_along = std::fmax(most_along, along);
      least_beside = std::fmin(least_beside, beside), most_beside = std::fmax(most_beside, beside);
    }
    return least_along > r.length + margin || most_along < -r.length - margin || least_beside > r.width + margin ||
           most_beside < -r.width - margin;
  }

 private:
  struct Point {
    double x, y;
  };
  static Point at(Place p) { return {static_cast<double>(p.x), static_cast<double>(p.y)}; }
  static constexpr double margin = 64;  // steps: far more than rounding and a blur

  std::array<Point, 3> corners_;
  std::array<Point, 3> inwards_;  // of edge i, to the left: unit vectors
};

// Corners that can be searched by place and removed: a tree of rectangles, each halved across its direction (after the
// strip trees of Ballard, 1981). Without it every test of an ear would look at every corner.
class PlaceTree {
 public:
  PlaceTree(const std::vector<Place>& places, std::vector<uint32_t> corners)
      : places_(places), order_(std::move(corners)), positions_(places.size(), none) {
    if (order_.empty()) return;
    nodes_.resize(2 * std::bit_ceil((order_.size() + few - 1) / few));
    build(1, 0, order_.size());
    for (size_t i = 0; i < order_.size(); ++i) positions_[order_[i]] = i;
  }

  void remove(uint32_t corner) {
    const size_t position = positions_[corner];
    if (position == none) return;
    positions_[corner] = none;
    for (size_t node = 1, begin = 0, end = order_.size();;) {
      --nodes_[node].count;
      if (end - begin <= few) return;
      const size_t middle = (begin + end) / 2;
      const bool is_right = position >= middle;
      (is_right ? begin : end) = middle;
      node = 2 * node + is_right;
    }
  }

  // True when hits(corner) is true for any remaining corner. Skips the parts of the tree for which misses(box,
  // place) is true; place: the common place of all corners of the part, null when they differ. Adds its steps to work.
  template <class Misses, class Hits>
  bool find(const Misses& misses, const Hits& hits, uint64_t& work) const {
    return !order_.empty() && find(misses, hits, work, 1, 0, order_.size());
  }

 private:
  static constexpr size_t none = ~size_t{0}, few = 8;
  struct Node {
    Rectangle box;
    const Place* place;  // of all corners if they are at the same place, otherwise null
    size_t count;        // of corners that were not removed
  };

  void build(size_t node, size_t begin, size_t end) {
    const auto at = [&](size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    const auto [left, right] = std::minmax_element(at(begin), at(end), [&](uint32_t a, uint32_t b) {
      return std::pair(places_[a].x, places_[a].y) < std::pair(places_[b].x, places_[b].y);
    });
    const auto [low, high] = std::minmax_element(at(begin), at(end), [&](uint32_t a, uint32_t b) {
      return std::pair(places_[a].y, places_[a].x) < std::pair(places_[b].y, places_[b].x);
    });
    const Place first = places_[*left];
    const bool is_wide = places_[*right].x - first.x > places_[*high].y - places_[*low].y;
    const Place from = is_wide ? first : places_[*low], to = is_wide ? places_[*right] : places_[*high];
    const double x = static_cast<double>(to.x - from.x), y = static_cast<double>(to.y - from.y);
    const double d = std::hypot(x, y);
    const double along_x = d > 0 ? x / d : 1, along_y = d > 0 ? y / d : 0;
    const auto dx = [&](uint32_t i) { return static_cast<double>(places_[i].x - from.x); };
    const auto dy = [&](uint32_t i) { return static_cast<double>(places_[i].y - from.y); };
    const auto along = [&](uint32_t i) { return dx(i) * along_x + dy(i) * along_y; };
    const auto beside = [&](uint32_t i) { return dy(i) * along_x - dx(i) * along_y; };
    double least_along = 0, most_along = 0, least_beside = 0, most_beside = 0;
    for (size_t i = begin; i < end; ++i) {
      const double s = along(order_[i]), t = beside(order_[i]);
      least_along = std::min(least_along, s), most_along = std::max(most_along, s);
      least_beside = std::min(least_beside, t), most_beside = std::max(most_beside, t);
    }
    const double s = (least_along + most_along) / 2, t = (least_beside + most_beside) / 2;
    nodes_[node] = {
        {static_cast<double>(from.x) + s * along_x - t * along_y, static_cast<double>(from.y) + s * along_y + t * along_x,
         along_x, along_y, (most_along - least_along) / 2, (most_beside - least_beside) / 2},
        d > 0 ? nullptr : &places_[*left],
        end - begin};
    if (end - begin <= few) return;
    const size_t middle = (begin + end) / 2;
    std::nth_element(at(begin), at(middle), at(end), [&](uint32_t a, uint32_t b) { return along(a) < along(b); });
    build(2 * node, begin, middle);
    build(2 * node + 1, middle, end);
  }

  template <class Misses, class Hits>
  bool find(const Misses& misses, const Hits& hits, uint64_t& work, size_t node, size_t begin, size_t end) const {
    ++work;
    if (nodes_[node].count == 0 || misses(nodes_[node].box, nodes_[node].place)) return false;
    if (end - begin <= few) {
      work += end - begin;
      return std::any_of(order_.begin() + static_cast<std::ptrdiff_t>(begin), order_.begin() + static_cast<std::ptrdiff_t>(end),
                         [&](uint32_t corner) { return positions_[corner] != none && hits(corner); });
    }
    const size_t middle = (begin + end) / 2;
    return find(misses, hits, work, 2 * node, begin, middle) || find(misses, hits, work, 2 * node + 1, middle, end);
  }

  const std::vector<Place>& places_;
  std::vector<uint32_t> order_;    // corners, leaf by leaf
  std::vector<size_t> positions_;  // of each corner in order_; none: never there, or removed
  std::vector<Node> nodes_;        // the children of i are 2 i and 2 i + 1
};

// How strict the test is that a corner must pass before it is cut off.
enum class Ear {
  clear,   // its triangle has an area, and nothing of the polygon's outline is in it or on the new edge
  touched, // its triangle has no area, or the outline only touches it
  convex,  // its triangle has an area
};

// Cuts off ears. Only corners that are not convex can lie in the triangle of another corner, and cutting off an ear can
// make ears only of its two neighbours. So each corner is examined only a few times.
class EarCutter {
 public:
  EarCutter(const std::vector<Place>& places, uint64_t& work)
      : places_(places), previous_(places.size()), next_(places.size()), is_queued_(places.size()), left_(places.size()),
        tree_(places, link()), work_(work) {}

  // Calls emit(a, b, c) for each triangle. Gives up and returns false when its work exceeds most_work.
  template <class Emit>
  bool cut(uint64_t most_work, Emit emit) {
    for (const Ear ear : {Ear::clear, Ear::touched, Ear::convex}) {
      queue_.clear();
      for (size_t i = 0; i < left_; ++i, start_ = next_[start_]) push(start_);
      for (size_t head = 0; head < queue_.size() && left_ > 3; ++head) {
        const uint32_t b = queue_[head];
        is_queued_[b] = false;
        if (work_ > most_work) return false;
        if (next_[b] == b || !is_ear(b, ear)) continue;
        const uint32_t a = previous_[b], c = next_[b];
        emit(a, b, c);
        next_[a] = c;
        previous_[c] = a;
        next_[b] = b;  // marks b as cut off
        tree_.remove(b);
        start_ = a;
        --left_;
        for (const uint32_t neighbour : {a, c}) {
          if (is_convex(neighbour)) tree_.remove(neighbour);
          push(neighbour);
        }
      }
    }
    for (uint32_t b = next_[start_], c = next_[b]; c != start_; b = c, c = next_[c]) emit(start_, b, c);
    return true;
  }

 private:
  // Links the corners into a ring; returns those that are not convex.
  std::vector<uint32_t> link() {
    const auto n = static_cast<uint32_t>(places_.size());
    for (uint32_t i = 0; i < n; ++i) {
      next_[i] = i + 1 < n ? i + 1 : 0;
      previous_[next_[i]] = i;
    }
    std::vector<uint32_t> others;
    for (uint32_t i = 0; i < n; ++i) {
      if (!is_convex(i)) others.push_back(i);
    }
    return others;
  }

  void push(uint32_t corner) {
    if (!is_queued_[corner]) queue_.push_back(corner);
    is_queued_[corner] = true;
  }

  bool is_convex(uint32_t b) const {
    const Place a = places_[previous_[b]], c = places_[next_[b]];
    return orientation(a, places_[b], c) > blur(a, c);
  }

  bool is_ear(uint32_t corner, Ear ear) {
    const Place a = places_[previous_[corner]], b = places_[corner], c = places_[next_[corner]];
    const Area area = orientation(a, b, c);
    if (ear == Ear::convex) return area > 0;
    if (ear == Ear::touched && area <= 0) return area == 0;
    if (ear == Ear::clear && area <= blur(a, c)) return false;
    const Area least = ear == Ear::clear ? -blur(a, c) : 1;  // from here inwards of the new edge, no corner may lie

    const Region region(a, b, c);
    const auto misses = [&](const Rectangle& rectangle, const Place* place) {
      return (place && (*place == a || *place == c)) || region.misses(rectangle);
    };
    const auto is_in_the_way = [&](uint32_t other) {
      const Place p = places_[other];
      if (p == a || p == c) return false;
      const Area beside_ab = orientation(a, b, p), beside_bc = orientation(b, c, p);
      if (beside_ab < 0 || beside_bc < 0 || orientation(c, a, p) < least) return false;
      if (beside_ab > 0 && beside_bc > 0) return true;
      // The corner touches an old edge. It is in the way if the outline goes on from it to the inside.
      const auto goes_inside = [&](uint32_t neighbour) {
        const Place q = places_[neighbour];
        return (beside_ab > 0 || orientation(a, b, q) > 0) && (beside_bc > 0 || orientation(b, c, q) > 0);
      };
      return goes_inside(previous_[other]) || goes_inside(next_[other]);
    };
    return !tree_.find(misses, is_in_the_way, work_);
  }

  const std::vector<Place>& places_;
  std::vector<uint32_t> previous_, next_;  // in the ring of corners that are left
  std::vector<uint32_t> queue_;            // corners to be looked at
  std::vector<bool> is_queued_;
  size_t left_;
  uint32_t start_ = 0;  // a corner that is left
  PlaceTree tree_;      // corners that are not convex
  uint64_t& work_;
};

}  // namespace

void Faces::cut(const std::vector<Vec3>& points, const std::string& file) {
  std::vector<uint32_t> corners;
  std::vector<Place> places;
  uint64_t work = 0, most_work = 1500 * uint64_t{points.size()} + 40 * uint64_t{triangles_.size() / 3};
  for (const Polygon& polygon : polygons_) {
    uint32_t* const out = triangles_.data() + polygon.begin;
    corners.assign(out, out + 2);
    for (size_t i = 0; i < polygon.corners - 2; ++i) corners.push_back(out[3 * i + 2]);
    if (!project(points, corners, places) || is_convex(places)) continue;  // it stays a fan
    size_t written = 0;
    const bool is_cut = EarCutter(places, work).cut(most_work, [&](uint32_t a, uint32_t b, uint32_t c) {
      for (const uint32_t corner : {a, b, c}) out[written++] = corners[corner];
    });
    if (!is_cut) {
      fail_at(FS_ERROR_UNSUPPORTED, file, "a face of %zu corners is too entangled to be cut into triangles in good time",
              polygon.corners);
    }
  }
}

}  // namespace fs
