// What an evaluation, a tick and a change cost, through the C interface. Every run includes the minimum: an empty
// scene. p50, p99 and max are of single calls, each between two looks at the clock (whose own cost is the row clock).
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <vector>

#include "scenes/fake_device.h"
#include "scenes/scenes.h"

using namespace scenes;
using benchmark::State;

// Times each call of f() alone, not what comes between them, and leaves the percentiles beside the mean.
static void nothing() {}
template <class F, class G = void (*)()>
static void each_call(State& state, F f, G between = nothing) {
  using Clock = std::chrono::steady_clock;
  std::vector<double> seconds;
  seconds.reserve(1 << 20);
  for (auto _ : state) {
    const auto begin = Clock::now();
    f();
    const double s = std::chrono::duration<double>(Clock::now() - begin).count();
    state.SetIterationTime(s);
    if (seconds.size() < seconds.capacity()) seconds.push_back(s);
    between();
  }
  std::sort(seconds.begin(), seconds.end());
  const auto nanoseconds = [&](double part) { return 1e9 * seconds[static_cast<size_t>(part * (seconds.size() - 1))]; };
  state.counters["p50_ns"] = nanoseconds(0.5);
  state.counters["p99_ns"] = nanoseconds(0.99);
  state.counters["max_ns"] = nanoseconds(1);
}

static void clock_itself(State& state) {
  each_call(state, [] {});
}
BENCHMARK(clock_itself)->Name("clock")->UseManualTime();

// The hand walks 0.1 mm an evaluation, as at 1 kHz and 0.1 m/s, or jumps about. At one time: only the hand moves.
static std::vector<fs_state> walk(double half) {
  std::vector<fs_state> states(4096);
  const double turns = 0.0001 * static_cast<double>(states.size()) / (2 * 3.14159265358979 * half);
  for (size_t k = 0; k < states.size(); ++k) {
    const double a = 2 * 3.14159265358979 * turns * static_cast<double>(k) / static_cast<double>(states.size());
    states[k] = {};
    states[k].pose = at(half * std::cos(a), half * std::sin(a), 0.3 * half * std::sin(3 * a));
    states[k].time = 1;
  }
  return states;
}
static std::vector<fs_state> jumps(double half) {
  Random random(1);
  std::vector<fs_state> states(4096);
  for (fs_state& s : states) {
    s = {};
    s.pose = at(random.in_box(half));
    s.time = 1;
  }
  return states;
}

struct Hand {
  Scene scene = make_scene();
  Content content;
  Tool tool;
  std::vector<fs_state> states;
  size_t next = 0;

  Hand(Content c, std::vector<fs_state> s) : content(std::move(c)), states(std::move(s)) {
    fill(scene.get(), content);
    tool = make_tool(scene.get());
  }
  double evaluate() {
    fs_response response;
    fs_evaluate(tool.get(), &states[next++ % states.size()], &response);
    return response.wrench.force.x;
  }
};

static void evaluate(State& state, Content content, std::vector<fs_state> states) {
  Hand hand(std::move(content), std::move(states));
  double sum = 0;
  for (auto _ : state) benchmark::DoNotOptimize(sum += hand.evaluate());
}

static void empty(State& state) { evaluate(state, Content(), walk(0.04)); }
BENCHMARK(empty)->Name("evaluate/empty");

// n points that are all felt, and n of which few are near.
static void points(State& state) {
  Content content;
  Random random(2);
  for (int i = 0; i < state.range(0); ++i) {
    content.add("p" + std::to_string(i), FS_PRIMITIVE_POINT, random.in_box(0.05)).front = attract(100, 1);
  }
  evaluate(state, std::move(content), walk(0.04));
}
BENCHMARK(points)->Name("evaluate/points_felt")->Arg(1)->Arg(10)->Arg(1000);
static void sparse(State& state) { evaluate(state, crowd(state.range(0)), walk(0.04)); }
BENCHMARK(sparse)->Name("evaluate/points_near")->Arg(1000)->Arg(100000);

static void mesh_walk(State& state) { evaluate(state, ball(state.range(0)), walk(0.04)); }
BENCHMARK(mesh_walk)->Name("evaluate/mesh_walk")->Arg(12)->Arg(1000)->Arg(70000)->Arg(276000);
static void mesh_jumps(State& state) { evaluate(state, ball(state.range(0)), jumps(0.05)); }
BENCHMARK(mesh_jumps)->Name("evaluate/mesh_jumps")->Arg(12)->Arg(1000)->Arg(70000)->Arg(276000);
static void terrain_walk(State& state) { evaluate(state, ground(state.range(0)), walk(0.06)); }
BENCHMARK(terrain_walk)->Name("evaluate/terrain_walk")->Arg(70000)->Arg(276000);

static void mesh_latency(State& state) {
  Hand hand(ball(state.range(0)), walk(0.04));
  each_call(state, [&] { benchmark::DoNotOptimize(hand.evaluate()); });
}
BENCHMARK(mesh_latency)->Name("latency/mesh_walk")->Arg(70000)->Arg(276000)->UseManualTime();
static void mesh_jump_latency(State& state) {
  Hand hand(ball(state.range(0)), jumps(0.05));
  each_call(state, [&] { benchmark::DoNotOptimize(hand.evaluate()); });
}
BENCHMARK(mesh_jump_latency)->Name("latency/mesh_jumps")->Arg(70000)->Arg(276000)->UseManualTime();

// The scenes that the tests use, too.
static void named(State& state) {
  const Named& scene = all_scenes()[static_cast<size_t>(state.range(0))];
  state.SetLabel(scene.name);
  evaluate(state, scene.build(), walk(0.04));
}
BENCHMARK(named)->Name("evaluate/scene")->DenseRange(0, 9);

// A change beside n objects, without a servo or with a virtual one that ticks after every 40 changes. The change is
// always of the same object, which is then in the cache, or of any object, which shows the cost of memory.
static void change_beside(State& state, bool with_servo, bool moves, bool is_one = false) {
  FakeDevice fake("bench");
  Scene scene = make_scene();
  const Content content = crowd(state.range(0));
  fill(scene.get(), content);
  Device device;
  Servo servo;
  if (with_servo) {
    device = fake.open();
    fs_servo_options options = fs_servo_options_init();
    options.mode = FS_SERVO_VIRTUAL;
    options.rate = 1000;
    servo = start_servo(scene.get(), device.get(), options);
    require(fs_servo_step(servo.get(), 10), "fs_servo_step");
  }
  Random random(3);
  const fs_twist twist{{0.01, 0, 0}, {}};
  uint64_t number = 0;
  const auto change = [&] {
    const fs_object& o = content.objects[is_one ? 0 : random.below(content.objects.size())];
    if (moves) {
      fs_object_move(scene.get(), o.name, &o.pose, &twist, FS_NOW);
    } else {
      fs_object_set(scene.get(), &o);
    }
  };
  each_call(state, change, [&] {
    if (with_servo && !is_one && ++number % 40 == 0) fs_servo_step(servo.get(), 1);
  });
}
static void move(State& state) { change_beside(state, false, true); }
static void move_with_servo(State& state) { change_beside(state, true, true); }
static void move_one_with_servo(State& state) { change_beside(state, true, true, true); }
static void set(State& state) { change_beside(state, false, false); }
static void set_with_servo(State& state) { change_beside(state, true, false); }
BENCHMARK(move)->Name("move/beside")->Arg(1)->Arg(100000)->UseManualTime();
BENCHMARK(move_with_servo)->Name("move/beside_with_servo")->Arg(1)->Arg(100000)->UseManualTime();
BENCHMARK(move_one_with_servo)->Name("move/one_beside_with_servo")->Arg(1)->Arg(100000)->UseManualTime();
BENCHMARK(set)->Name("set/beside")->Arg(1)->Arg(100000)->UseManualTime();
BENCHMARK(set_with_servo)->Name("set/beside_with_servo")->Arg(1)->Arg(100000)->UseManualTime();

// A whole tick: a device that costs nothing, and the simulator.
static void tick(State& state, const Content& content, bool simulator) {
  FakeDevice fake("bench");
  fake.state.pose = at(0.03, 0.02, -0.01);
  const Scene scene = make_scene();
  fill(scene.get(), content);
  const Device device = simulator ? open_device("sim:?path=figure8") : fake.open();
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  options.rate = 1000;
  const Servo servo = start_servo(scene.get(), device.get(), options);
  each_call(state, [&] { fs_servo_step(servo.get(), 1); });
}
static void tick_empty(State& state) { tick(state, Content(), false); }
static void tick_testbed(State& state) { tick(state, testbed(), false); }
static void tick_simulated(State& state) { tick(state, testbed(), true); }
static void tick_crowd(State& state) { tick(state, crowd(100000), false); }
BENCHMARK(tick_empty)->Name("tick/empty")->UseManualTime();
BENCHMARK(tick_testbed)->Name("tick/testbed")->UseManualTime();
BENCHMARK(tick_simulated)->Name("tick/testbed_on_simulator")->UseManualTime();
BENCHMARK(tick_crowd)->Name("tick/100000_points")->UseManualTime();

// What the protections of a servo cost: all that an option can switch off is off, or the default options. The hand goes to and
// fro through the scene, 0.1 mm a tick.
static void protections(State& state, bool is_protected) {
  const Named& named = all_scenes()[static_cast<size_t>(state.range(0))];
  state.SetLabel(named.name);
  FakeDevice fake("bench");
  const Scene scene = make_scene();
  const Content content = named.build();
  fill(scene.get(), content);
  const Device device = fake.open();
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  options.rate = 1000;
  if (!is_protected) {
    options.slew_limit = options.speed_limit = options.ramp = options.fade = options.blend = options.damping =
        options.max_stiffness = -1;
  }
  const Servo servo = start_servo(scene.get(), device.get(), options);
  require(fs_servo_step(servo.get(), 2000), "fs_servo_step");
  int place = 0;
  each_call(state, [&] { fs_servo_step(servo.get(), 1); }, [&] {
    place = (place + 1) % 2000;
    const double way = 1e-4 * (place < 1000 ? place : 2000 - place) - 0.05;  // m
    fake.state.pose = at(way, 0.4 * way, -0.3 * way);
  });
}
static void tick_raw(State& state) { protections(state, false); }
static void tick_protected(State& state) { protections(state, true); }
BENCHMARK(tick_raw)->Name("tick/protections_off")->DenseRange(0, 9)->UseManualTime();
BENCHMARK(tick_protected)->Name("tick/protections_on")->DenseRange(0, 9)->UseManualTime();

// Points a second of a plot.
static void field(State& state) {
  const Named& named = all_scenes()[static_cast<size_t>(state.range(0))];
  state.SetLabel(named.name);
  const Scene scene = make_scene();
  const Content content = named.build();
  fill(scene.get(), content);
  Random random(4);
  std::vector<fs_vec3> places(10000), forces(places.size());
  for (fs_vec3& x : places) x = random.in_box(0.08);
  for (auto _ : state) {
    fs_evaluate_field(scene.get(), nullptr, 1, places.data(), places.size(), forces.data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(places.size()));
}
BENCHMARK(field)->Name("field")->Arg(0)->Arg(1)->Arg(3)->Arg(8);

// The cost of building a shape before it can be felt.
static void build(State& state) {
  const MeshData mesh = sphere_mesh(0.04, static_cast<size_t>(state.range(0)));
  for (auto _ : state) {
    const Shape shape = make_mesh(mesh);
    fs_shape_build(shape.get());
  }
}
BENCHMARK(build)->Name("build/mesh")->Arg(70000)->Arg(276000)->Unit(benchmark::kMillisecond);
