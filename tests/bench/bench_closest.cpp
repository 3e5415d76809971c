// The closest point of a mesh: this library beside others, in one run and for the same places. README.md says how to read it.
//
//   bench_closest [--mesh scan|terrain|part] [--triangles N]... [--ticks N] [--evicted N]
//
// Without --mesh it goes through all of them. With CLOSEST_PEER=FILE the search of a shared library (peer.h) takes part.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "closest_methods.h"
#include "figures.h"
#include "scenes/scenes.h"
#include "shape/mesh/mesh_tree.h"

using namespace bench;

namespace {

struct Options {
  std::vector<std::string> meshes{"scan", "terrain", "part"};
  std::vector<size_t> triangles;
  size_t ticks = 20'000, evicted = 60;
};

Options options_of(int count, char** words) {
  Options out;
  for (int i = 1; i + 1 < count; i += 2) {
    const std::string word = words[i], value = words[i + 1];
    if (word == "--mesh") {
      out.meshes = {value};
    } else if (word == "--triangles") {
      out.triangles.push_back(std::stoul(value));
    } else if (word == "--ticks") {
      out.ticks = std::stoul(value);
    } else if (word == "--evicted") {
      out.evicted = std::stoul(value);
    } else {
      std::fprintf(stderr, "there is no option %s\n", word.c_str());
      std::exit(2);
    }
  }
  if (out.triangles.empty()) out.triangles = {70'000, 1'000'000};
  return out;
}

double clock_cost() {
  Samples costs;
  for (int i = 0; i < 10'001; ++i) {
    const int64_t begin = now_ns();
    costs.add(static_cast<double>(now_ns() - begin));
  }
  return costs.p50();
}

struct Row {
  Method* method;
  std::vector<double> least;  // ns of each place: the least of the rounds, so that an interrupt does not count
  Samples evicted;            // ns
  double wrong = 0;           // m, the largest deviation of a distance
};

double timed(Row& row, fs::Vec3 x, Answer& answer) {
  const int64_t begin = now_ns();
  answer = row.method->closest(x);
  return static_cast<double>(now_ns() - begin);
}

// The methods take turns after some places each, so that what else the machine does disturbs all alike.
void time_hot(std::vector<Row>& rows, const std::vector<fs::Vec3>& path, double clock) {
  constexpr size_t block = 200;
  constexpr int rounds = 3;
  std::vector<double> distances(path.size());
  for (Row& row : rows) row.least.assign(path.size(), std::numeric_limits<double>::infinity());
  for (int round = 0; round < rounds; ++round) {
    for (Row& row : rows) row.method->forget();
    for (size_t begin = 0; begin < path.size(); begin += block) {
      for (Row& row : rows) {
        for (size_t i = begin; i < std::min(begin + block, path.size()); ++i) {
          Answer answer;
          row.least[i] = std::min(row.least[i], timed(row, path[i], answer) - clock);
          if (&row == &rows[0]) distances[i] = answer.distance;  // it is exact
          if (std::isfinite(answer.distance) || distances[i] < felt_range) {
            row.wrong = std::max(row.wrong, std::fabs(answer.distance - distances[i]));
          }
        }
      }
    }
  }
}

// What a call costs with empty caches that looks at nothing.
double evicted_call() {
  struct Nothing : Method {
    Answer closest(fs::Vec3) override { return {}; }
  };
  const std::unique_ptr<Method> nothing = std::make_unique<Nothing>();
  Row row{nothing.get(), {}, {}, 0};
  for (int i = 0; i < 40; ++i) {
    evict_caches();
    Answer answer;
    row.evicted.add(timed(row, {}, answer));
  }
  return row.evicted.p50();
}

// Every place is asked once to make it the last place of a warm method, and the next one with empty caches.
void time_evicted(std::vector<Row>& rows, const std::vector<fs::Vec3>& path, size_t count) {
  const double call = count > 0 ? evicted_call() : 0;
  for (size_t k = 0; k < count; ++k) {
    const size_t i = k * (path.size() - 1) / count;
    for (Row& row : rows) {
      Answer answer;
      row.method->closest(path[i]);
      evict_caches();
      row.evicted.add(timed(row, path[i + 1], answer) - call);
    }
  }
}

void print(const std::vector<Row>& rows, const Row& peer) {
  const auto quantile = [](const std::vector<double>& values, double part) { return Samples{values}.quantile(part); };
  const double median = quantile(peer.least, 0.5), p99 = quantile(peer.least, 0.99), most = quantile(peer.least, 1);
  for (const Row& row : rows) {
    const double my_median = quantile(row.least, 0.5), my_p99 = quantile(row.least, 0.99);
    std::printf("| %-27s | %7.0f | %7.0f | %8.0f | %5.2f | %5.2f | %5.2f |", row.method->name.c_str(), my_median, my_p99,
                quantile(row.least, 1), median / my_median, p99 / my_p99, most / quantile(row.least, 1));
    if (row.evicted.values.empty()) {
      std::printf(" | |");
    } else {
      std::printf(" %7.0f | %5.2f |", row.evicted.p50(), peer.evicted.p50() / row.evicted.p50());
    }
    std::printf(" %.1e |\n", row.wrong);
  }
  std::fflush(stdout);
}

void compare(const std::string& name, size_t triangles, const Options& options, double clock) {
  const Mesh mesh = mesh_of(name, triangles);
  double tree_time = 0;
  const auto shape = shape_of(mesh, &tree_time);
  Methods methods;
  methods.push_back(ours_cold(*shape));
  methods.push_back(ours_warm(*shape));
  methods.push_back(ours_felt(*shape));
  for (auto& method : methods) method->build_time = tree_time;
  const size_t embree = methods.size();
  methods.push_back(embree_exact(mesh));
  if (auto method = cgal(mesh)) methods.push_back(std::move(method));
  if (const char* file = std::getenv("CLOSEST_PEER")) methods.push_back(peer(mesh, file));

  std::printf("\n%s, %zu triangles\n\n| method | bytes a triangle | built in, s |\n|---|---|---|\n", name.c_str(), mesh.count());
  for (const auto& method : methods) {
    std::printf("| %-27s | %5.0f | %5.2f |\n", method->name.c_str(), method->bytes / static_cast<double>(mesh.count()),
                method->build_time);
  }
  for (const Way way : {Way::sliding, Way::free, Way::jumps}) {
    std::vector<Row> rows;
    for (const auto& method : methods) rows.push_back({method.get(), {}, {}, 0});
    const auto path = walk(mesh, *shape->tree(), way, way == Way::jumps ? options.ticks / 5 : options.ticks);
    time_hot(rows, path, clock);
    time_evicted(rows, path, way == Way::sliding ? options.evicted : 0);
    std::printf("\n%s, %s:\n\n| method | median, ns | p99 | max | Embree's median / its | p99 | max | evicted: median | "
                "Embree's / its | wrong by, m |\n|---|---|---|---|---|---|---|---|---|---|\n",
                name.c_str(), name_of(way));
    print(rows, rows[embree]);
  }
}

// The worst place there is, in a servo: all triangles are equally near.
void tick_in_a_sphere() {
  const Mesh mesh = sphere(328'000);
  double tree_time = 0;
  const auto internal = shape_of(mesh, &tree_time);
  Samples whole;
  for (int i = 0; i < 5; ++i) {
    const int64_t begin = now_ns();
    internal->tree()->find({{}, std::numeric_limits<double>::infinity()});
    whole.add(static_cast<double>(now_ns() - begin));
  }
  scenes::Content content;
  fs_object& o = content.add_shape("sphere", scenes::make_mesh({mesh.points, mesh.corners}));
  o.front = o.back = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, 3, 0.05, 10);
  const scenes::Scene scene = scenes::make_scene();
  scenes::fill(scene.get(), content);
  const scenes::Device device = scenes::open_device("sim:?hold=0,0,0");
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  const scenes::Servo servo = scenes::start_servo(scene.get(), device.get(), options);
  Samples ticks;
  double bound = 0;
  for (int i = 0; i < 3000; ++i) {
    timespec begin, end;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &begin);
    fs_servo_step(servo.get(), 1);
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &end);
    if (i < 1000) continue;  // it ramps up, and the handle comes to rest
    ticks.add(1e9 * static_cast<double>(end.tv_sec - begin.tv_sec) + static_cast<double>(end.tv_nsec - begin.tv_nsec));
    fs_response response;
    scenes::require(fs_scene_get_hand(scene.get(), nullptr, &response, nullptr), "fs_scene_get_hand");
    bound = std::max(bound, response.error_bound);
  }
  std::printf("\ncentre of a sphere of %zu triangles: a search of all %.1f ms; a servo's tick p50 %.1f us, p99 %.1f us, max "
              "%.1f us of CPU; error_bound %.4f N\n",
              mesh.count(), 1e-6 * whole.p50(), 1e-3 * ticks.p50(), 1e-3 * ticks.p99(), 1e-3 * ticks.max(), bound);
}

}  // namespace

int main(int count, char** words) {
  const Options options = options_of(count, words);
  print_machine();
  const double clock = clock_cost();
  std::printf("a look at the clock takes %.0f ns, which is subtracted\n", clock);
  for (const std::string& name : options.meshes) {
    for (const size_t triangles : options.triangles) compare(name, triangles, options, clock);
  }
  tick_in_a_sphere();
}
