#include "random_scenes.h"

#include <algorithm>
#include <cmath>

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
  Maker(Rig& rig, const Situation& situation) : rig_(rig), random_(situation.seed), is_rich_(situation.is_rich) {}

  void make() {
    if (is_rich_) make_frame_and_tool();
    if (rig_.plant.device().mass > 0 && is_released_) add_keeper();
    const uint64_t count = 1 + random_.below(6);
    for (uint64_t i = 0; i < count; ++i) add_object(static_cast<int>(i));
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
    require(fs_object_move(rig_.scene.get(), mover_.name, &pose, &twist, FS_NOW), "fs_object_move");
  }

 private:
  void make_frame_and_tool() {
    if (random_.coin()) {
      scale_ = random_.log_between(0.05, 20);
      force_scale_ = random_.log_between(0.05, 20);
      fs_frame frame = fs_frame_init();
      frame.scale = scale_;
      frame.force_scale = force_scale_;
      require(fs_scene_set_frame(rig_.scene.get(), &frame), "fs_scene_set_frame");
    }
    if (random_.coin(0.4)) {
      fs_vec3 points[FS_TOOL_POINTS_MAX];
      const size_t count = 1 + random_.below(FS_TOOL_POINTS_MAX);
      for (size_t i = 0; i < count; ++i) points[i] = scale_ * random_.in_box(0.02);
      require(fs_scene_set_tool(rig_.scene.get(), points, count), "fs_scene_set_tool");
    }
  }

  // Without a hand something must keep the handle where the objects are.
  void add_keeper() {
    fs_object keeper = fs_object_init("keeper", FS_PRIMITIVE_POINT);
    keeper.front = converted(fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 60, 0, 25));
    rig_.set(keeper);
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
    rig_.set(object);
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

  Rig& rig_;
  Random random_;
  bool is_rich_, is_released_ = false, is_at_rest_ = false;
  double scale_ = 1, force_scale_ = 1, next_move_ = 0;
  fs_object mover_{};  // none while it has no name
  fs_vec3 way_{};
};

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

Outcome run(const Situation& situation, const fs_servo_options& options) {
  Rig rig(situation.device, situation.hand);
  Random random(situation.seed * 2);
  Maker maker(rig, situation);
  if (situation.hand.mass == 0) maker.expect_released();
  maker.make();
  rig.plant.target = random.in_box(0.01);
  rig.plant.put(rig.plant.target);
  const double mass = situation.device.mass + situation.hand.mass;
  const fs_vec3 push = std::min(4.0, 0.2 * mass / 0.05) * random.direction();  // for 50 ms: up to 0.2 m/s
  require(rig.start(options) ? FS_OK : FS_ERROR_STATE, "fs_servo_start");
  Oscillation motion(situation.early, situation.late, situation.width);
  rig.run(motion.end(), [&](double t) {
    maker.move(t);
    rig.plant.push = t >= 1.3 && t < 1.35 ? push : fs_vec3{};
    motion.add(t, rig.plant.position(), rig.plant.rotation());
  });
  return {motion.lasts(), motion.late(), rig.stats().faults};
}

}  // namespace stability
