// A simulated hand in a box taps and strokes its six walls, each of another material, and what it feels is written to a table.
// Time is virtual: each tick of the servo is a millisecond of it, however long it takes.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>

#include <forceserver/forceserver.hpp>

using namespace forceserver;

namespace {

// The hand: a mass that a spring and a damper pull to where it wants to be. It is stiffer than a person's, so that its speed and
// its push stay the same while it strokes.
constexpr double hand_mass = 0.2, hand_damping = 25, hand_stiffness = 1000;  // kg, N s/m, N/m
constexpr double push = 1.5;                                                 // N, with which it strokes
constexpr double stroke_speed = 0.1, tap_speed = 0.12;                       // m/s
constexpr double landing_speed = 0.015;                                      // m/s: too slow for an impact
constexpr double travel_speed = 0.25, careful_speed = 0.1;                   // m/s

// Where a stroke begins and ends, in the frame of the wall, m. It is aslant, so that no row of a texture is felt twice.
constexpr fs_vec3 begin = {-0.025, -0.0025, 0}, end = {0.025, 0.0025, 0};

constexpr const char* materials[] = {"rubber", "wood", "ice", "sandpaper", "corduroy", "metal"};

fs_vec3 operator-(fs_vec3 a, fs_vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
double dot(fs_vec3 a, fs_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
double length(fs_vec3 v) { return std::sqrt(dot(v, v)); }
fs_vec3 above(fs_vec3 place, double height) { return {place.x, place.y, height}; }

// A wall of the box. In its frame z leads into the box, and the origin is in the middle of the wall.
struct Wall {
  std::string name;
  fs_frame frame = fs_frame_init();
  double depth;  // m, that the hand wants to be behind the wall, so that it pushes as it should

  Wall(const Scene& scene, const char* material) : name(material) {
    const Object object = scene.object_get(name);
    frame.pose = object.pose;
    depth = push / object.contact.stiffness + push / hand_stiffness;
  }
  fs_vec3 to_scene(fs_vec3 place) const { return frame_to_device(frame, {place, {1, 0, 0, 0}}).position; }
  fs_vec3 from_scene(fs_vec3 place) const { return frame_to_scene(frame, {place, {1, 0, 0, 0}}).position; }
  fs_vec3 turned(fs_vec3 force) const { return from_scene(force) - from_scene({0, 0, 0}); }
};

// Where the hand wants to be, and what it does meanwhile.
class Plan {
 public:
  struct Part {
    const char* action;
    std::size_t wall;
    double end;  // s
  };

  explicit Plan(const std::vector<Wall>& walls) {
    stay(0.1);
    for (std::size_t i = 0; i < walls.size(); ++i) add(walls[i], i);
  }
  const std::vector<Part>& parts() const { return parts_; }
  void write(const std::string& file) const {
    std::ofstream out(file);
    out << "# Where the simulated hand wants to be: t (s), x y z (m).\n" << lines_;
    if (!out.flush()) throw std::runtime_error("cannot write " + file);
  }

 private:
  void add(const Wall& wall, std::size_t number) {
    stay(1.5);  // in the middle of the box, until the force is there in full and what the hand has left no longer counts
    go(wall.to_scene({0, 0, 0.012}), travel_speed);
    stay(0.2);
    name("travel", number);
    go(wall.to_scene({0, 0, -wall.depth}), tap_speed);
    stay(0.3);
    name("tap", number);
    go(wall.to_scene({0, 0, 0.003}), careful_speed);
    go(wall.to_scene(above(begin, 0.003)), careful_speed);
    stay(1.5);
    go(wall.to_scene(above(begin, -wall.depth)), landing_speed);
    stay(0.3);
    name("travel", number);
    go(wall.to_scene(above(end, -wall.depth)), stroke_speed);
    name("stroke", number);
    stay(0.1);
    go(wall.to_scene(above(end, 0.02)), travel_speed);
    go({0, 0, 0}, travel_speed);
  }
  void go(fs_vec3 to, double speed) {
    const double way = length(to - place_);
    place_ = to;
    stay(way / speed);
  }
  void stay(double duration) {
    time_ += duration;
    char line[120];
    std::snprintf(line, sizeof line, "%.4f %.6f %.6f %.6f\n", time_, place_.x, place_.y, place_.z);
    lines_ += line;
  }
  void name(const char* action, std::size_t wall) { parts_.push_back({action, wall, time_}); }

  double time_ = 0;  // s
  fs_vec3 place_{};
  std::string lines_;
  std::vector<Part> parts_;
};

// What the hand feels at a wall, in the frame of the wall.
struct Moment {
  double time;                // s
  fs_vec3 place;              // m
  double tangential, normal;  // N: against the stroke, and into the box
};

// How a wall was felt.
struct Summary {
  int ticks = 0;
  double sticks = 0, tangential = 0, normal = 0;  // the largest ratio of the two forces; N: sums while it slips
  double texture = 1, impact = 1;                 // the least part of the texture and of the impact that was rendered

  void add(const Moment& moment) {
    if (moment.normal > push / 2) sticks = std::max(sticks, moment.tangential / moment.normal);
    if (moment.place.x < begin.x + 0.01) return;  // by then it slips
    ++ticks;
    tangential += moment.tangential;
    normal += moment.normal;
  }
};

void run(const char* scene_file, const char* table_file, const std::string& hand_file) {
  const Scene scene = Scene::create();
  scene.load(scene_file);
  std::vector<Wall> walls;
  for (const char* const material : materials) walls.emplace_back(scene, material);
  const Plan plan(walls);
  plan.write(hand_file);

  char uri[400];
  std::snprintf(uri, sizeof uri, "sim:?hand_mass=%g&hand_damping=%g&hand_stiffness=%g&path=%s", hand_mass, hand_damping,
                hand_stiffness, hand_file.c_str());
  fs_servo_options options = fs_servo_options_init();
  options.mode = FS_SERVO_VIRTUAL;
  const Device device = Device::open(uri);
  const Servo servo = Servo::start(scene, device, &options);

  std::ofstream table(table_file);
  table << "time,material,action,x,y,z,tangential,normal,sent x,sent y,sent z\n";
  std::vector<Summary> summaries(walls.size());
  const fs_vec3 way = end - begin;
  double largest_step = 0;
  fs_vec3 last{};
  for (const Plan::Part& part : plan.parts()) {
    const Wall& wall = walls[part.wall];
    Summary& summary = summaries[part.wall];
    const bool is_stroke = !std::strcmp(part.action, "stroke"), is_tap = !std::strcmp(part.action, "tap");
    while (scene.get_time() < part.end) {
      servo.step(1);
      fs_state hand;
      fs_response felt;  // before the guard, which adds the damping of the servo
      fs_wrench sent;
      scene.get_hand(&hand, &felt, &sent);
      const fs_vec3 force = wall.turned(felt.wrench.force);
      const Moment now = {hand.time, wall.from_scene(hand.pose.position), -dot(force, way) / length(way), force.z};
      largest_step = std::max(largest_step, length(sent.force - last));
      last = sent.force;
      char line[240];
      std::snprintf(line, sizeof line, "%.3f,%s,%s,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f\n", now.time, wall.name.c_str(),
                    part.action, 1e3 * now.place.x, 1e3 * now.place.y, 1e3 * now.place.z, now.tangential, now.normal, last.x,
                    last.y, last.z);
      table << line;
      if (is_stroke) summary.add(now);
      if (!is_stroke && !is_tap) continue;
      const fs_report report = scene.get_report(wall.name);
      summary.texture = std::min(summary.texture, 1 - report.texture_lost);
      summary.impact = std::min(summary.impact, 1 - report.impact_lost);
    }
  }
  if (!table.flush()) throw std::runtime_error(std::string("cannot write ") + table_file);

  std::printf("             sticks up to   slips at   pushed with   texture   impact rendered\n");
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const Summary& of = summaries[i];
    std::printf("%-10s   %12.2f   %8.3f   %9.2f N   %5.0f %%   %13.0f %%\n", materials[i], of.sticks, of.tangential / of.normal,
                of.normal / of.ticks, 100 * of.texture, 100 * of.impact);
  }
  const fs_servo_stats stats = scene.get_servo_stats();
  std::printf("From one tick to the next the force changed by %.2f N at most. The loop renders %.0f N/m.\n", largest_step,
              stats.max_stiffness);
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 4) {
    std::fprintf(stderr, "usage: materials SCENE.json TABLE.csv HAND.txt    (HAND.txt is written: the way of the hand)\n");
    return 2;
  }
  run(argv[1], argv[2], argv[3]);
} catch (const std::exception& error) {
  std::fprintf(stderr, "materials: %s\n", error.what());
  return 1;
}
