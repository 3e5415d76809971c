// One task, felt in several ways: computed by the application at 25 Hz, by the library's servo, behind a link.
//
// The task, 8.5 s: the hand comes down to a wall and presses on it; slides along a polyline that lies on the wall and draws it
// sideways; leaves both, and slides along a plane that repels it with a gaussian. What it does across its way while it
// slides, peak to peak, is the oscillation: it slides at 0.14 m/s, where friction, which acts along the motion, hardly helps.
#include <cmath>
#include <functional>
#include <numbers>

#include "boundary.h"
#include "csv.h"
#include "measure.h"
#include "plant/rig.h"
#include "stability.h"

namespace stability {

using namespace scenes;

namespace {

constexpr double task_length = 8.5;  // s
constexpr double wall_stiffness = 1000, line_stiffness = 300;  // N/m
constexpr double bump_force = 12, bump_width = 0.01105;        // N, m: 659 N/m at the steepest
const fs_vec3 line[] = {{-0.3, 0, 0}, {0.3, 0, 0}};  // m
constexpr double bump_at = 0.15;                         // m, along z: it repels from below

// From 0 to 1 while t goes through from..to, smoothly.
double part(double t, double from, double to) {
  return 0.5 - 0.5 * std::cos(std::numbers::pi * std::clamp((t - from) / (to - from), 0.0, 1.0));
}

// A stiffer hand aims less far beyond, so that all hands push with about the same force.
fs_vec3 target_at(double t, const HandModel& hand) {
  const double soft = nominal.stiffness / hand.stiffness;
  const double pressed = -0.03 * soft, on_bump = bump_at - 0.0146 + 0.0566 * soft;
  const double z = 0.02 + (pressed - 0.02) * part(t, 0.1, 1.3) + (on_bump - pressed) * part(t, 5, 6);
  const double there = std::clamp((t - 2.4) / 2.6, 0.0, 1.0), back = std::clamp((t - 6.2) / 2.3, 0.0, 1.0);
  return {-0.18 + 0.36 * there - 0.36 * back, 0.015 * soft * (part(t, 0.1, 1.3) - part(t, 5, 6)), z};
}
struct Stretch {
  double from, to;  // s
};
constexpr Stretch slides[] = {{3, 4.8}, {6.8, 8.3}};

// All slopes are scaled by `scale`, and none is above `cap`.
void add_task(fs_scene* scene, double scale, double cap) {
  const auto slope = [&](double k) { return std::min(scale * k, cap); };
  const auto set = [&](const fs_object& o) { require(fs_object_set(scene, &o), "fs_object_set"); };
  set(fs_wall_init("wall", {0, 0, 0}, {0, 0, 1}, slope(wall_stiffness), 25));

  const Shape shape = make_polyline(line, std::size(line), false);
  fs_object path = fs_object_init("path", FS_PRIMITIVE_POLYLINE);
  path.shape = shape.get();
  path.front = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, slope(line_stiffness), 0, 4);
  set(path);

  fs_object bump = fs_object_init("bump", FS_PRIMITIVE_PLANE);
  require(fs_pose_from_z({0, 0, bump_at}, {0, 0, -1}, &bump.pose), "fs_pose_from_z");
  const double steepest = std::exp(-0.5) * bump_force / bump_width;
  bump.front = fs_profile_init(FS_PROFILE_GAUSSIAN, FS_SENSE_REPULSIVE, bump_force, bump_width * steepest / slope(steepest),
                               25);
  bump.front.reach = 0.07;
  set(bump);
}

struct Result {
  double error = 0, energy = 0, oscillation = 0;  // N rms, J, m
  struct Moment {
    double time;
    fs_vec3 position, force;
  };
  std::vector<Moment> trace;  // of each tick
};

// Collects a result from the loop, tick by tick.
class Judge {
 public:
  Judge() : ideal_(make_scene()), tool_(make_tool(ideal_.get())) { add_task(ideal_.get(), 1, INFINITY); }

  void tick(double t, const Plant& plant) {
    const fs_vec3 x = plant.position();
    fs_state state{};
    state.pose = at(x);
    fs_response response;
    fs_evaluate(tool_.get(), &state, &response);
    const fs_vec3 force = response.wrench.force;
    error_.add(plant.applied() - force);
    ideal_work_ += 0.5 * dot(force + last_force_, x - last_x_);
    last_force_ = force;
    last_x_ = x;
    result_.trace.push_back({t, x, plant.applied()});
  }
  Result end(const Plant& plant) {
    result_.error = error_.value();
    result_.energy = plant.work() - ideal_work_;
    for (const Stretch& slide : slides) result_.oscillation = std::max(result_.oscillation, across(slide));
    return std::move(result_);
  }

 private:
  // The motion across the way, peak to peak, without what is slower than 0.3 s: its mean over that time is subtracted.
  double across(const Stretch& slide) const {
    const std::vector<Result::Moment>& trace = result_.trace;
    const size_t half = static_cast<size_t>(0.15 / trace.front().time), width = 2 * half + 1;
    fs_vec3 sum{};
    Span span;
    for (size_t i = 0; i < trace.size(); ++i) {
      sum = sum + trace[i].position;
      if (i + 1 < width) continue;
      const Result::Moment& middle = trace[i - half];
      const fs_vec3 rest = middle.position - (1.0 / static_cast<double>(width)) * sum;
      if (middle.time >= slide.from && middle.time < slide.to) span.add({0, rest.y, rest.z});
      sum = sum - trace[i + 1 - width].position;
    }
    return span.length();
  }

  Scene ideal_;
  Tool tool_;
  Rms error_;
  double ideal_work_ = 0;
  fs_vec3 last_x_{-0.18, 0, 0.02}, last_force_{};
  Result result_;
};

// A way without the library's servo is a function that is called at each tick of the device's controller, with the time and
// the measured position, and returns the force. It may evaluate the scene whenever its way allows it.
using Evaluate = std::function<fs_response(fs_vec3)>;
using Controller = std::function<fs_vec3(double t, fs_vec3 measured, const Evaluate&)>;

Result run_controller(const DeviceModel& device, const HandModel& hand, double scale, double cap,
                      const Controller& controller) {
  const Scene scene = make_scene();
  add_task(scene.get(), scale, cap);
  const Tool tool = make_tool(scene.get());
  const Evaluate evaluate = [&](fs_vec3 x) {
    fs_state state{};
    state.pose = at(x);
    fs_response response;
    fs_evaluate(tool.get(), &state, &response);
    return response;
  };
  Plant plant(device, hand, device.rate);
  plant.put(target_at(0, hand));
  Judge judge;
  const int ticks = static_cast<int>(task_length * device.rate);
  for (int i = 1; i <= ticks; ++i) {
    const double t = i / device.rate;
    plant.target = target_at(t, hand);
    plant.advance(t);
    plant.command(controller(t, plant.measured(), evaluate));
    judge.tick(t, plant);
  }
  return judge.end(plant);
}

Result run_servo(const DeviceModel& device, const HandModel& hand, double scale, const fs_servo_options& options) {
  Rig rig(device, hand);
  add_task(rig.scene.get(), scale, INFINITY);
  rig.plant.put(target_at(0, hand));
  rig.start(options);
  Judge judge;
  rig.run(task_length, [&](double t) {
    if (t > 0) judge.tick(t, rig.plant);
    rig.plant.target = target_at(t + rig.period(), hand);
  });
  return judge.end(rig.plant);
}

// The application samples the position 25 times a second. The time between a sample and the force is the device's delay.
enum class Between { held, interpolated, extrapolated };
Controller application(Between between) {
  struct State {
    int tick = -1;
    fs_vec3 last{}, newest{};
  };
  return [between, state = State{}](double, fs_vec3 x, const Evaluate& evaluate) mutable {
    constexpr int every = 40;  // ticks of 1 ms
    if (++state.tick % every == 0) {
      state.last = state.newest;
      state.newest = evaluate(x).wrench.force;
    }
    const double part = static_cast<double>(state.tick % every) / every;
    const fs_vec3 change = state.newest - state.last;
    switch (between) {
      case Between::held: return state.newest;
      case Between::interpolated: return state.last + part * change;
      default: return state.newest + part * change;
    }
  };
}

// The force of every tick travels over the link: only the delay counts, and it is the device's.
Controller force_over_link() {
  return [](double, fs_vec3 x, const Evaluate& evaluate) { return evaluate(x).wrench.force; };
}

// The same with a passivity controller at the device (Hannaford & Ryu 2002): it damps whenever it has given out more energy
// than it got.
Controller passivity_controller(double delay) {
  struct State {
    std::vector<fs_vec3> on_link;
    fs_vec3 last_x{}, last_force{};
    double energy = 0;
    bool has_begun = false;
  };
  return [delay, state = State{}](double, fs_vec3 x, const Evaluate& evaluate) mutable {
    constexpr double period = 1e-3;
    state.on_link.push_back(evaluate(x).wrench.force);
    const size_t late = static_cast<size_t>(delay / period + 0.5);
    fs_vec3 force{};
    if (state.on_link.size() > late) force = state.on_link[state.on_link.size() - 1 - late];
    if (!state.has_begun) state.last_x = x, state.has_begun = true;
    const fs_vec3 v = (1 / period) * (x - state.last_x);
    state.energy += dot(state.last_force, x - state.last_x);  // given to the hand
    if (state.energy > 0 && dot(v, v) > 1e-8) {
      const double alpha = state.energy / (dot(v, v) * period);
      force = force - std::min(alpha, 50.0) * v;
    }
    state.last_x = x;
    state.last_force = force;
    return force;
  };
}

// A local model (x0, F0, J) over a link: J is symmetric and its norm at most 2500 N/m; the device's controller renders
// F0 + J (x - x0) at its own rate.
Controller local_model(double delay, double rate) {
  struct Model {
    double arrives;
    fs_vec3 x, force;
    fs_mat3 slope;
  };
  struct State {
    std::vector<Model> sent;
    size_t used = 0;
    double next = 0;
  };
  return [delay, rate, state = State{}](double t, fs_vec3 x, const Evaluate& evaluate) mutable {
    if (t >= state.next - 1e-9) {
      state.next += 1 / rate;
      const fs_response r = evaluate(x);
      fs_mat3 j = r.stiffness;
      j.xy = j.yx = (j.xy + j.yx) / 2, j.xz = j.zx = (j.xz + j.zx) / 2, j.yz = j.zy = (j.yz + j.zy) / 2;
      const double size = std::sqrt(j.xx * j.xx + j.yy * j.yy + j.zz * j.zz + 2 * (j.xy * j.xy + j.xz * j.xz + j.yz * j.yz));
      const double part = std::min(1.0, 2500 / std::max(size, 1e-9));
      for (double* value = &j.xx; value <= &j.zz; ++value) *value *= part;
      state.sent.push_back({t + delay, x, r.wrench.force, j});
    }
    while (state.used + 1 < state.sent.size() && state.sent[state.used + 1].arrives <= t + 1e-9) ++state.used;
    const Model& model = state.sent[state.used];
    if (model.arrives > t + 1e-9) return fs_vec3{};
    return model.force + model.slope * (x - model.x);
  };
}

struct Way {
  const char* id;
  const char* name;
  enum { oscillates, keeps, takes_energy } must;
  std::function<Result(const HandModel& hand, double scale)> run;
  double error, energy, oscillation, most;  // what facts section 3 has: N, J, mm, N/m; negative: nothing
};

DeviceModel with(double delay, double rate = 1000) {
  DeviceModel device;
  device.delay = delay;
  device.rate = rate;
  return device;
}

std::vector<Way> all_ways() {
  const auto direct = [](double delay, auto make, double cap = INFINITY) {
    return [=](const HandModel& hand, double scale) { return run_controller(with(delay), hand, scale, cap, make()); };
  };
  const auto servo = [](double rate) {
    return [=](const HandModel& hand, double scale) { return run_servo(with(0, rate), hand, scale, raw_options()); };
  };
  const auto app = [](Between between) { return [=] { return application(between); }; };
  const auto model = [](double delay, double rate) { return [=] { return local_model(delay, rate); }; };
  const auto passive = [](double delay) { return [=] { return passivity_controller(delay); }; };
  const auto capped = [&](double delay) {
    return direct(delay, force_over_link, (1 + 5) / 2.0 / (0.5e-3 + delay));
  };
  return {
      {"application_held", "application at 25 Hz, held", Way::oscillates, direct(2e-3, app(Between::held)), 7.2, 18, 98, 328},
      {"application_interpolated", "application at 25 Hz, interpolated", Way::oscillates, direct(2e-3, app(Between::interpolated)), 9.5,
       43, 166, 134},
      {"application_extrapolated", "application at 25 Hz, extrapolated", Way::oscillates, direct(2e-3, app(Between::extrapolated)), 8.3,
       14.5, 59, 382},
      {"servo_1000", "servo of the library, 1 kHz", Way::keeps, servo(1000), .019, 0, 0, 11415},
      {"servo_500", "servo of the library, 500 Hz", Way::keeps, servo(500), .047, 0, 0, 5670},
      {"force_2ms", "force over a link, 2 ms", Way::keeps, direct(2e-3, force_over_link), .09, .01, 0, 2425},
      {"force_5ms", "force over a link, 5 ms", Way::keeps, direct(5e-3, force_over_link), .29, .07, 0, -1},
      {"force_10ms", "force over a link, 10 ms", Way::oscillates, direct(10e-3, force_over_link), 3.2, 6.1, 46, 695},
      {"force_20ms", "force over a link, 20 ms", Way::oscillates, direct(20e-3, force_over_link), 6.8, 19, 89, 328},
      {"model_10ms", "local model over a link, 10 ms, 100 Hz", Way::keeps, direct(0, model(10e-3, 100)), .18, -.01, 0, 3113},
      {"model_10ms_25Hz", "local model over a link, 10 ms, 25 Hz", Way::keeps, direct(0, model(10e-3, 25)), .48, .06, 0, 1090},
      {"model_20ms", "local model over a link, 20 ms, 100 Hz", Way::keeps, direct(0, model(20e-3, 100)), .31, .03, 0, 1709},
      {"passivity_5ms", "force over a link with passivity controller, 5 ms", Way::takes_energy, direct(0, passive(5e-3)), .70, -.13, 0, 2194},
      {"passivity_10ms", "force over a link with passivity controller, 10 ms", Way::takes_energy, direct(0, passive(10e-3)), .70, -.13, 0, -1},
      // Facts section 3 has this one stable, at 0.70 N rms. Here it is not.
      {"passivity_20ms", "force over a link with passivity controller, 20 ms", Way::oscillates, direct(0, passive(20e-3)), .70, -.13, 0, -1},
      {"capped_5ms", "force over a link, slopes capped, 5 ms", Way::keeps, capped(5e-3), 3.1, 0, 0, -1},
      {"capped_10ms", "force over a link, slopes capped, 10 ms", Way::keeps, capped(10e-3), 7.4, 0, 0, -1},
      {"capped_20ms", "force over a link, slopes capped, 20 ms", Way::keeps, capped(20e-3), 12.3, 0, 0, -1},
  };
}

constexpr double still = 0.3e-3;  // m, peak to peak, across its way

// The stiffest wall (N/m) that stays stable when all slopes are scaled together.
double stiffest_wall(const Way& way) {
  double low = 0.05, high = 30;
  for (int i = 0; i < 9; ++i) {
    const double middle = std::sqrt(low * high);
    (way.run(nominal, middle).oscillation > still ? high : low) = middle;
  }
  return wall_stiffness * low;
}

}  // namespace

void run_ways(Report& report, const std::string& folder) {
  report.title("The same task in several ways, with the nominal hand; in parentheses what facts section 3 has");
  const std::vector<Way> ways = all_ways();
  std::vector<Result> results(ways.size());
  std::vector<double> most(ways.size());
  in_parallel(ways.size(), [&](size_t i) {
    results[i] = ways[i].run(nominal, 1);
    most[i] = ways[i].most > 0 ? stiffest_wall(ways[i]) : -1;
  });
  Csv table(folder, "ways", "way,rms error N,energy J,oscillation mm,stiffest wall N/m");
  report.note("rms error N     energy J          oscillation mm    stiffest wall N/m");
  for (size_t i = 0; i < ways.size(); ++i) {
    const Way& way = ways[i];
    const Result& r = results[i];
    report.note(format("%6.3f (%5.3g)  %+8.3f (%5.3g)  %7.2f (%3.0f)  %s  %s", r.error, way.error, r.energy, way.energy,
                       1e3 * r.oscillation, way.oscillation,
                       way.most > 0 ? format("%8.0f (%5.0f)", most[i], way.most).c_str() : "                ", way.name));
    table.row(std::string("\"") + way.name + "\"", {r.error, r.energy, 1e3 * r.oscillation, most[i]});
    Csv trace(folder, std::string("way_") + way.id, "time s,position mm,force N");
    if (trace) {
      for (const Result::Moment& m : r.trace) trace.row({m.time, 1e3 * m.position.z, m.force.z});
    }
    const std::string id = std::string("ways/") + way.id;
    const double swing = 1e3 * r.oscillation;
    if (way.must == Way::oscillates) report.check(id, r.oscillation > still, format("oscillates: %.2f mm", swing));
    if (way.must == Way::keeps) report.check(id, r.oscillation < still, format("keeps to its way: %.2f mm", swing));
    if (way.must == Way::takes_energy) {
      report.check(id, r.energy < 0.01, format("makes no energy, but errs: %.3f J, %.2f N rms", r.energy, r.error));
    }
  }
  const auto result = [&](const std::string& id) -> const Result& {
    for (size_t i = 0; i < ways.size(); ++i) {
      if (id == ways[i].id) return results[i];
    }
    std::abort();
  };
  report.check("ways/model_error", result("model_10ms").error < 0.3,
               format("the local model at 10 ms and 100 Hz errs by less than 0.3 N rms: %.3f", result("model_10ms").error));
  report.check("ways/interpolated_is_worse", result("application_interpolated").error > result("application_held").error,
               "interpolated forces are worse than held ones");

  const auto stiffest = [&](const std::string& id) {
    for (size_t i = 0; i < ways.size(); ++i) {
      if (id == ways[i].id) return most[i];
    }
    std::abort();
  };
  report.check("ways/stiffest_wall", stiffest("servo_500") > 10 * stiffest("application_held") &&
                                         stiffest("servo_1000") > 20 * stiffest("application_held"),
               format("the servo renders walls more than 10 times as stiff at 500 Hz, 20 times at 1 kHz, as the application: "
                      "%.0f, %.0f", stiffest("servo_500") / stiffest("application_held"),
                      stiffest("servo_1000") / stiffest("application_held")));

  // With the bound of the slopes on both sides.
  const double cap = budget(with(0)).stiffness;
  const Result bounded = run_controller(with(2e-3), nominal, 1, cap, application(Between::held));
  report.check("ways/bounded/application_held", bounded.oscillation > still,
               format("with all slopes below the servo's bound of %.0f N/m, 25 Hz still oscillates: %.2f mm", cap,
                      1e3 * bounded.oscillation));
  for (const HandModel& hand : hands) {
    const Result r = run_servo(with(0), hand, 1, default_options());
    report.check(std::string("ways/bounded/servo/") + hand.name, r.oscillation < still,
                 format("the servo with its default options and the %s hand does not: %.3f mm", hand.name, 1e3 * r.oscillation));
  }

  // In the servo, for each hand.
  for (const HandModel& hand : hands) {
    const Result r = run_servo(with(0), hand, 1, raw_options());
    report.check(std::string("ways/in_process/") + hand.name,
                 r.oscillation < 0.2e-3 && r.error < 0.06 && r.energy < 0.03,
                 format("in the servo with the %s hand: < .2 mm, < .06 N rms, < .03 J: %.3f mm, %.3f N, %+.4f J", hand.name,
                        1e3 * r.oscillation, r.error, r.energy));
  }
}

}  // namespace stability
