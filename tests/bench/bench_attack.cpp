// What one client can do to another: how long an honest client's move takes to the device, its request to be answered and
// its mesh to be felt, beside each attack (attacks.cpp) and alone. Prints a table; README.md has one.
// bench_attack [--quick] [--only=PART_OF_A_NAME] DATA_FILE
//
// Server, honest client and attacker are a process each. Each attack has a round of "alone" beside it, as the machine is
// another one from minute to minute.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>

#include "attacks.h"
#include "rig.h"

using namespace bench;

namespace {

constexpr double most = 1.5;  // the goal: the median beside an attack, divided by the median alone

// The honest client: one object turns about the hand; a second connection asks for a report every 2 to 4 ms, a third one
// sets a mesh of 45,000 points ten times a second at most.
void be_honest(Page& page) {
  const std::string endpoint = page.job.endpoint;
  const Scene scene = connect(endpoint, "honest"), asking = connect(endpoint, "asks"), meshing = connect(endpoint, "meshes");
  fs_object object = drawing_point("object 0");
  check(fs_object_set(scene.get(), &object), "fs_object_set");
  fs_object touched = far_point("victim", 0);
  check(fs_object_set(scene.get(), &touched), "fs_object_set");
  const double forces[] = {1, 2};
  fs_curve* curve = nullptr;
  check(fs_curve_create_table(forces, 2, 1, &curve), "fs_curve_create_table");
  fs_object curved = far_point("curved", 1);
  curved.front = fs_profile_init(FS_PROFILE_CUSTOM, FS_SENSE_ATTRACTIVE, 1, 0, 1);
  curved.front.reach = 0.005;
  curved.front.curve = curve;
  check(fs_object_set(scene.get(), &curved), "fs_object_set");
  check(fs_scene_sync(scene.get(), 10), "fs_scene_sync");

  std::vector<fs_vec3> points(45'000);
  std::vector<uint32_t> corners(points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    const double k = static_cast<double>(i);
    points[i] = {1 + std::fmod(k, 1000) * 1e-3, std::floor(k / 1000) * 1e-3, std::sin(k)};
    corners[i] = static_cast<uint32_t>(i);
  }
  ++page.ready;
  while (!page.is_begun) sleep_for(0.001);
  std::thread asker([&] {
    for (uint64_t k = 0; !page.is_ended && k < std::size(page.requests); ++k) {
      fs_report report;
      const int64_t begin = now_ns();
      if (fs_scene_get_report(asking.get(), "honest/object 0", &report) != FS_OK) ++page.failures;
      page.requests[k] = static_cast<double>(now_ns() - begin);
      page.request_count = k + 1;
      sleep_for(0.002 + 1e-5 * static_cast<double>(k * 37 % 200));
    }
  });
  std::thread mesher([&] {
    for (uint64_t k = 0; !page.is_ended && k < std::size(page.meshes); ++k) {
      fs_shape* shape = nullptr;
      check(fs_shape_create_mesh(points.data(), points.size(), corners.data(), corners.size() / 3, &shape),
            "fs_shape_create_mesh");
      fs_object mesh = fs_object_init("mesh", FS_PRIMITIVE_MESH);
      mesh.shape = shape;
      mesh.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_REPULSIVE, 1, 0, 1);
      mesh.front.reach = 0.005;
      const int64_t begin = now_ns();
      if (fs_object_set(meshing.get(), &mesh) != FS_OK || fs_scene_sync(meshing.get(), 10) != FS_OK) ++page.failures;
      page.meshes[k] = static_cast<double>(now_ns() - begin);
      page.mesh_count = k + 1;
      fs_shape_destroy(shape);
      sleep_for(0.1);
    }
  });
  turn_at_random(scene.get(), page);
  asker.join();
  mesher.join();
}

struct Figures {
  Samples moves, requests, meshes;
  void add(const Figures& more) {
    moves.add(more.moves);
    requests.add(more.requests);
    meshes.add(more.meshes);
  }
};

// One round. attack null: the honest client alone.
Figures measure(const Attack* attack, double time) {
  Rig rig(real_time);
  Job work = job(Work::other, rig.endpoint, 0, 0);
  work.rate = -1;
  work.shortest = 0.003;
  work.longest = 0.007;
  Crew honest(work, 1);
  std::unique_ptr<Crew> attacker;
  if (attack) {
    Job hostile = job(Work::other, rig.endpoint, 0, 0);
    hostile.rate = static_cast<double>(attack - attacks);
    attacker = std::make_unique<Crew>(hostile, 1);
    sleep_for(0.2);
  }
  honest.begin();
  sleep_for(time);
  honest.page().is_ended = 1;
  sleep_for(0.05);
  if (attacker) attacker->kill();
  const int64_t begin = now_ns();
  honest.end();
  rig.server.reset();
  const double stopping = 1e-9 * static_cast<double>(now_ns() - begin);
  rig.servo.reset();

  Page& page = honest.page();
  size_t overtaken = 0;
  Figures out;
  out.moves = latencies(page, take_arrivals(), overtaken);
  out.requests.values.assign(page.requests, page.requests + page.request_count);
  out.meshes.values.assign(page.meshes, page.meshes + page.mesh_count);
  if (overtaken) progress("  %zu moves were overtaken by the next", overtaken);
  if (page.failures) progress("  %llu requests failed", static_cast<unsigned long long>(page.failures.load()));
  if (stopping > 1) progress("  the end took %.1f s", stopping);
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 4 && !std::strcmp(argv[1], "--client")) {
    Page& page = page_of_client(argv[2]);
    const int number = static_cast<int>(page.job.rate);
    if (number < 0) be_honest(page);
    else attacks[number].run(page);
    return 0;
  }
  bool is_quick = false;
  std::string file, only;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--quick") is_quick = true;
    else if (argument.starts_with("--only=")) only = argument.substr(7);
    else if (file.empty() && !argument.starts_with("-")) file = argument;
  }
  if (file.empty()) {
    std::fprintf(stderr, "usage: bench_attack [--quick] [--only=PART_OF_A_NAME] DATA_FILE\n");
    return 2;
  }
  print_machine();
  table_begin(file);
  const int rounds = is_quick ? 1 : 3;
  const double time = is_quick ? 1.5 : 3;
  std::vector<Figures> alone(attack_count), beside(attack_count);
  for (int round = 1; round <= rounds; ++round) {
    for (size_t i = 0; i < attack_count; ++i) {
      if (std::string(attacks[i].name).find(only) == std::string::npos) continue;
      progress("round %d of %d: %s ...", round, rounds, attacks[i].name);
      alone[i].add(measure(nullptr, time));
      beside[i].add(measure(&attacks[i], time));
    }
  }
  Figures all;
  for (const Figures& figures : alone) all.add(figures);
  table_row("move: alone", Unit::time, all.moves);
  table_row("request: alone", Unit::time, all.requests);
  table_row("mesh: alone", Unit::time, all.meshes);
  std::string slow;
  for (size_t i = 0; i < attack_count; ++i) {
    if (beside[i].moves.values.empty()) continue;
    const std::string name = attacks[i].name;
    table_row("move: " + name, Unit::time, beside[i].moves, {"alone", &alone[i].moves});
    table_row("request: " + name, Unit::time, beside[i].requests, {"alone", &alone[i].requests});
    table_row("mesh: " + name, Unit::time, beside[i].meshes, {"alone", &alone[i].meshes});
    if (!(beside[i].moves.p50() <= most * alone[i].moves.p50())) slow += "\n  move: " + name;
    if (!(beside[i].requests.p50() <= most * alone[i].requests.p50())) slow += "\n  request: " + name;
  }
  std::printf("\nMedians above %.1f times those alone: %s\n", most, slow.empty() ? "none" : slow.c_str());
  return 0;
}
