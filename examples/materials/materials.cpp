// A simulated hand taps and strokes the six faces of a box, each of another material, and what it feels is written to a table.
// Time is virtual: each tick of the servo is a millisecond of it, however long it takes.
#include <cmath>
#include <cstdio>
#include <fstream>

#include <forceserver/forceserver.hpp>

using namespace forceserver;

namespace {

// The hand: a mass that a spring and a damper pull to where it wants to be. It is held more firmly than a person's, so that its
// speed stays the same while it is rubbed.
constexpr double hand_mass = 0.2, hand_damping = 25, hand_stiffness = 1000;  // kg, N s/m, N/m
constexpr double push = 1.5;                                                 // N, with which it strokes
constexpr double stroke_speed = 0.08, tap_speed = 0.12;                      // m/s
constexpr double travel_speed = 0.25, landing_speed = 0.015;                 // m/s; whoever lands so slowly strikes nothing

// In this order each face is a neighbour of the one before.
constexpr const char* materials[] = {"rubber", "wood", "ice", "sandpaper", "corduroy", "metal"};

fs_vec3 operator+(fs_vec3 a, fs_vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
fs_vec3 operator-(fs_vec3 a, fs_vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
double length(fs_vec3 v) { return std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z); }

// A face of the box. Its frame has z outwards, and its origin is in the middle of the face.
struct Face {
  std::string name;
  fs_frame frame = fs_frame_init();
  double depth = 0;  // m, of the hand's target below the face, so that it pushes as it should

  Face(const Scene& scene, const char* material) : name(material) {
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
    double end;  // s
    std::size_t face;
    const char* action;
  };

  explicit Plan(const std::vector<Face>& faces) : place_(faces[0].to_scene({0, 0, 0.02})) {
    stay(1.6);  // by then the force is there in full
    for (std::size_t i = 0; i < faces.size(); ++i) {
      if (i > 0) go_round_the_edge(faces[i - 1], faces[i]);
      touch(faces[i], i);
    }
  }
  const std::vector<Part>& parts() const { return parts_; }
  void write(const std::string& file) const {
    std::ofstream out(file);
    out << "# Where the simulated hand wants to be: t (s), x y z (m).\n" << lines_;
    if (!out.flush()) throw std::runtime_error("cannot write " + file);
  }

 private:
  void touch(const Face& face, std::size_t number) {
    const auto part = [&](const char* action) { parts_.push_back({time_, number, action}); };
    go(face.to_scene({0, 0, 0.012}), travel_speed);
    stay(0.1);
    part("travel");
    go(face.to_scene({0, 0, -face.depth}), tap_speed);
    stay(0.3);
    part("tap");
    go(face.to_scene({0, 0, 0.01}), travel_speed);
    go(face.to_scene({-0.025, -0.003, 0.003}), travel_speed);
    stay(0.1);
    go(face.to_scene({-0.025, -0.003, -face.depth}), landing_speed);
    stay(0.2);
    part("travel");
    go(face.to_scene({0.025, 0.003, -face.depth}), stroke_speed);  // a little aslant, so that no row of a texture comes twice
    part("stroke");
    stay(0.1);
    go(face.to_scene({0.025, 0.003, 0.02}), travel_speed);
  }
  void go_round_the_edge(const Face& from, const Face& to) {
    go(from.to_scene({0, 0, 0.02}), travel_speed);
    go(from.to_scene({0, 0, 0.02}) + to.to_scene({0, 0, 0.02}), travel_speed);
    go(to.to_scene({0, 0, 0.02}), travel_speed);
  }
  void go(fs_vec3 to, double speed) {
    const double way = length(to - place_);
    place_ = to;
    stay(way / speed);
  }
  void stay(double duration) {
    if (lines_.empty()) line();
    time_ += duration;
    line();
  }
  void line() {
    char text[120];
    std::snprintf(text, sizeof text, "%.4f %.6f %.6f %.6f\n", time_, place_.x, place_.y, place_.z);
    lines_ += text;
  }

  double time_ = 0;  // s
  fs_vec3 place_;
  std::string lines_;
  std::vector<Part> parts_;
};

// What the stroke of a face was like.
struct Stroke {
  int ticks = 0;
  double normal = 0, tangential = 0, squares = 0;  // N; N^2: sums
  double texture = 1, impact = 1;                  // the parts of the texture and the impact that the loop renders

  double friction() const { return tangential / normal; }
  double roughness() const { return std::sqrt(squares / ticks - std::pow(tangential / ticks, 2)); }  // N, rms
};

void run(const char* scene_file, const char* table_file, const std::string& hand_file) {
  const Scene scene = Scene::create();
  scene.load(scene_file);
  const std::vector<Face> faces = [&] {
    std::vector<Face> out;
    for (const char* const material : materials) out.emplace_back(scene, material);
    return out;
  }();
  const Plan plan(faces);
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
  std::vector<Stroke> strokes(faces.size());
  double worst_step = 0;
  fs_vec3 last{};
  for (const Plan::Part& part : plan.parts()) {
    const Face& face = faces[part.face];
    Stroke& stroke = strokes[part.face];
    while (scene.get_time() < part.end) {
      servo.step(1);
      fs_state hand;
      fs_response felt;
      fs_wrench sent;
      scene.get_hand(&hand, &felt, &sent);
      const fs_vec3 place = face.from_scene(hand.pose.position), force = face.turned(felt.wrench.force);
      worst_step = std::max(worst_step, length(sent.force - last));
      last = sent.force;
      char line[240];
      std::snprintf(line, sizeof line, "%.3f,%s,%s,%.3f,%.3f,%.3f,%.4f,%.4f,%.4f,%.4f,%.4f\n", hand.time, face.name.c_str(),
                    part.action, 1e3 * place.x, 1e3 * place.y, 1e3 * place.z, -force.x, force.z, last.x, last.y, last.z);
      table << line;
      if (part.action[0] != 's' || place.x < -0.015) continue;  // by then it slips
      ++stroke.ticks;
      stroke.normal += force.z;
      stroke.tangential -= force.x;
      stroke.squares += force.x * force.x;
    }
    const fs_report report = scene.get_report(face.name);
    std::printf("%s %s: %g of %g N/m, texture %g, impact %g, %s\n", face.name.c_str(), part.action, report.stiffness_applied,
                report.stiffness_wanted, report.texture_lost, report.impact_lost, report.shares_with);
    stroke.texture = std::min(stroke.texture, 1 - report.texture_lost);
    stroke.impact = std::min(stroke.impact, 1 - report.impact_lost);
  }
  if (!table.flush()) throw std::runtime_error(std::string("cannot write ") + table_file);

  std::printf("             friction   roughness   texture   impact\n");
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const Stroke& stroke = strokes[i];
    std::printf("%-10s   %8.3f   %7.3f N   %5.0f %%   %4.0f %%\n", materials[i], stroke.friction(), stroke.roughness(),
                100 * stroke.texture, 100 * stroke.impact);
  }
  const fs_servo_stats stats = scene.get_servo_stats();
  std::printf("the force changed by %.2f N at most from one tick to the next; the loop renders %.0f N/m\n", worst_step,
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
