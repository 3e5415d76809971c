#include "random_scenes.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "measure.h"
#include "report.h"

namespace stability {

using namespace scenes;

namespace {

template <size_t N>
double one_of(Random& random, const double (&values)[N]) { return values[random.below(N)]; }

// Makes a scene, in metres and newtons of the device; a frame with its two scales then makes it that of an application.
class Maker {
 public:
  Maker(fs_scene* scene, const Situation& situation) : scene_(scene), random_(situation.seed), is_rich_(situation.is_rich), left_out_(situation.left_out) {}

  void make() {
    if (is_rich_) make_frame_and_tool();
    if (is_released_) add_keeper();
    const uint64_t count = 1 + random_.below(6);
    for (uint64_t i = 0; i < count; ++i) add_object(static_cast<int>(i));
    for (int i = 0; i < 6; ++i) {
      if (!(left_out_ >> i & 1)) continue;
      const std::string name = format("object %d", i);
      fs_object_remove(scene_, name.c_str());
      if (name == mover_.name) mover_.name[0] = 0;
    }
  }
  void expect_released() { is_released_ = true; }

  // Moves what moves; t: s.
  void move(double t) {
    if (mover_.name[0] == 0 || t < next_move_ || is_at_rest_) return;
    next_move_ += 0.04;
    is_at_rest_ = t > 1.9;
    constexpr double frequency = 1.5 * 2 * 3.14159265358979;  // rad/s
    fs_pose pose = mover_.pose;
    pose.position = pose.position + (scale_ * 5e-3 * std::sin(frequency * t)) * way_;
    fs_twist twist{};
    if (!is_at_rest_) twist.linear = (scale_ * 5e-3 * frequency * std::cos(frequency * t)) * way_;
    require(fs_object_move(scene_, mover_.name, &pose, &twist, FS_NOW), "fs_object_move");
  }

 private:
  void make_frame_and_tool() {
    if (random_.coin()) {
      scale_ = random_.log_between(0.05, 20);
      force_scale_ = random_.log_between(0.05, 20);
      fs_frame frame = fs_frame_init();
      frame.scale = scale_;
      frame.force_scale = force_scale_;
      require(fs_scene_set_frame(scene_, &frame), "fs_scene_set_frame");
    }
    if (random_.coin(0.4)) {
      fs_vec3 points[FS_TOOL_POINTS_MAX];
      const size_t count = 1 + random_.below(FS_TOOL_POINTS_MAX);
      for (size_t i = 0; i < count; ++i) points[i] = scale_ * random_.in_box(0.02);
      require(fs_scene_set_tool(scene_, points, count), "fs_scene_set_tool");
    }
  }

  // Without a hand something must keep the handle where the objects are.
  void add_keeper() {
    fs_object keeper = fs_object_init("keeper", FS_PRIMITIVE_POINT);
    keeper.front = converted(fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 60, 0, 25));
    set(keeper);
  }

  fs_profile profile() {
    const double force = random_.between(1, 8), width = random_.log_between(1e-3, 0.02), limit = random_.between(2, 15);
    const fs_sense sense = random_.coin() ? FS_SENSE_ATTRACTIVE : FS_SENSE_REPULSIVE;
    switch (random_.below(6)) {
      case 0: return fs_profile_init(FS_PROFILE_CONSTANT, sense, force, 0, limit);
      case 1: return fs_profile_init(FS_PROFILE_LINEAR_INCREASING, sense, random_.log_between(50, 5000),
                                     random_.coin() ? 0 : random_.between(0, 2), limit);
      case 2: return fs_profile_init(FS_PROFILE_LINEAR_DECREASING, sense, -force / width, force, limit);
      case 3: return fs_profile_init(FS_PROFILE_GAUSSIAN, sense, force, width, limit);
      case 4: return fs_profile_init(FS_PROFILE_QUADRATIC, sense, force / (width * width), 0, limit);
      default: return fs_profile_init(FS_PROFILE_INVERSE, sense, random_.between(0.002, 0.03), 0, limit);
    }
  }

  fs_profile converted(fs_profile p) const {
    double& gain = p.gain;
    gain /= force_scale_;
    if (p.kind == FS_PROFILE_LINEAR_INCREASING || p.kind == FS_PROFILE_LINEAR_DECREASING) gain /= scale_;
    if (p.kind == FS_PROFILE_QUADRATIC) gain /= scale_ * scale_;
    if (p.kind == FS_PROFILE_INVERSE) gain *= scale_;
    p.offset /= force_scale_;
    p.limit /= force_scale_;
    p.width *= scale_;
    return p;
  }

  void add_object(int number) {
    constexpr fs_primitive primitives[] = {FS_PRIMITIVE_POINT, FS_PRIMITIVE_POINT, FS_PRIMITIVE_POLYLINE,
                                           FS_PRIMITIVE_POLYLINE, FS_PRIMITIVE_PLANE, FS_PRIMITIVE_MESH};
    fs_object object = fs_object_init(format("object %d", number).c_str(), primitives[random_.below(6)]);
    object.pose = random_.pose(0.01);
    object.pose.position = scale_ * object.pose.position;
    object.front = converted(profile());
    Shape shape;
    if (object.primitive == FS_PRIMITIVE_POLYLINE) {
      fs_vec3 points[5];
      const size_t count = 2 + random_.below(4);
      for (size_t i = 0; i < count; ++i) points[i] = scale_ * random_.in_box(0.04);
      shape = make_polyline(points, count, random_.coin(0.3));
    }
    if (object.primitive == FS_PRIMITIVE_MESH) shape = box();
    if (object.primitive == FS_PRIMITIVE_PLANE || object.primitive == FS_PRIMITIVE_MESH) {
      object.back = converted(profile());
      if (random_.coin()) {  // a wall
        object.front = {};
        object.back = converted(fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE,
                                                random_.log_between(200, 5000), 0, random_.between(5, 20)));
      }
      if (is_rich_ && random_.coin(0.4)) make_solid(object);
    }
    if (is_rich_ && random_.coin(0.4)) object.damping = random_.between(0, 50) / (scale_ * force_scale_);
    object.shape = shape.get();
    set(object);
    if (is_rich_ && mover_.name[0] == 0 && random_.coin(0.3)) {
      mover_ = object;
      way_ = random_.direction();
    }
  }

  void make_solid(fs_object& object) {
    constexpr fs_keep sides[] = {FS_KEEP_FRONT, FS_KEEP_BACK, FS_KEEP_EITHER};
    object.contact.keep = sides[random_.below(3)];
    object.contact.stiffness = random_.coin() ? 0 : random_.log_between(100, 5000) / (scale_ * force_scale_);
    object.contact.limit = random_.between(5, 20) / force_scale_;
    object.contact.damping = random_.coin() ? 0 : random_.between(0, 50) / (scale_ * force_scale_);
    object.contact.friction = random_.coin() ? 0 : random_.between(0, 1.5);
    if (random_.coin()) object.front = object.back = {};
  }

  Shape box() {
    const double x = scale_ * random_.between(5e-3, 0.03), y = scale_ * random_.between(5e-3, 0.03),
                 z = scale_ * random_.between(2e-3, 0.02);
    const fs_vec3 points[] = {{-x, -y, -z}, {x, -y, -z}, {x, y, -z}, {-x, y, -z}, {-x, -y, z}, {x, -y, z}, {x, y, z}, {-x, y, z}};
    const uint32_t triangles[] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                  1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};
    fs_shape* made = nullptr;
    require(fs_shape_create_mesh(points, 8, triangles, 12, &made), "fs_shape_create_mesh");
    return Shape(made);
  }

  void set(const fs_object& object) { require(fs_object_set(scene_, &object), "fs_object_set"); }

  fs_scene* scene_;
  Random random_;
  bool is_rich_, is_released_ = false, is_at_rest_ = false;
  uint32_t left_out_;
  double scale_ = 1, force_scale_ = 1, next_move_ = 0;
  fs_object mover_{};  // none while it has no name
  fs_vec3 way_{};
};

// Of a handle that moves without swinging: some slide for long, along straight and curved ways. It oscillates if it goes to and
// fro in each of ten more seconds.
template <class F>
void look_at_slide(const Oscillation& motion, Outcome& out, F&& run_until) {
  double least = 1e300, least_turn = 1e300;
  for (int i = 0; i < 10; ++i) {
    Oscillation second(motion.end() + i, motion.end() + i);
    run_until(second);
    least = std::min(least, second.late());
    least_turn = std::min(least_turn, second.late_turn());
  }
  out.oscillates = least > 1e-4 || least_turn > 2e-3;
  out.swing = least;
}

}  // namespace

Situation simple_situation(uint64_t seed, const HandModel& hand) {
  Random random(seed * 2 + 1);
  Situation s;
  s.hand = hand;
  s.device.delay = one_of(random, {0, 0.001, 0.002, 0.005});
  s.seed = seed;
  return s;
}

Situation any_situation(uint64_t seed) {
  Random random(seed * 2 + 1);
  Situation s;
  s.seed = seed;
  s.is_rich = true;
  s.early = 2.5, s.late = 4.5, s.width = 0.5;
  constexpr HandModel all[] = {nominal, firm, light, released};
  s.hand = all[random.below(4)];
  DeviceModel& device = s.device;
  device.mass = one_of(random, {0.05, 0.1, 0.3, 1});
  device.rate = one_of(random, {500, 1000, 1000, 2000, 4000, 10000, 20000});
  device.damping = random.log_between(0.1, 3);
  device.friction = one_of(random, {0, 0.1, 0.3});
  device.encoder = one_of(random, {0, 5e-6, 20e-6});
  const double delay = random.coin(0.3) ? 0 : random.log_between(0.1e-3, 20e-3);
  device.delay = std::round(delay * 8 * device.rate) / (8 * device.rate);
  if (random.coin(0.3)) device.torque_max = 0.5;
  return s;
}

std::string described(const Situation& s) {
  const DeviceModel& d = s.device;
  return format("%.2f kg, %.2f N s/m, friction %.1f N, encoder %g um, %.0f Hz, delay %.2f ms, %s hand, torque %g N m", d.mass,
                d.damping, d.friction, 1e6 * d.encoder, d.rate, 1e3 * d.delay, s.hand.name, d.torque_max);
}

Outcome run(const Situation& situation, const fs_servo_options& options, const std::function<void(Rig&, double)>& each) {
  Rig rig(situation.device, situation.hand);
  Random random(situation.seed * 2);
  Maker maker(rig.scene.get(), situation);
  if (situation.hand.mass == 0) maker.expect_released();
  maker.make();
  rig.plant.target = random.in_box(0.01);
  rig.plant.put(rig.plant.target);
  const double mass = situation.device.mass + situation.hand.mass;
  const fs_vec3 push = std::min(4.0, 0.2 * mass / 0.05) * random.direction();  // for 50 ms: up to 0.2 m/s
  require(rig.start(options) ? FS_OK : FS_ERROR_STATE, "fs_servo_start");
  std::deque<fs_vec3> way;  // of the last 0.1 s until it is too fast
  bool is_too_fast = false;
  const auto run_until = [&](Oscillation& motion) {
    rig.run(motion.end() - rig.time(), [&](double t) {
      maker.move(t);
      rig.plant.push = t >= 1.3 && t < 1.35 ? push : fs_vec3{};
      motion.add(t, rig.plant.position(), rig.plant.rotation());
      if (!is_too_fast) way.push_back(rig.plant.position());
      if (static_cast<double>(way.size()) > 0.1 * situation.device.rate) way.pop_front();
      is_too_fast |= norm(rig.plant.velocity()) > 1.9;
      if (each) each(rig, t);
    });
  };
  Oscillation motion(situation.early, situation.late, situation.width);
  run_until(motion);
  Outcome out{motion.lasts(), motion.late(), rig.stats().faults};
  if (out.faults) {
    Swing swing;
    for (const fs_vec3& x : way) swing.add(x);
    out.is_flung = is_too_fast && situation.hand.mass == 0 && swing.length() < 1e-3;
  } else if (motion.moves() && !motion.lasts()) {
    look_at_slide(motion, out, run_until);
  }
  return out;
}

std::string link_of(uint64_t seed) {
  Random random(seed * 2 + 1);
  const char* const hands_of_sim[] = {"nominal", "firm", "light", "released"};
  const double ms = one_of(random, {2, 5, 10, 20, 50}), hz = one_of(random, {25, 50, 100, 500});
  const double mass = one_of(random, {0.05, 0.1, 0.3, 1}), friction = one_of(random, {0, 0, 0.3});
  const fs_vec3 hold = random.in_box(0.01);
  return format("sim:?link=model&link_ms=%g&link_hz=%g&hand=%s&mass=%g&friction=%g&hold=%.6f,%.6f,%.6f", ms, hz,
                hands_of_sim[random.below(4)], mass, friction, hold.x, hold.y, hold.z);
}

Outcome run_link(uint64_t seed, uint32_t left_out, const std::function<void(fs_scene*, double)>& each) {
  const std::string uri = link_of(seed);
  const Scene scene = make_scene();
  const Device device = open_device(uri.c_str());
  Situation situation;
  situation.seed = seed;
  situation.is_rich = true;
  situation.left_out = left_out;
  Maker maker(scene.get(), situation);
  if (uri.find("hand=released") != std::string::npos) maker.expect_released();
  maker.make();
  const fs_servo_options options = default_options();
  fs_servo* started = nullptr;
  require(fs_servo_start(scene.get(), device.get(), &options, &started), "fs_servo_start");
  const Servo servo(started);
  Oscillation motion(2.5, 4.5, 1);
  uint64_t tick = 0;
  const auto run_until = [&](Oscillation& until) {
    for (; 1e-3 * static_cast<double>(tick) < until.end(); ++tick) {
      const double t = 1e-3 * static_cast<double>(tick);
      maker.move(t);
      fs_servo_step(servo.get(), 1);  // DISCONNECTED until the first pose has come over the link
      fs_state state;
      require(fs_scene_get_hand(scene.get(), &state, nullptr, nullptr), "fs_scene_get_hand");
      fs_frame frame = fs_frame_init();
      require(fs_scene_get_frame(scene.get(), nullptr, &frame), "fs_scene_get_frame");
      until.add(t, (1 / frame.scale) * state.pose.position);
      if (each) each(scene.get(), t);
    }
  };
  run_until(motion);
  fs_servo_stats stats = fs_servo_stats_init();
  require(fs_scene_get_servo_stats(scene.get(), &stats), "fs_scene_get_servo_stats");
  Outcome out{motion.lasts(), motion.late(), stats.faults};
  if (!out.faults && motion.moves() && !motion.lasts()) look_at_slide(motion, out, run_until);
  return out;
}

}  // namespace stability
