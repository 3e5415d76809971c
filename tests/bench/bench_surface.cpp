// What each thing that a surface does adds to a tick, beside the same solid without it: a point that strokes a plane or a ball of
// 2000 triangles, 1 mm deep, in time of this thread. README.md says how to read it.
//
//   bench_surface [plain]
//
// plain: the first two rows only, which a library without surfaces can run too.
#include <ctime>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "figures.h"
#include "scenes/scenes.h"

using namespace scenes;
using bench::Samples;

namespace {

double cpu_ns() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e9 * static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_nsec);
}

enum class Row { plain, friction, sticks, texture, impact, radius, all };
constexpr int count = 7;
const char* const names[count] = {"plain", "friction", "stick and slip", "texture", "impact", "radius", "all of them"};

struct Rig {
  Scene scene = make_scene();
  Shape shape;
  Surface surface;
  Tool tool;
  double time = 0;
  bool is_mesh;

  Rig(Row row, bool mesh) : is_mesh(mesh) {
    const auto has = [row](Row one) { return row == one || row == Row::all; };
    fs_object o = fs_object_init("solid", is_mesh ? FS_PRIMITIVE_MESH : FS_PRIMITIVE_PLANE);
    if (is_mesh) shape = make_mesh(sphere_mesh(0.05, 2000)), o.shape = shape.get(), o.pose = at(0, 0, -0.05);
    o.contact.keep = FS_KEEP_FRONT;
    o.contact.stiffness = 1000;
    o.contact.limit = 10;
    if (row == Row::friction) o.contact.friction = 0.3;
    fs_surface_settings settings = fs_surface_settings_init();
    if (has(Row::sticks)) settings.static_friction = 0.5, settings.dynamic_friction = 0.3, settings.slip_distance = 1e-3;
    if (has(Row::impact)) settings.impact_gain = 10, settings.impact_frequency = 100, settings.impact_decay = 1;
    std::vector<double> heights;
    if (has(Row::texture)) {
      settings.columns = settings.rows = 64;
      settings.column_width = settings.row_width = 1e-3;
      settings.repeats = true;
      for (int i = 0; i < 64 * 64; ++i) heights.push_back(-5e-5 * (1 + std::sin(0.3 * i)));
    }
    if (row > Row::friction && row != Row::radius) {
      surface = heights.empty() ? make_surface(settings) : make_texture(settings, heights);
      o.surface = surface.get();
    }
    if (has(Row::radius) && !is_mesh) require(fs_scene_set_tool_radius(scene.get(), 0.002), "fs_scene_set_tool_radius");
    require(fs_object_set(scene.get(), &o), "fs_object_set");
    tool = make_tool(scene.get());
    for (int i = 0; i < 100; ++i) tick(0.01 - 1.1e-4 * i, 0.1);  // it comes and hits the surface
  }
  void tick(double height, double speed) {
    fs_state state{};
    time += 0.001;
    state.time = time;
    state.pose = at(0.01 * std::sin(3 * time), 0.01 * std::cos(2 * time), height);
    state.twist.linear = {0, 0, -speed};
    fs_response response;
    require(fs_evaluate(tool.get(), &state, &response), "fs_evaluate");
  }
  double ns_of(int ticks) {
    const double begin = cpu_ns();
    for (int i = 0; i < ticks; ++i) tick(is_mesh ? -0.005 : -0.001, 0);
    return (cpu_ns() - begin) / ticks;
  }
};

// ns a tick of a thousand points that all draw the hand.
double ns_of_crowd(double radius) {
  const Scene scene = make_scene();
  Random random(1);
  Content content;
  for (int i = 0; i < 1000; ++i) content.add("p" + std::to_string(i), FS_PRIMITIVE_POINT, random.in_box(0.1)).front = attract(1, 1);
  fill(scene.get(), content);
  require(fs_scene_set_tool_radius(scene.get(), radius), "fs_scene_set_tool_radius");
  const Tool tool = make_tool(scene.get());
  fs_state state{};
  fs_response response;
  constexpr int ticks = 300;
  double begin = 0;
  for (int i = -10; i < ticks; ++i) {
    if (i == 0) begin = cpu_ns();
    state.time = 1 + 0.001 * i;
    state.pose = at(0.001 * i, 0, 0);
    require(fs_evaluate(tool.get(), &state, &response), "fs_evaluate");
  }
  return (cpu_ns() - begin) / ticks;
}

}  // namespace

int main(int argc, char** argv) {
  constexpr int rounds = 60, ticks = 500;
  const int rows = argc > 1 && std::string(argv[1]) == "plain" ? 2 : count;
  std::puts("| a surface | solid | ns a tick: median | p99 | beside plain, ns | ratio |");
  std::puts("|---|---|---|---|---|---|");
  for (const bool is_mesh : {false, true}) {
    Samples taken[count], beside[count], ratios[count];
    for (int round = 0; round < rounds; ++round) {
      double plain = 0;
      for (int row = 0; row < rows; ++row) {
        if (is_mesh && static_cast<Row>(row) == Row::radius) continue;  // a solid mesh refuses it
        const double ns = Rig(static_cast<Row>(row), is_mesh).ns_of(ticks);
        if (row == 0) plain = ns;
        taken[row].add(ns);
        beside[row].add(ns - plain);
        ratios[row].add(ns / plain);
      }
    }
    for (int row = 0; row < rows; ++row) {
      if (taken[row].values.empty()) continue;
      std::printf("| %-14s | %-5s | %5.0f | %5.0f | %5.0f | %5.2f |\n", names[row], is_mesh ? "mesh" : "plane", taken[row].p50(),
                  taken[row].p99(), beside[row].p50(), ratios[row].p50());
    }
  }
  if (rows == count) {
    Samples points, balls, ratios;
    for (int round = 0; round < rounds; ++round) {
      points.add(ns_of_crowd(0));
      balls.add(ns_of_crowd(0.002));
      ratios.add(balls.values.back() / points.values.back());
    }
    std::printf("\n1000 points: %.1f us a tick; for a tool with a radius %.1f us, %.2f times\n", points.p50() / 1e3, balls.p50() / 1e3,
                ratios.p50());
  }
  bench::print_machine();
}
