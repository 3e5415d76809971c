#include "turns.h"

#include <algorithm>
#include <vector>

#include "program.h"

namespace {

struct Segment {
  fs_vec3 middle, direction;  // m; of unit length
  double length;              // m
};

double dot(const fs_vec3& a, const fs_vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// Of a long line the segments that join every tenth point, or whatever makes `most` of them. A smooth line turns as much
// there; a zigzag does not, and its jumps are missed.
std::vector<Segment> segments_of(const fs_shape* line) {
  const std::size_t most = 1000;
  fs_shape_info info = fs_shape_info_init();
  forceserver::throw_on_error(fs_shape_get_info(line, &info));
  std::size_t count = 0;
  const fs_vec3* const points = fs_shape_get_points(line, &count);
  const std::size_t step = (count + most - 1) / most, end = info.closed ? count : count - 1;
  std::vector<Segment> segments;
  for (std::size_t i = 0; i < end; i += step) {
    const fs_vec3 a = points[i], b = points[info.closed ? std::min(i + step, count) % count : std::min(i + step, end)];
    const fs_vec3 way = minus(b, a);
    const double size = length(way);
    if (!(size > 0)) continue;
    const fs_vec3 middle = {a.x + way.x / 2, a.y + way.y / 2, a.z + way.z / 2};
    segments.push_back({middle, {way.x / size, way.y / size, way.z / size}, size});
  }
  return segments;
}

}  // namespace

// Of two parts that are equally near at a distance d, u and v being the directions to them, the force changes by |u - v| f(d),
// and they lie |u - v| d apart. If the line turns by an angle t at most from the one to the other, u and v differ by no more
// than t: |u - v| <= 2 sin(t/2). Next to a bend this is reached, at any distance; a circle reaches it at its centre.
double jump_between_parts(const fs_shape* line, const std::function<double(double)>& strongest_beyond) {
  const std::vector<Segment> segments = segments_of(line);
  fs_shape_info info = fs_shape_info_init();
  forceserver::throw_on_error(fs_shape_get_info(line, &info));
  const std::size_t count = segments.size();
  std::vector<double> behind(count);  // of a closed line: the cosine of the turn on the other way, from j on to i
  double most = 0;
  for (std::size_t i = 0; i < count; ++i) {
    double cosine = 1;
    for (std::size_t k = 1; k < count; ++k) {
      const std::size_t j = (i + count - k) % count;
      behind[j] = cosine = std::min(cosine, dot(segments[i].direction, segments[j].direction));
    }
    cosine = 1;
    for (std::size_t j = i + 1; j < count; ++j) {
      const Segment &a = segments[i], &b = segments[j];
      cosine = std::min(cosine, dot(a.direction, b.direction));
      const double least = info.closed ? std::max(cosine, behind[j]) : cosine;
      const double difference = std::sqrt(2 * std::max(0.0, 1 - least));  // 2 sin(t/2)
      if (difference * strongest_beyond(0) <= most) continue;
      const double apart = std::max(0.0, length(minus(b.middle, a.middle)) - (a.length + b.length) / 2);
      most = std::max(most, difference * strongest_beyond(apart / difference));
    }
  }
  return most;
}
