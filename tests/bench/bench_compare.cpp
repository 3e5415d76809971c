// What the goals of the core are about, for two builds of the library to be compared: tests/bench/compare runs this one
// program with each of them in turn, so only the C contract is used. bench_compare PART prints one line a figure: name,
// unit, value, with tabs between; bench_compare --list prints the parts.
#include <malloc.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>

#include "client.h"
#include "device.h"
#include "figures.h"
#include "rig.h"
#include "scenes/fake_device.h"
#include "scenes/scenes.h"

using namespace scenes;
using bench::Samples;

namespace {

constexpr size_t many = 100'000;

void figure(const std::string& name, const char* unit, double value) {
  std::printf("%s\t%s\t%.6g\n", name.c_str(), unit, value);
}

template <class F>
double nanoseconds(F f) {
  const int64_t begin = bench::now_ns();
  f();
  return static_cast<double>(bench::now_ns() - begin);
}
double mean(const Samples& samples) {
  double sum = 0;
  for (const double value : samples.values) sum += value;
  return sum / static_cast<double>(samples.values.size());
}

// A hand that goes straight at 0.5 m/s, which is 0.5 mm a tick, and turns back at the walls of a cube.
class Walk {
 public:
  explicit Walk(double half, double step = 0.0005) : half_(half), step_(step * unit(fs_vec3{1, 0.83, 0.59})) {}
  fs_vec3 next() {
    advance(place_.x, step_.x);
    advance(place_.y, step_.y);
    advance(place_.z, step_.z);
    return place_;
  }

 private:
  void advance(double& x, double& step) const {
    if (std::fabs(x + step) > half_) step = -step;
    x += step;
  }
  const double half_;
  fs_vec3 step_, place_{};
};

// A virtual servo on a device that takes hardly any time.
struct Stepped {
  FakeDevice fake;
  Scene scene = make_scene();
  Content content;
  Device device;
  Servo servo;

  explicit Stepped(Content c) : fake("compare" + std::to_string(++count)), content(std::move(c)) {
    fill(scene.get(), content);
    device = fake.open();
    fs_servo_options options = fs_servo_options_init();
    options.mode = FS_SERVO_VIRTUAL;
    options.rate = 1000;
    options.fade = 0.01;
    options.ramp = options.speed_limit = -1;
    servo = start_servo(scene.get(), device.get(), options);
    for (int i = 0; i < 20; ++i) tick({});
  }
  double tick(fs_vec3 hand) {  // ns
    fake.state.pose.position = hand;
    return nanoseconds([&] { fs_servo_step(servo.get(), 1); });
  }
  uint32_t felt() const {
    fs_response response;
    require(fs_scene_get_hand(scene.get(), nullptr, &response, nullptr), "fs_scene_get_hand");
    return response.felt_count;
  }

 private:
  static inline int count = 0;
};

// Points all over a cube, of which a hand feels ten wherever it is; and ten that it feels everywhere.
constexpr double half_cube = 0.1;  // m
Content points_in_cube(double half = half_cube) {
  Content content;
  Random random(1);
  const double share = 10 / static_cast<double>(many);  // part of the cube that a point fills
  const double reach = 2 * half * std::cbrt(share * 3 / (4 * 3.14159265358979));
  for (size_t i = 0; i < many; ++i) {
    fs_object& o = content.add("p" + std::to_string(i), FS_PRIMITIVE_POINT, random.in_box(half));
    o.front = attract(100, 1);
    o.front.reach = reach;
  }
  return content;
}
Content ten_points() {
  Content content;
  Random random(1);
  for (int i = 0; i < 10; ++i) {
    content.add("p" + std::to_string(i), FS_PRIMITIVE_POINT, random.in_box(half_cube)).front = attract(100, 1);
  }
  return content;
}

void far_in_cube(double half, const std::string& cube) {
  Stepped crowd(points_in_cube(half)), ten(ten_points());
  Walk walk(0.9 * half), ten_walk(0.9 * half_cube);
  Samples times, ten_times;
  double felt = 0;
  const int64_t end = bench::now_ns() + 2'000'000'000;
  while (bench::now_ns() < end && times.values.size() < 200'000) {
    for (int i = 0; i < 20; ++i) {
      times.add(1e-3 * crowd.tick(walk.next()));
      felt += crowd.felt();
    }
    for (int i = 0; i < 200; ++i) ten_times.add(1e-3 * ten.tick(ten_walk.next()));
  }
  const std::string name = "tick, 100,000 points in a cube of " + cube + ", about ten felt";
  figure(name + ": objects felt", "", felt / static_cast<double>(times.values.size()));
  figure(name + ": p50", "us", times.p50());
  figure(name + ": ten alone, p50", "us", ten_times.p50());
  figure(name + ": more than ten alone, p50", "us", times.p50() - ten_times.p50());
  figure(name + ": more, p99", "us", times.p99() - ten_times.p99());
  figure(name + ": more, mean", "us", mean(times) - mean(ten_times));
}

void part_far() {
  far_in_cube(half_cube, "0.2 m");
  far_in_cube(0.5, "1 m");
}

// The ticks after a change that affects everything.
void part_sudden() {
  Stepped crowd(points_in_cube());
  Walk walk(0.5 * half_cube);
  Random random(2);
  struct After {
    Samples first, others;
  };
  const auto look = [&](After& times, fs_vec3 hand, int others) {
    times.first.add(1e-3 * crowd.tick(hand));
    for (int i = 0; i < others; ++i) times.others.add(1e-3 * crowd.tick(walk.next()));
  };
  const auto report = [](const char* what, const After& times) {
    const std::string name = std::string("tick after ") + what + ", 100,000 points";
    figure(name + ": p50", "us", times.first.p50());
    figure(name + ": max", "us", times.first.max());
    figure(name + ": max of those that follow", "us", times.others.max());
  };
  After jumps, frames, moves;
  for (int i = 0; i < 100; ++i) look(jumps, random.in_box(0.9 * half_cube), 3);
  report("a jump of the hand", jumps);
  for (int i = 0; i < 40; ++i) {
    fs_frame frame = fs_frame_init();
    frame.pose.position = random.in_box(0.02);
    frame.pose.orientation = turn(random.direction(), 0.2);
    require(fs_scene_set_frame(crowd.scene.get(), &frame), "fs_scene_set_frame");
    look(frames, walk.next(), 15);
  }
  report("another frame", frames);
  const fs_frame frame = fs_frame_init();
  require(fs_scene_set_frame(crowd.scene.get(), &frame), "fs_scene_set_frame");
  for (int i = 0; i < 15; ++i) crowd.tick(walk.next());
  const fs_twist still{};
  Samples posts;
  for (int i = 0; i < 8; ++i) {
    const fs_vec3 way = random.in_box(0.01);
    posts.add(1e-6 * nanoseconds([&] {
      require(fs_scene_begin(crowd.scene.get()), "fs_scene_begin");
      for (const fs_object& o : crowd.content.objects) {
        fs_pose pose = o.pose;
        pose.position = pose.position + way;
        require(fs_object_move(crowd.scene.get(), o.name, &pose, &still, FS_NOW), "fs_object_move");
      }
      require(fs_scene_commit(crowd.scene.get()), "fs_scene_commit");
    }));
    look(moves, walk.next(), 5);
  }
  report("a group that moves all", moves);
  figure("a group that moves all of 100,000 points, the calls: p50", "ms", posts.p50());
}

// A thousand objects, all felt.
Content thousand_points() {
  Content content;
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    content.add("p" + std::to_string(i), FS_PRIMITIVE_POINT, random.in_box(0.05)).front = attract(100, 1);
  }
  return content;
}
const fs_profile profiles[]{
    fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, 1, 0.05, 1),
    fs_profile_init(FS_PROFILE_QUADRATIC, FS_SENSE_ATTRACTIVE, 100, 0.1, 1),
    fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_REPULSIVE, 0.01, 0, 1),
    fs_profile_init(FS_PROFILE_LINEAR_DECREASING, FS_SENSE_REPULSIVE, -2, 1, 1),
    attract(10, 1),
};
Content thousand_formulas() {
  Content content;
  Random random(3);
  for (size_t i = 0; i < 1000; ++i) {
    content.add("p" + std::to_string(i), FS_PRIMITIVE_POINT, random.in_box(0.05)).front = profiles[i % std::size(profiles)];
  }
  return content;
}
Content thousand_mixed() {
  Content content;
  Random random(4);
  const Content lines = [] {
    Content out;
    const std::vector<fs_vec3> points = helix(0.02, 0.03, 1, 8);
    out.shapes.push_back(make_polyline(points.data(), points.size(), false));
    out.shapes.push_back(make_mesh(box_mesh({0.01, 0.02, 0.015})));
    return out;
  }();
  for (int i = 0; i < 1000; ++i) {
    const std::string name = "m" + std::to_string(i);
    const fs_profile& profile = profiles[static_cast<size_t>(i / 10 % 5)];
    fs_object* o;
    switch (i % 10) {  // six points, two planes, a polyline, a mesh
      case 6: case 7: o = &content.add(name, FS_PRIMITIVE_PLANE, random.in_box(0.05)); break;
      case 8:
        o = &content.add(name, FS_PRIMITIVE_POLYLINE, random.in_box(0.05));
        o->shape = lines.shapes[0].get();
        break;
      case 9:
        o = &content.add(name, FS_PRIMITIVE_MESH, random.in_box(0.05));
        o->shape = lines.shapes[1].get();
        break;
      default: o = &content.add(name, FS_PRIMITIVE_POINT, random.in_box(0.05)); break;
    }
    o->pose.orientation = random.orientation();
    o->front = profile;
    if (i % 10 == 6 || i % 10 == 7 || i % 10 == 9) o->back = profile;
  }
  for (const Shape& shape : lines.shapes) content.shapes.emplace_back(fs_shape_retain(shape.get()));
  return content;
}

void part_felt() {
  const auto measure = [](const std::string& what, Content content) {
    Stepped stepped(std::move(content));
    const Tool tool = make_tool(stepped.scene.get());
    Walk walk(0.05);
    Samples ticks, evaluations;
    double felt = 0;
    const int64_t end = bench::now_ns() + 1'000'000'000;
    while (bench::now_ns() < end) {
      const fs_vec3 hand = walk.next();
      ticks.add(1e-3 * stepped.tick(hand));
      felt += stepped.felt();
      fs_state state{};
      state.pose = at(hand);
      fs_response response;
      evaluations.add(1e-3 * nanoseconds([&] { fs_evaluate(tool.get(), &state, &response); }));
    }
    figure(what + ": objects felt", "", felt / static_cast<double>(ticks.values.size()));
    figure(what + ": tick, p50", "us", ticks.p50());
    figure(what + ": tick, p99", "us", ticks.p99());
    figure(what + ": fs_evaluate, p50", "us", evaluations.p50());
  };
  measure("1000 linear points felt", thousand_points());
  measure("1000 points of five formulas felt", thousand_formulas());
  measure("1000 mixed objects felt (600 points, 200 planes, 100 polylines, 100 boxes)", thousand_mixed());
}

// 64 clients in eight processes, each with 100 objects that move at 25 Hz.
void part_clients() {
  bench::Rig rig(bench::real_time);
  bench::Job job = bench::job(bench::Work::crowd, rig.endpoint, 8, 100);
  job.rate = 25;
  bench::Crew crew(job, 8);
  crew.begin();
  bench::sleep_for(0.5);
  const pid_t servo = bench::servo_thread();
  const uint64_t moves = crew.page().moves;
  const int64_t begin = bench::now_ns(), used = bench::processor_time(servo);
  bench::sleep_for(3);
  const auto passed = static_cast<double>(bench::now_ns() - begin);
  figure("servo thread, 64 clients of 100 moving objects", "%",
         100 * static_cast<double>(bench::processor_time(servo) - used) / passed);
  figure("the same: moves made a second", "", 1e9 * static_cast<double>(crew.page().moves - moves) / passed);
}

// Moves of one object. Ticks come between them, not measured: after 40, or 400 where a tick may take long.
void part_move() {
  constexpr int in_a_batch = 40, batches = 1500;
  const fs_twist twist{{0.01, 0, 0}, {}};
  const auto measure = [&](const std::string& name, fs_scene* scene, const std::vector<fs_object>& objects,
                           auto between) {
    Random random(5);
    Samples times;
    std::vector<const fs_object*> order(in_a_batch);
    for (int i = 0; i < batches + batches / 10; ++i) {
      for (const fs_object*& o : order) o = &objects[random.below(objects.size())];
      const double time = nanoseconds([&] {
        for (const fs_object* o : order) fs_object_move(scene, o->name, &o->pose, &twist, FS_NOW);
      });
      if (i >= batches / 10) times.add(time / in_a_batch);  // not the first ones, so that caches are warm
      between();
    }
    figure(name + ": p50", "ns", times.p50());
    figure(name + ": mean", "ns", mean(times));
  };
  {
    Stepped one(hello());
    measure("move, beside 1", one.scene.get(), one.content.objects, [&] { one.tick({}); });
  }
  {
    Stepped crowd(points_in_cube());
    int number = 0;
    const auto tick_now_and_then = [&] {
      if (++number % 10 == 0) crowd.tick({});
    };
    const std::vector<fs_object> first(crowd.content.objects.begin(), crowd.content.objects.begin() + 1);
    measure("move, one beside 100,000", crowd.scene.get(), first, tick_now_and_then);
    measure("move, any of 100,000", crowd.scene.get(), crowd.content.objects, tick_now_and_then);
  }
  bench::Rig rig(bench::ordinary);
  const bench::Scene client = bench::connect(rig.endpoint, "mover");
  const std::vector<fs_object> one{bench::far_point("object", 1)};
  require(fs_object_set(client.get(), one.data()), "fs_object_set");
  require(fs_scene_sync(client.get(), 10), "fs_scene_sync");
  measure("move, connected", client.get(), one, [] {});
}

// What the heap grows by for 100,000 objects with names of 8 characters, and a servo that has used them.
void part_memory() {
  Stepped stepped(Content{});
  const auto heap = [] {
    const struct mallinfo2 info = mallinfo2();
    return static_cast<double>(info.uordblks + info.hblkhd);
  };
  Random random(6);
  const double before = heap();
  require(fs_scene_begin(stepped.scene.get()), "fs_scene_begin");
  for (size_t i = 0; i < many; ++i) {
    fs_object o = fs_object_init(("p" + std::to_string(1'000'000 + i)).c_str(), FS_PRIMITIVE_POINT);
    o.pose.position = random.in_box(half_cube);
    o.front = attract(100, 1);
    o.front.reach = 0.005;
    require(fs_object_set(stepped.scene.get(), &o), "fs_object_set");
  }
  require(fs_scene_commit(stepped.scene.get()), "fs_scene_commit");
  for (int i = 0; i < 20; ++i) stepped.tick({});
  figure("memory of an object, a point with a linear profile", "bytes", (heap() - before) / static_cast<double>(many));
}

struct Part {
  const char* name;
  void (*run)();
};
constexpr Part parts[]{{"far", part_far}, {"sudden", part_sudden}, {"felt", part_felt},
                       {"clients", part_clients}, {"move", part_move}, {"memory", part_memory}};

// Prints the library that runs, as a check.
void print_library() {
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    const size_t path = line.find('/');
    if (path == std::string::npos || line.find("/libforceserver.so") == std::string::npos) continue;
    std::printf("library\t%s\n", line.c_str() + path);
    return;
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 4 && !std::strcmp(argv[1], "--client")) return bench::run_client(argv[2], argv[3]);
  for (const Part& part : parts) {
    if (argc == 2 && !std::strcmp(argv[1], "--list")) std::printf("%s\n", part.name);
    if (argc != 2 || std::strcmp(argv[1], part.name)) continue;
    print_library();
    part.run();
    return 0;
  }
  if (argc == 2 && !std::strcmp(argv[1], "--list")) return 0;
  std::fprintf(stderr, "usage: bench_compare PART | --list\n");
  return 2;
}
