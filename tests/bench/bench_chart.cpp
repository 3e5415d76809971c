// Cost against error of many ways to get the force of a mesh. tests/bench/chart runs it and draws what it prints: one line of
// CSV for each method, mesh and way of the hand.
//
//   bench_chart [TRIANGLES]
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>

#include "closest_methods.h"
#include "decimated.h"
#include "figures.h"
#include "shape/mesh/mesh_tree.h"

using namespace bench;
using namespace fs;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// N, along the surface's outward direction; the distance is negative inside.
using Law = double (*)(double distance);
double gaussian(double d) { return 5 * std::exp(-0.5 * (d / 0.005) * (d / 0.005)); }  // 5 N, 5 mm wide
// m, beyond which that is at most so much: where fs_scene_set_accuracy allows this error, the mesh is not asked.
double gaussian_range(double force) { return 0.005 * std::sqrt(2 * std::log(5 / force)); }
double wall(double d) { return std::clamp(2000 * (0.005 - d), 0.0, 10.0); }           // 2000 N/m from 5 mm on
constexpr Law laws[] = {gaussian, wall};

// side: 1 outside, -1 inside.
Vec3 force_of(const Answer& answer, double side, Law law) {
  if (!(answer.distance > 0) || !std::isfinite(answer.distance)) return {};
  return (-side * law(side * answer.distance) / answer.distance) * answer.offset;
}
double side_of(const MeshTree& tree, Vec3 x) {
  return tree.tell(x, tree.find({x, infinity}), nullptr).side == Side::front ? 1 : -1;
}

// A grid of samples over the mesh's box and 30 mm around it, between which is interpolated. Only the samples that a way needs
// are worked out, before its places are timed; the time for all is told from the time for these.
class Grid {
 public:
  Grid(const Mesh& mesh, int side, int values) : side_(side), values_(values) {
    Box box;
    for (const Vec3& p : mesh.points) box.add(p);
    constexpr double around = 0.03;
    lower_ = box.lower - Vec3{around, around, around};
    step_ = (largest_coordinate(box.upper - box.lower) + 2 * around) / (side - 1);
    samples_.reset(static_cast<float*>(std::calloc(count() * static_cast<size_t>(values), sizeof(float))));
    is_known_.resize(count());
  }
  size_t count() const { return static_cast<size_t>(side_) * side_ * side_; }
  double bytes() const { return static_cast<double>(count() * values_ * sizeof(float)); }
  double build_time() const {
    return known_ > 0 ? time_ / static_cast<double>(known_) * static_cast<double>(count()) : 0;
  }

  struct Cell {
    size_t first;            // sample at its lowest corner
    double x, y, z;          // within the cell, 0 to 1
  };
  bool find(Vec3 p, Cell& cell) const {
    const Vec3 at = (1 / step_) * (p - lower_);
    const double last = side_ - 1.001;
    if (!(at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x < last && at.y < last && at.z < last)) return false;
    const auto i = static_cast<size_t>(at.x), j = static_cast<size_t>(at.y), k = static_cast<size_t>(at.z);
    cell = {index(i, j, k), at.x - static_cast<double>(i), at.y - static_cast<double>(j), at.z - static_cast<double>(k)};
    return true;
  }
  // sample(place, values) gives the values of a sample.
  template <class Sample>
  void prepare(Vec3 p, Sample&& sample) {
    Cell cell;
    if (!find(p, cell)) return;
    for (int c = 0; c < 8; ++c) {
      const size_t at = corner(cell, c);
      if (is_known_[at]) continue;
      is_known_[at] = true;
      const auto s = static_cast<size_t>(side_);
      const Vec3 place = lower_ + step_ * Vec3{static_cast<double>(at % s), static_cast<double>(at / s % s),
                                               static_cast<double>(at / s / s)};
      const double start = seconds_now();
      sample(place, samples_.get() + at * static_cast<size_t>(values_));
      time_ += seconds_now() - start;
      ++known_;
    }
  }
  const float* at(const Cell& cell, int c) const { return samples_.get() + corner(cell, c) * static_cast<size_t>(values_); }
  double step() const { return step_; }

 private:
  size_t index(size_t i, size_t j, size_t k) const { return i + static_cast<size_t>(side_) * (j + static_cast<size_t>(side_) * k); }
  size_t corner(const Cell& cell, int c) const { return cell.first + index(c & 1, c >> 1 & 1, static_cast<size_t>(c) >> 2); }

  struct Free {
    void operator()(float* p) const { std::free(p); }
  };
  int side_, values_;
  Vec3 lower_;
  double step_, time_ = 0;
  size_t known_ = 0;
  std::unique_ptr<float, Free> samples_;
  std::vector<bool> is_known_;
};

// Of corner c of a cell.
double weight_of(const Grid::Cell& cell, int c) {
  return (c & 1 ? cell.x : 1 - cell.x) * (c & 2 ? cell.y : 1 - cell.y) * (c & 4 ? cell.z : 1 - cell.z);
}

// Of signed distances: the direction is that in which they grow.
Answer in_distances(const Grid& grid, Vec3 x) {
  Grid::Cell cell;
  if (!grid.find(x, cell)) return {};
  double s[8];
  for (int c = 0; c < 8; ++c) s[c] = *grid.at(cell, c);
  const auto mix = [](double a, double b, double t) { return a + t * (b - a); };
  const double s00 = mix(s[0], s[1], cell.x), s10 = mix(s[2], s[3], cell.x), s01 = mix(s[4], s[5], cell.x),
               s11 = mix(s[6], s[7], cell.x), s0 = mix(s00, s10, cell.y), s1 = mix(s01, s11, cell.y);
  const double value = mix(s0, s1, cell.z);
  const Vec3 slope{mix(mix(s[1] - s[0], s[3] - s[2], cell.y), mix(s[5] - s[4], s[7] - s[6], cell.y), cell.z),
                   mix(s10 - s00, s11 - s01, cell.z), s1 - s0};
  return {std::fabs(value), -value * normalized(slope)};
}

double side_in(const Grid& grid, Vec3 x) {
  Grid::Cell cell;
  if (!grid.find(x, cell)) return 1;
  double value = 0;
  for (int c = 0; c < 8; ++c) value += weight_of(cell, c) * *grid.at(cell, c);
  return value < 0 ? -1 : 1;
}

Vec3 in_forces(const Grid& grid, Vec3 x) {
  Grid::Cell cell;
  if (!grid.find(x, cell)) return {};
  Vec3 sum{};
  for (int c = 0; c < 8; ++c) {
    const float* const f = grid.at(cell, c);
    sum += weight_of(cell, c) * Vec3{f[0], f[1], f[2]};
  }
  return sum;
}

// What is measured: it answers with a distance, or with a force for one of the laws.
struct Contestant {
  std::string name, kind;
  std::function<Answer(Vec3)> closest;               // empty: it tells forces
  std::function<Vec3(Vec3, int)> force;
  std::function<double(Vec3)> side;                  // empty: it is exact
  std::function<void(Vec3)> prepare = [](Vec3) {};   // for a place that will be asked
  std::function<void()> forget = [] {};
  std::function<double()> bytes, build_time;
};

struct Setting {
  const std::string& mesh;
  size_t triangles;
  Way way;
  const std::vector<Vec3>& path;
  const std::vector<Answer>& exact;
  const std::vector<double>& sides;
  double clock;
};

double timed(const Contestant& contestant, Vec3 x, double clock) {
  const int64_t begin = now_ns();
  if (contestant.closest) {
    const Answer answer = contestant.closest(x);
    asm volatile("" : : "g"(&answer) : "memory");
  } else {
    const Vec3 force = contestant.force(x, 0);
    asm volatile("" : : "g"(&force) : "memory");
  }
  return static_cast<double>(now_ns() - begin) - clock;
}

void measure(const Contestant& contestant, const Setting& setting) {
  const bool is_slow = contestant.kind == "all triangles";
  const size_t every = is_slow ? setting.path.size() / 50 : 1;
  for (const Vec3& x : setting.path) contestant.prepare(x);
  Samples errors[2], distance_errors, evicted;
  std::vector<double> least;
  for (int round = 0; round < (is_slow ? 1 : 3); ++round) {
    contestant.forget();
    for (size_t i = 0, k = 0; i < setting.path.size(); i += every, ++k) {
      if (round == 0) least.push_back(infinity);
      least[k] = std::min(least[k], timed(contestant, setting.path[i], setting.clock));
    }
  }
  contestant.forget();
  for (size_t i = 0; i < setting.path.size(); i += every) {
    const Vec3 x = setting.path[i];
    if (setting.exact[i].distance < 1e-9) continue;  // its direction is that of the triangle
    const Answer answer = contestant.closest ? contestant.closest(x) : Answer{};
    for (int law = 0; law < 2; ++law) {
      const double side = contestant.side ? contestant.side(x) : setting.sides[i];
      const Vec3 force = contestant.closest ? force_of(answer, side, laws[law]) : contestant.force(x, law);
      errors[law].add(norm(force - force_of(setting.exact[i], setting.sides[i], laws[law])));
    }
    if (std::isfinite(answer.distance)) distance_errors.add(std::fabs(answer.distance - setting.exact[i].distance));
  }
  for (int k = 0; k < (setting.way == Way::sliding && !is_slow ? 15 : 0); ++k) {
    const size_t i = static_cast<size_t>(k) * (setting.path.size() - 1) / 15;
    timed(contestant, setting.path[i], 0);
    evict_caches();
    evicted.add(timed(contestant, setting.path[i + 1], setting.clock));
  }
  const Samples times{least};
  std::printf("%s,%zu,%s,\"%s\",%s,%.0f,%.3g,%.0f,%.0f,%.0f,%.3g,%.3g,%.3g,%.3g,%.3g,%.3g,%.3g,%.3g\n", setting.mesh.c_str(),
              setting.triangles, name_of(setting.way), contestant.name.c_str(), contestant.kind.c_str(), contestant.bytes(),
              contestant.build_time(), times.p50(), times.p99(), evicted.p50(), errors[0].p50(), errors[0].p99(),
              errors[0].max(), errors[1].p50(), errors[1].p99(), errors[1].max(), distance_errors.p99(),
              distance_errors.max());
  std::fflush(stdout);
}

Contestant of(std::shared_ptr<Method> method, const std::string& name, const std::string& kind, Vec3 shift = {}) {
  Contestant out;
  out.name = name.empty() ? method->name : name;
  out.kind = kind;
  out.closest = [method, shift](Vec3 x) { return method->closest(x + shift); };
  out.forget = [method] { method->forget(); };
  out.bytes = [method] { return method->bytes; };
  out.build_time = [method] { return method->build_time; };
  return out;
}

void chart(const std::string& name, size_t triangles, double clock) {
  const Mesh mesh = mesh_of(name, triangles);
  double tree_time = 0;
  const auto shape = shape_of(mesh, &tree_time);
  const MeshTree& tree = *shape->tree();
  std::vector<Vec3> paths[3];
  std::vector<Answer> exact[3];
  std::vector<double> sides[3];
  const Way ways[] = {Way::sliding, Way::free, Way::jumps};
  for (int w = 0; w < 3; ++w) {
    paths[w] = walk(mesh, tree, ways[w], 4000);
    for (const Vec3& x : paths[w]) {
      const MeshTree::Found found = tree.find({x, infinity});
      exact[w].push_back({std::sqrt(found.nearest.squared), found.nearest.offset});
      sides[w].push_back(side_of(tree, x));
    }
  }
  const auto measure_all = [&](const Contestant& contestant) {
    progress("%s: %s", name.c_str(), contestant.name.c_str());
    for (int w = 0; w < 3; ++w) measure(contestant, {name, mesh.count(), ways[w], paths[w], exact[w], sides[w], clock});
  };
  const auto ours = [&](std::unique_ptr<Method> method, const std::string& label, const std::string& kind, double time) {
    method->build_time = time;
    return of(std::move(method), label, kind);
  };

  measure_all(of(brute_force(mesh), "", "all triangles"));
  measure_all(ours(ours_cold(*shape), "", "ours", tree_time));
  measure_all(ours(ours_warm(*shape), "", "ours", tree_time));
  measure_all(ours(ours_felt(*shape), "", "ours", tree_time));
  for (const double allowed : {0.01, 0.1, 1.0}) {
    char label[32];
    std::snprintf(label, sizeof label, "%g N allowed", allowed);
    measure_all(ours(ours_felt(*shape, gaussian_range(allowed)), label, "accuracy", tree_time));
  }
  measure_all(of(embree_exact(mesh), "", "other searches"));
  measure_all(of(embree_single(mesh), "", "other searches"));
  if (auto method = cgal(mesh)) measure_all(of(std::move(method), "", "other searches"));

  // A level is a mesh of its own: its points and corners count, too.
  for (const Level& level : decimated(mesh, {triangles / 2, triangles / 10, triangles / 50, triangles / 250})) {
    double time = 0;
    const auto coarse = shape_of(level.mesh, &time);
    auto method = ours_warm(*coarse);
    method->bytes += static_cast<double>(level.mesh.points.size() * sizeof(Vec3) + level.mesh.corners.size() * sizeof(uint32_t));
    const std::string label = "decimated to 1/" + std::to_string((triangles + level.mesh.count() / 2) / level.mesh.count());
    Contestant contestant = ours(std::move(method), label, "decimated", level.time + time);
    contestant.side = [&coarse](Vec3 x) { return side_of(*coarse->tree(), x); };
    measure_all(contestant);
  }

  const auto closest_of = [&](Vec3 x) {
    const MeshTree::Found found = tree.find({x, infinity});
    return tree.tell(x, found, nullptr);
  };
  for (const int side : {32, 64, 128, 256}) {
    const std::string size = std::to_string(side) + "^3";
    {
      auto grid = std::make_shared<Grid>(mesh, side, 1);
      Contestant c;
      c.name = "distances " + size;
      c.kind = "grid of distances";
      c.closest = [grid](Vec3 x) { return in_distances(*grid, x); };
      c.side = [grid](Vec3 x) { return side_in(*grid, x); };
      c.prepare = [grid, &closest_of](Vec3 x) {
        grid->prepare(x, [&](Vec3 place, float* value) {
          const Closest closest = closest_of(place);
          *value = static_cast<float>(closest.side == Side::front ? closest.distance : -closest.distance);
        });
      };
      c.bytes = [grid] { return grid->bytes(); };
      c.build_time = [grid] { return grid->build_time(); };
      measure_all(c);
    }
    std::shared_ptr<Grid> grids[2] = {std::make_shared<Grid>(mesh, side, 3), std::make_shared<Grid>(mesh, side, 3)};
    Contestant c;
    c.name = "forces " + size;
    c.kind = "grid of forces";
    c.force = [grids](Vec3 x, int law) { return in_forces(*grids[law], x); };
    c.prepare = [grids, &closest_of](Vec3 x) {
      for (int law = 0; law < 2; ++law) {
        grids[law]->prepare(x, [&](Vec3 place, float* values) {
          const Closest closest = closest_of(place);
          const double side = closest.side == Side::front ? 1 : -1;
          const Vec3 force = side * laws[law](side * closest.distance) * closest.direction;
          values[0] = static_cast<float>(force.x);
          values[1] = static_cast<float>(force.y);
          values[2] = static_cast<float>(force.z);
        });
      }
    };
    c.bytes = [grids] { return grids[0]->bytes(); };
    c.build_time = [grids] { return grids[0]->build_time(); };
    measure_all(c);
  }

  // The same mesh where maps have it: metres east and north in a zone of UTM.
  constexpr Vec3 utm{500'000, 4'650'000, 1'200};
  Mesh moved = mesh;
  for (Vec3& p : moved.points) p += utm;
  measure_all(of(embree_single(moved), "Embree, float, at UTM", "at UTM", utm));
  const auto moved_shape = shape_of(moved);
  auto method = ours_warm(*moved_shape);
  method->build_time = tree_time;
  measure_all(of(std::move(method), "ours, warm, at UTM", "at UTM", utm));
}

}  // namespace

int main(int count, char** words) {
  const size_t triangles = count > 1 ? std::stoul(words[1]) : 270'000;
  Samples costs;
  for (int i = 0; i < 10'001; ++i) {
    const int64_t begin = now_ns();
    costs.add(static_cast<double>(now_ns() - begin));
  }
  std::printf("mesh,triangles,way,method,kind,bytes,build_s,median_ns,p99_ns,evicted_ns,gaussian_p50_N,gaussian_p99_N,"
              "gaussian_max_N,wall_p50_N,wall_p99_N,wall_max_N,distance_p99_m,distance_max_m\n");
  for (const char* name : {"scan", "terrain", "part"}) chart(name, triangles, costs.p50());
}
