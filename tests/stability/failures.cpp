// Cases in which a method fails, the first ten of them those of facts section 4: raw, with the protections switched off, where it must fail, and
// with the default options, where it must not.
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>

#include "boundary.h"
#include "csv.h"
#include "device/sim/parameters.h"
#include "measure.h"
#include "plant/rig.h"
#include "scenes/random.h"
#include "stability.h"

namespace stability {

using namespace scenes;

namespace {

constexpr double millimetres = 1e3;

struct Curve {  // of a picture
  std::vector<double> time, value;
};

// Two curves of equal length, side by side.
void write(const std::string& folder, const std::string& name, const std::string& unit, const Curve& raw, const Curve& cured) {
  Csv csv(folder, "failure_" + name, "time s,raw " + unit + ",cured " + unit);
  for (size_t i = 0; csv && i < raw.time.size() && i < cured.time.size(); ++i) {
    csv.row({raw.time[i], raw.value[i], cured.value[i]});
  }
}

fs_servo_options options(bool is_cured) { return is_cured ? default_options() : raw_options(); }

fs_object plane(const char* name, fs_profile front, fs_profile back) {
  fs_object object = fs_object_init(name, FS_PRIMITIVE_PLANE);
  object.front = front;
  object.back = back;
  return object;
}

fs_vec3 normal_force(const Rig& rig) { return rig.plant.applied(); }

DeviceModel with_delay(double delay) {
  DeviceModel device;
  device.delay = delay;
  return device;
}

// A hand whose target moves once, when all objects have faded in, in the time that it takes: what the hand does, in 8 s.
struct Rest {
  Oscillation motion;
  Span late;        // of the coordinate that counts
  double last = 0;  // m, that coordinate at the end
  Curve curve;      // mm
  bool is_refused = false, has_fault = false;
  // Whether the hand stands still, and not because the servo has switched the force off.
  bool is_still() const { return !motion.lasts() && swing() < 0.1 && !has_fault; }
  double swing() const { return millimetres * late.length(); }  // mm, peak to peak in the last second
};
Rest rest(Rig& rig, const fs_servo_options& options, fs_vec3 first_target, fs_vec3 target,
          const std::function<double(fs_vec3)>& coordinate, double takes = 1e-3) {
  constexpr double begin = 1.5;  // s
  Rest r;
  rig.plant.put(first_target);
  rig.plant.target = first_target;
  r.is_refused = !rig.start(options);
  if (r.is_refused) return r;
  rig.run(r.motion.end(), [&](double t) {
    rig.plant.target = first_target + std::clamp((t - begin) / takes, 0.0, 1.0) * (target - first_target);
    const fs_vec3 x = rig.plant.position();
    r.motion.add(t, x);
    r.last = coordinate(x);
    if (t >= 7) r.late.add({r.last, 0, 0});
    r.curve.time.push_back(t);
    r.curve.value.push_back(millimetres * r.last);
  });
  r.has_fault = rig.stats().faults != 0;
  return r;
}
double along_z(fs_vec3 x) { return x.z; }

// ---- 1: an inverse profile is too steep for a delayed loop.
void inverse(Report& report, const std::string& folder) {
  report.title("1: inverse, gain 0.02 N m, limit 10 N (5000 N/m at the steepest), pushed with 5.4 N, no friction");
  const auto run = [](double delay, double push, bool is_held_behind, bool is_cured) {
    DeviceModel device = with_delay(delay);
    device.friction = 0;
    Rig rig(device, nominal);
    const fs_profile behind = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 10, 0, 10);
    rig.set(plane("inverse", fs_profile_init(FS_PROFILE_INVERSE, FS_SENSE_REPULSIVE, 0.02, 0, 10),
                  is_held_behind ? behind : fs_profile{}));
    return rest(rig, options(is_cured), {0, 0, 0.02}, {0, 0, 0.02 / push - push / nominal.stiffness}, along_z);
  };
  for (const double delay : {0.005, 0.01}) {
    const double push = 5.4;
    const Rest raw = run(delay, push, true, false), cured = run(delay, push, true, true);
    const double p_p = raw.swing(), cured_p_p = cured.swing();
    report.check(format("1/raw/%g_ms", 1e3 * delay), raw.motion.lasts() && p_p > 0.5,
                 format("oscillates (facts: 1.28 mm p-p at 5 ms): %.2f mm", p_p));
    report.check(format("1/cured/%g_ms", 1e3 * delay), cured.is_still() && cured.last > -5e-3,
                 format("the tangent below sqrt(gain/k) holds the hand, at rest: %.2f mm p-p, at %.1f mm", cured_p_p,
                        millimetres * cured.last));
    write(folder, format("1_inverse_%g_ms", 1e3 * delay), "position mm", raw.curve, cured.curve);
  }
  const Rest through = run(0.01, 5.4, false, false);
  report.check("1/raw/goes_through", through.last < -0.03,
               format("with nothing behind and 10 ms, the hand goes through a limit of 10 N (facts: -42 mm): %.0f mm",
                      millimetres * through.last));
}

// ---- 2: a constant attraction reverses at the object.
void constant(Report& report, const std::string& folder) {
  report.title("2: constant attraction of 3 N: the force reverses across the object");
  const double facts[] = {0.09, 0.78, 4.2};  // mm
  int i = 0;
  for (const double delay : {0.0, 0.002, 0.01}) {
    const auto run = [&](bool is_cured) {
      Rig rig(with_delay(delay), nominal);
      const fs_profile pull = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 3, 0, 3);
      rig.set(plane("plane", pull, pull));
      return rest(rig, options(is_cured), {0, 0, 0.01}, {}, along_z);
    };
    const Rest raw = run(false), cured = run(true);
    const double amplitude = raw.swing() / 2;
    report.check(format("2/raw/%g_ms", 1e3 * delay), amplitude > 0.5 * facts[i] && amplitude < 2 * facts[i],
                 format("oscillates with an amplitude of about %.2f mm: %.2f", facts[i], amplitude));
    report.check(format("2/cured/%g_ms", 1e3 * delay), cured.is_still() && cured.swing() < 0.05,
                 format("min(F, k d) stands still: %.3f mm p-p", cured.swing()));
    write(folder, format("2_constant_%g_ms", 1e3 * delay), "position mm", raw.curve, cured.curve);
    ++i;
  }
}

// ---- 3: a gaussian attracts most where its direction reverses.
void gaussian(Report& report, const std::string& folder) {
  report.title("3: gaussian attraction, 5 N and 5 mm, the hand follows a slow target through the centre");
  const auto run = [&](bool is_cured, Curve& curve) {
    Rig rig(with_delay(0), nominal);
    rig.plant.put({-0.045, 0, 0});
    rig.plant.target = {-0.045, 0, 0};
    fs_object point = fs_object_init("point", FS_PRIMITIVE_POINT);
    point.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_ATTRACTIVE, 5, 0.005, 5);
    rig.set(point);
    fs_servo_options wanted = options(is_cured);
    if (is_cured) wanted.max_stiffness = 1500;
    rig.start(wanted);
    std::vector<double> force;
    rig.run(6, [&](double t) {
      rig.plant.target.x = -0.045 + 0.0225 * std::clamp(t - 2, 0.0, 4.0);
      if (t >= 2) {
        force.push_back(rig.plant.applied().x);
        curve.time.push_back(t);
        curve.value.push_back(force.back());
      }
    });
    Rms ripple;  // without what is slower than 50 ms
    double sum = 0;
    for (size_t i = 0; i < force.size(); ++i) {
      sum += force[i];
      if (i < 50) continue;
      sum -= force[i - 50];
      ripple.add(force[i - 25] - sum / 50);
    }
    return ripple.value();
  };
  Curve raw_curve, cured_curve;
  const double raw = run(false, raw_curve), cured = run(true, cured_curve);
  report.check("3/raw", raw > 1, format("the force ripples (facts: 2.2 N rms): %.2f N", raw));
  report.check("3/cured", cured < 0.15, format("the core min(f, 1500 d) does not (facts: 0.095 N): %.3f N", cured));
  write(folder, "3_gaussian", "force N", raw_curve, cured_curve);
}

// ---- 4: the direction jumps at the medial axis of a corner.
void corner(Report& report, const std::string& folder) {
  report.title("4: a corner of 90 degrees repels with 5 N, the hand is pushed into it");
  const double facts[] = {0.63, 2.7, 6.1, 12.3};  // mm
  int i = 0;
  for (const double delay : {0.0, 0.002, 0.005, 0.01}) {
    const auto run = [&](bool is_cured) {
      DeviceModel device = with_delay(delay);
      device.friction = 0;
      Rig rig(device, nominal);
      const double along = 0.02 / std::sqrt(2.0), back = 5 / (2 * nominal.stiffness);
      const fs_vec3 points[] = {{0.15, 0, 0}, {0, 0, 0}, {0, 0.15, 0}};
      const Shape shape = make_polyline(points, 3, false);
      fs_object object = fs_object_init("corner", FS_PRIMITIVE_POLYLINE);
      object.shape = shape.get();
      object.front = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_REPULSIVE, 5, 0, 5);
      rig.set(object);
      return rest(rig, options(is_cured), {0.031, 0.03, 0}, {along - back, along - back, 0}, [](fs_vec3 x) { return (x.x - x.y) / std::sqrt(2.0); },
                  0.8);
    };
    const Rest raw = run(false), cured = run(true);
    const double p_p = raw.swing();
    report.check(format("4/raw/%g_ms", 1e3 * delay), p_p > 0.7 * facts[i] && p_p < 1.4 * facts[i],
                 format("oscillates by about %.2f mm p-p: %.2f", facts[i], p_p));
    report.check(format("4/cured/%g_ms", 1e3 * delay), cured.is_still() && cured.swing() < 0.05,
                 format("the blended direction stands still: %.3f mm p-p", cured.swing()));
    write(folder, format("4_corner_%g_ms", 1e3 * delay), "position mm", raw.curve, cured.curve);
    ++i;
  }
}

// ---- 5: a thin sheet that only repels by depth lets the hand through.
void sheet(Report& report, const std::string& folder) {
  report.title("5: a sheet of 4 mm, 1000 N/m, pushed with 2.7 N");
  const auto run = [&](bool is_solid, double push, Curve& curve) {
    Rig rig(with_delay(0), nominal);
    rig.plant.put({0, 0, 0.02});
    const double a = 0.1, d = -0.004;
    const fs_vec3 points[] = {{-a, -a, d}, {a, -a, d}, {a, a, d}, {-a, a, d}, {-a, -a, 0}, {a, -a, 0}, {a, a, 0}, {-a, a, 0}};
    const uint32_t triangles[] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                  1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};
    fs_shape* made = nullptr;
    require(fs_shape_create_mesh(points, 8, triangles, 12, &made), "fs_shape_create_mesh");
    const Shape shape(made);
    fs_object object = fs_object_init("sheet", FS_PRIMITIVE_MESH);
    object.shape = shape.get();
    if (is_solid) {
      object.contact.keep = FS_KEEP_FRONT;
      object.contact.limit = 25;
      object.contact.stiffness = 1000;
    } else {
      object.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, 1000, 0, 25);
    }
    rig.set(object);
    rig.start(options(is_solid));
    double lowest_force = 0;
    rig.run(6, [&](double t) {
      const double part = std::clamp((t - 1) / 3, 0.0, 1.0);
      rig.plant.target.z = 0.02 - part * (0.02 + push / 1000 + push / nominal.stiffness);
      lowest_force = std::min(lowest_force, normal_force(rig).z);
      curve.time.push_back(t);
      curve.value.push_back(millimetres * rig.plant.position().z);
    });
    struct End {
      double z, force, lowest_force;
    };
    return End{rig.plant.position().z, normal_force(rig).z, lowest_force};
  };
  Curve raw_curve, cured_curve, unused;
  const auto raw = run(false, 2.7, raw_curve);
  report.check("5/raw", raw.z < -0.015, format("it pops through (facts: -21 mm): %.1f mm", millimetres * raw.z));
  const auto cured = run(true, 2.7, cured_curve), hard = run(true, 20, unused);
  report.check("5/cured", cured.force > 2 && cured.lowest_force > -0.05,
               format("a solid sheet holds the hand: %.1f N at %.1f mm", cured.force, millimetres * cured.z));
  report.check("5/cured/20_N", hard.force > 17 && hard.lowest_force > -0.05,
               format("up to 20 N: %.1f N at %.1f mm", hard.force, millimetres * hard.z));
  write(folder, "5_sheet", "position mm", raw_curve, cured_curve);
}

// ---- 6: a wall moves, and its poses come 25 times a second.
void moving_wall(Report& report, const std::string& folder) {
  report.title("6: a wall of 1000 N/m moves by +-10 mm at 1 Hz; its poses come at 25 Hz, 5 +-5 ms late");
  enum class How { held, interpolated, extrapolated };
  struct End {
    double error, jump;  // N rms, N in a ms
  };
  const auto run = [&](How how, const fs_servo_options& options, Curve& curve) {
    const auto wall_at = [](double t) { return 0.01 * std::sin(2 * std::numbers::pi * t); };
    const auto speed_at = [](double t) { return 0.01 * 2 * std::numbers::pi * std::cos(2 * std::numbers::pi * t); };
    Rig rig(with_delay(0), nominal);
    rig.plant.target = {0, 0, -0.04};
    fs_object wall = fs_wall_init("wall", {0, 0, 0}, {0, 0, 1}, 1000, 25);
    rig.set(wall);
    rig.start(options);
    Random random(6);
    double sampled = 0, arrives = 0, next = 0, before = 0, newest = 0, arrived = -1;
    Rms error;
    double jump = 0, last = 0;
    rig.run(6, [&](double t) {
      if (t >= next - 1e-9) sampled = next, arrives = next + random.between(0, 0.01), next += 0.04;
      if (t >= arrives - 1e-9 && arrives >= 0) {
        arrives = -1;
        before = newest, newest = wall_at(sampled), arrived = t;
        const fs_twist twist{{0, 0, how == How::extrapolated ? speed_at(sampled) : 0}, {}};
        fs_pose pose = wall.pose;
        pose.position.z = newest;
        if (how != How::interpolated) {
          require(fs_object_move(rig.scene.get(), "wall", &pose, &twist, std::max(sampled, 1e-9)), "fs_object_move");
        }
      }
      if (how == How::interpolated && arrived >= 0) {
        fs_pose pose = wall.pose;
        pose.position.z = before + std::min(1.0, (t - arrived) / 0.04) * (newest - before);
        const fs_twist still{};
        require(fs_object_move(rig.scene.get(), "wall", &pose, &still, FS_NOW), "fs_object_move");
      }
      const double force = rig.plant.commanded().z;
      if (t > 2) {
        error.add(force - 1000 * std::max(0.0, wall_at(t) - rig.plant.position().z));
        jump = std::max(jump, std::fabs(force - last));
        curve.time.push_back(t);
        curve.value.push_back(force);
      }
      last = force;
    });
    return End{error.value(), jump};
  };
  Curve raw_curve, cured_curve, unused;
  const End held = run(How::held, raw_options(), raw_curve), between = run(How::interpolated, raw_options(), unused),
            twist = run(How::extrapolated, raw_options(), unused), cured = run(How::extrapolated, default_options(), cured_curve);
  report.check("6/raw/held", held.error > 0.7 && held.jump > 1.2,
               format("held poses (facts: 1.39 N rms, jumps of 2.49 N): %.2f N, %.2f N", held.error, held.jump));
  report.check("6/raw/interpolated", between.error > held.error,
               format("interpolated poses err more (facts: 2.13 N rms): %.2f N", between.error));
  report.check("6/raw/extrapolated", twist.error < 0.3 && twist.jump < 1,
               format("extrapolated by the twist (facts: .18 N rms, .55 N in a ms): %.2f N, %.2f N", twist.error, twist.jump));
  report.check("6/cured", cured.error < 0.45 && cured.jump < 0.15,
               format("and blended over 20 ms (facts: .31 N rms, .05 N in a ms): %.2f N, %.2f N", cured.error, cured.jump));
  write(folder, "6_moving_wall", "force N", raw_curve, cured_curve);
}

// ---- 7: the client of a wall dies.
void dead_client(Report& report, const std::string& folder) {
  report.title("7: the client dies while its wall pushes the hand with 5 N");
  struct End {
    double speed, jump, way;  // m/s, N in a ms, m against the wall's normal
  };
  const auto run = [&](bool is_cured, double wall_speed, Curve& curve) {
    Rig rig(with_delay(0), nominal);
    rig.plant.target = {0, 0, -0.042};
    fs_object wall = fs_wall_init("wall", {0, 0, 0}, {0, 0, 1}, 1000, 25);
    if (is_cured) wall.lifetime = 0.2;
    rig.set(wall);
    rig.start(options(is_cured));
    const double dies = 3;
    double next = 0, last = 0, z_then = 0;
    bool is_removed = false;
    End end{};
    rig.run(6, [&](double t) {
      if (is_cured && t < dies && t >= next) {
        next += 0.04;
        const double since = std::max(0.0, t - 2.5);  // it begins to move half a second before
        fs_pose pose = wall.pose;
        pose.position.z = wall_speed * since;
        const fs_twist twist{{0, 0, since > 0 ? wall_speed : 0}, {}};
        require(fs_object_move(rig.scene.get(), "wall", &pose, &twist, std::max(t, 1e-9)), "fs_object_move");
      }
      if (!is_cured && t >= dies && !is_removed) {
        is_removed = true;
        require(fs_object_remove(rig.scene.get(), "wall"), "fs_object_remove");
      }
      const double force = rig.plant.commanded().z;
      if (t < dies) z_then = rig.plant.position().z;
      if (t > dies) {
        end.speed = std::max(end.speed, norm(rig.plant.velocity()));
        end.jump = std::max(end.jump, std::fabs(force - last));
        end.way = std::max(end.way, rig.plant.position().z - z_then);
      }
      last = force;
      curve.time.push_back(t);
      curve.value.push_back(force);
    });
    return end;
  };
  Curve raw_curve, cured_curve, unused;
  const End raw = run(false, 0, raw_curve), cured = run(true, 0, cured_curve), moving = run(true, 0.05, unused);
  report.check("7/raw", raw.jump > 3 && raw.speed > 0.2,
               format("removed at once (facts: 5.1 N in a ms, 262 mm/s): %.2f N, %.0f mm/s", raw.jump, 1e3 * raw.speed));
  report.check("7/cured", cured.jump < 0.1 && cured.speed < 0.18,
               format("a lifetime of 0.2 s and a fade of 1 s (facts: .03 N in a ms, 137 mm/s): %.3f N, %.0f mm/s", cured.jump,
                      1e3 * cured.speed));
  report.check("7/cured/moving", moving.way < 0.01,
               format("a wall that was moving at 50 mm/s pushes on for 0.1 s (for ever in facts: +53 mm): %.1f mm",
                      millimetres * moving.way));
  write(folder, "7_dead_client", "force N", raw_curve, cured_curve);
}

// ---- 8: the velocity of an encoder is rough.
void rough_velocity(Report& report, const std::string& folder) {
  report.title("8: damping of 20 N s/m from an encoder of 20 um, the handle moves at 5 mm/s");
  const auto run = [&](bool is_raw, bool is_of_object, Curve& curve) -> std::optional<double> {
    DeviceModel device;
    device.gives_raw_twist = is_raw;
    Rig rig(device, nominal);
    rig.plant.is_held_by_stage = true;
    rig.plant.target = {0, 0, 0.01};
    fs_servo_options servo = raw_options();
    if (is_of_object) {
      fs_object object = plane("damper", fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_REPULSIVE, 5, 0, 25), fs_profile{});
      object.damping = 20;
      rig.set(object);
    } else {
      servo.damping = 20;
    }
    if (!rig.start(servo)) return std::nullopt;
    Rms rough;
    const double expected = is_of_object ? 5 - 20 * 0.005 : -20 * 0.005;
    rig.run(5, [&](double t) {
      rig.plant.target.z = 0.01 + 0.005 * (t + rig.period());
      if (t < 1) return;
      const double force = rig.plant.commanded().z;
      rough.add(force - expected);
      curve.time.push_back(t);
      curve.value.push_back(force - expected);
    });
    return rough.value();
  };
  Curve raw_curve, cured_curve, unused;
  const double raw = *run(true, true, raw_curve), cured = *run(false, true, cured_curve);
  const std::optional<double> local = run(false, false, unused);
  report.check("8/raw", std::fabs(raw / 0.172 - 1) < 0.1, format("the plain difference: .172 N rms: %.3f", raw));
  report.check("8/cured/object", std::fabs(cured / 0.066 - 1) < 0.15,
               format("an object's damping, filtered at 100 Hz: .066 N rms: %.3f", cured));
  report.check("8/cured/local", local && *local < 0.066 * 1.15,
               local ? format("the servo's damping, filtered at 100 Hz: .066 N rms at most: %.3f", *local)
                     : std::string("the servo's damping: ") + fs_last_error());
  write(folder, "8_velocity", "force N", raw_curve, cured_curve);
}

// ---- 9: motors that are clipped one by one turn the force.
double angle(fs_vec3 a, fs_vec3 b) {
  return 180 / std::numbers::pi * std::atan2(norm(cross(a, b)), dot(a, b));
}

void clipped_motors(Report& report, const std::string& folder) {
  report.title("9: 40 N are wanted at the edge of the workspace of a DELTA robot with 25 N");
  namespace robot = fs::fidel;
  Csv csv(folder, "failure_9_clipping", "direction,raw deg,cured deg");
  Random random(9);
  double worst = 0, sum = 0, worst_cured = 0;
  constexpr int count = 400;
  for (int i = 0; i < count; ++i) {
    const double turn = random.between(0, 2 * std::numbers::pi);
    const fs_vec3 x{robot::workspace_radius * std::cos(turn), robot::workspace_radius * std::sin(turn),
                    random.between(-0.5, 0.5) * robot::workspace_height + robot::centre_depth};
    const fs_vec3 wanted = 40 * random.direction();
    const auto angles = fs::delta_inverse(robot::geometry, x);
    const auto jacobian = angles ? fs::delta_jacobian(robot::geometry, x, *angles) : std::nullopt;
    if (!jacobian) continue;
    // The motors that give 25 N in each direction in the middle of the workspace; each is clipped by itself.
    const fs_mat3 j = jacobian->jacobian;
    const double most = robot::motor_torque_max * 25 / 40;
    fs_vec3 torque{j.xx * wanted.x + j.yx * wanted.y + j.zx * wanted.z, j.xy * wanted.x + j.yy * wanted.y + j.zy * wanted.z,
                   j.xz * wanted.x + j.yz * wanted.y + j.zz * wanted.z};
    for (double* value : {&torque.x, &torque.y, &torque.z}) *value = std::clamp(*value, -most, most);
    // The force that these torques give: J^T F = torque, by Cramer's rule.
    const fs_vec3 a{j.xx, j.yx, j.zx}, b{j.xy, j.yy, j.zy}, c{j.xz, j.yz, j.zz};
    const double volume = dot(a, cross(b, c));
    const fs_vec3 given = (1 / volume) * (torque.x * cross(b, c) + torque.y * cross(c, a) + torque.z * cross(a, b));
    const double raw = angle(wanted, given);
    worst = std::max(worst, raw);
    sum += raw;

    // What the library sends of 40 N in that direction.
    double cured = 0;
    if (i % 10 == 0) {
      Rig rig(with_delay(0), nominal);
      rig.plant.is_held_by_stage = true;
      fs_object object = plane("push", fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_REPULSIVE, 40, 0, 40), fs_profile{});
      require(fs_pose_from_z(-0.05 * unit(wanted), wanted, &object.pose), "fs_pose_from_z");
      rig.set(object);
      rig.start(default_options());
      rig.run(2, [](double) {});
      const fs_vec3 sent = rig.plant.commanded();
      cured = norm(sent) > 24 ? angle(wanted, sent) : 180;
      worst_cured = std::max(worst_cured, cured);
      csv.row({static_cast<double>(i), raw, cured});
    }
  }
  report.check("9/raw", sum / count > 5 && worst > 20,
               format("clipping each motor turns the force (facts: 14 degrees in the mean, 48 at most): %.0f, %.0f", sum / count,
                      worst));
  report.check("9/cured", worst_cured < 1e-5, format("the library keeps the direction: %.1e degrees at most", worst_cured));
}

// ---- 10: the slopes of overlapping objects add.
void overlapping(Report& report, const std::string& folder) {
  report.title("10: N attractors of 2000 N/m and 3 N at one place, 2 ms, light hand, no friction");
  const bool has_local_damping = [] {
    Rig rig(with_delay(0.002), light);
    fs_servo_options servo = raw_options();
    servo.damping = 5;
    return rig.start(servo);
  }();
  if (!has_local_damping) report.note("the library has no local damping yet: the device has 5 N s/m more instead");
  LinearLoop loop = linear_loop(with_delay(0.002), light);
  loop.rendered_damping = 5, loop.cutoff = 100;
  report.note(format("exact boundary with a local damping of 5 N s/m: %.0f N/m", critical_stiffness(loop)));
  const auto run = [&](int count, double stiffness, bool is_cured) {
    DeviceModel device = with_delay(0.002);
    device.friction = 0;
    if (!is_cured && !has_local_damping) device.damping += 5;
    Rig rig(device, light);
    for (int i = 0; i < count; ++i) {
      fs_object point = fs_object_init(format("point %d", i).c_str(), FS_PRIMITIVE_POINT);
      point.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, stiffness, 0, 3);
      rig.set(point);
    }
    fs_servo_options servo = options(is_cured);
    if (!is_cured && has_local_damping) servo.damping = 5;  // the damping that the cure has too
    return rest(rig, servo, {0, 0, 5e-3}, {}, along_z);
  };
  const double alone = (1 + 5) / 2.0 / (0.5e-3 + 0.002);
  Csv csv(folder, "failure_10_overlapping", "objects,raw mm,capped one by one mm,cured mm");
  for (const int count : {1, 2, 4, 8, 16}) {
    const Rest raw = run(count, 2000, false), one_by_one = run(count, alone, false), cured = run(count, 2000, true);
    csv.row({static_cast<double>(count), raw.swing(), one_by_one.swing(),
             cured.swing()});
    report.check(format("10/raw/%d", count), !raw.is_refused && raw.motion.lasts() == (count >= 2),
                 format("%s: %.2f mm p-p", count >= 2 ? "oscillates" : "one alone stands still", raw.swing()));
    report.check(format("10/one_by_one/%d", count), !one_by_one.is_refused && one_by_one.motion.lasts() == (count >= 4),
                 format("each capped to %.0f N/m %s: %.2f mm p-p", alone, count >= 4 ? "still oscillates" : "stands still",
                        one_by_one.swing()));
    report.check(format("10/cured/%d", count), cured.is_still(),
                 format("a shared cap stands still: %.2f mm p-p", cured.swing()));
    if (count == 4) write(folder, "10_overlapping_4", "position mm", raw.curve, cured.curve);
  }
}

// ---- 11: a texture is steeper along the surface than the loop bears.
void texture(Report& report, const std::string& folder) {
  constexpr double height = 1e-4, apart = 1e-3, push = 3;  // m, m, N
  const double wave = 2 * std::numbers::pi / apart;
  report.title(format("11: ridges of +-0.1 mm, 1 mm apart, pressed with 3 N: %.0f N/m along the surface in a groove, no friction",
                      push * height * wave * wave));
  std::vector<double> heights;
  for (int i = 0; i < 16; ++i) heights.push_back(height * (std::cos(wave * apart * i / 16) - 1));
  fs_surface_settings settings = fs_surface_settings_init();
  settings.columns = 16;
  settings.rows = 1;
  settings.column_width = apart / 16;
  settings.repeats = true;
  const Surface surface = make_texture(settings, heights);
  for (const double delay : {0.0, 0.002, 0.01}) {
    double left = 0;  // of the heights
    const auto run = [&](bool is_cured) {
      DeviceModel device = with_delay(delay);
      device.friction = 0;
      Rig rig(device, nominal);
      fs_object ridges = plane("ridges", {}, {});
      ridges.contact.keep = FS_KEEP_FRONT;
      ridges.contact.stiffness = 300;
      ridges.contact.limit = 5;
      ridges.surface = surface.get();
      rig.set(ridges);
      const double x = 0.3e-3;  // on the slope of a ridge
      const Rest r = rest(rig, options(is_cured), {x, 0, 0.01}, {x, 0, -push / 300 - push / nominal.stiffness},
                          [](fs_vec3 at) { return at.x; }, 0.5);
      fs_report told;
      require(fs_scene_get_report(rig.scene.get(), "ridges", &told), "fs_scene_get_report");
      left = 1 - told.texture_lost;
      return r;
    };
    const Rest raw = run(false), cured = run(true);
    const bool is_too_fine = delay > 0;
    report.check(format("11/raw/%g_ms", 1e3 * delay), raw.motion.lasts() == is_too_fine,
                 format("%s: %.2f mm p-p", is_too_fine ? "does not come to rest in a groove" : "rests", raw.swing()));
    report.check(format("11/cured/%g_ms", 1e3 * delay), cured.is_still() && left > 0,
                 format("%.0f %% of the heights stay, and the hand is still: %.3f mm p-p", 100 * left, cured.swing()));
    write(folder, format("11_texture_%g_ms", 1e3 * delay), "position mm", raw.curve, cured.curve);
  }
}

// ---- 12: an impact gives the hand more speed than it came with.
void impact(Report& report, const std::string& folder) {
  report.title("12: a table of 80 N/m with an impact of 200 N s/m at 30 Hz; a released handle of 50 g of weight falls on it, no friction");
  fs_surface_settings settings = fs_surface_settings_init();
  settings.impact_gain = 200;
  settings.impact_frequency = 30;
  settings.impact_decay = 30;
  const Surface surface = make_surface(settings);
  for (const double rate : {500.0, 1000.0, 4000.0}) {
    for (const double delay : {0.0, 0.002, 0.005, 0.02}) {
      double lost = 0;
      const auto run = [&](bool is_cured, bool has_impact) {
        DeviceModel device = with_delay(delay);
        device.friction = 0;
        device.damping = 3;
        device.rate = rate;
        Rig rig(device, released);
        rig.plant.push = {0, 0, -0.5};
        fs_object table = plane("table", {}, {});
        table.contact.keep = FS_KEEP_FRONT;
        table.contact.stiffness = 80;
        table.contact.limit = 20;
        table.surface = has_impact ? surface.get() : nullptr;
        rig.set(table);
        fs_servo_options servo = options(is_cured);
        servo.rate = rate;
        const Rest r = rest(rig, servo, {0, 0, 0.02}, {0, 0, 0.02}, along_z);
        fs_report told;
        require(fs_scene_get_report(rig.scene.get(), "table", &told), "fs_scene_get_report");
        lost = told.impact_lost;
        return r;
      };
      const Rest raw = run(false, true), without = run(false, false), cured = run(true, true);
      const std::string at = format("%g_Hz_%g_ms", rate, 1e3 * delay);
      report.check("12/raw/" + at, raw.motion.lasts() && without.is_still(),
                   format("bounces without end: %.1f mm p-p; without the impact %.3f mm", raw.swing(), without.swing()));
      report.check("12/cured/" + at, cured.is_still() && lost > 0 && lost < 1,
                   format("bounded to %.2f %% it rests: %.3f mm p-p", 100 * (1 - lost), cured.swing()));
      if (rate == 1000) write(folder, format("12_impact_%g_ms", 1e3 * delay), "position mm", raw.curve, cured.curve);
    }
  }
}

// ---- 13: a light hand is pulled along a surface that sticks and slips; then it stops.
void stick_slip(Report& report, const std::string& folder) {
  report.title("13: a light hand is pulled by 40 mm over a surface of 0.8 and 0.3, pressed with 2 N, no friction of the device");
  const Surface surface = make_surface(sticky(0.8, 0.3, 0));
  for (const double delay : {0.0, 0.002, 0.01}) {
    const auto run = [&](bool is_cured) {
      DeviceModel device = with_delay(delay);
      device.friction = 0;
      Rig rig(device, light);
      fs_object table = plane("table", {}, {});
      table.contact.keep = FS_KEEP_FRONT;
      table.contact.stiffness = 5000;
      table.contact.limit = 20;
      table.surface = surface.get();
      rig.set(table);
      const double down = -0.02;
      return rest(rig, options(is_cured), {0, 0, down}, {0.04, 0, down}, [](fs_vec3 x) { return x.x; }, 2);
    };
    const Rest raw = run(false), cured = run(true);
    const bool is_too_stiff = delay > 0;
    report.check(format("13/raw/%g_ms", 1e3 * delay), raw.motion.lasts() == is_too_stiff,
                 format("5000 N/m %s: %.2f mm p-p", is_too_stiff ? "shake" : "rest", raw.swing()));
    // It has slipped, and sticks before the hand is where it wants to be.
    report.check(format("13/cured/%g_ms", 1e3 * delay), cured.is_still() && cured.last > 0.02 && cured.last < 0.04,
                 format("slips to %.1f mm, where it sticks: %.3f mm p-p", millimetres * cured.last, cured.swing()));
    write(folder, format("13_stick_slip_%g_ms", 1e3 * delay), "position mm", raw.curve, cured.curve);
  }
}

}  // namespace

void run_failures(Report& report, const std::string& folder) {
  inverse(report, folder);
  constant(report, folder);
  gaussian(report, folder);
  corner(report, folder);
  sheet(report, folder);
  moving_wall(report, folder);
  dead_client(report, folder);
  rough_velocity(report, folder);
  clipped_motors(report, folder);
  overlapping(report, folder);
  texture(report, folder);
  impact(report, folder);
  stick_slip(report, folder);
}

}  // namespace stability
