// Where a sampled loop becomes unstable: the simulated plant against the exact boundary and against closed formulas.
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "boundary.h"
#include "measure.h"
#include "plant/rig.h"
#include "stability.h"
#include "wall.h"

namespace stability {

using namespace scenes;

namespace {

constexpr double pi = std::numbers::pi;

DeviceModel linear_device(double rate, double delay) {
  DeviceModel device;
  device.friction = device.encoder = 0;
  device.force_max = 1e6;
  device.rate = rate;
  device.delay = delay;
  return device;
}

// The logarithm by which an oscillation with this frequency (rad/s) grows, simulated: from periods 40..60 to 120..140.
// simulate(seconds, each) runs the loop and calls each(t, z).
template <class Simulate>
double growth(double angular, Simulate&& simulate) {
  const double length = 2 * pi / angular;
  double early = 0, late = 0;
  simulate(140 * length, [&](double t, double z) {
    if (t > 40 * length && t < 60 * length) early = std::max(early, std::fabs(z));
    if (t > 120 * length) late = std::max(late, std::fabs(z));
  });
  return std::log(late / early);
}

// Where the growth is 0, from the growth at 0.99 and 1.01 of the exact boundary; as a part of it.
template <class GrowthAt>
double simulated_boundary(GrowthAt&& growth_at) {
  const double below = growth_at(0.99), above = growth_at(1.01);
  return 0.99 + 0.02 * (0 - below) / (above - below);
}

// A direct loop, without the library: the spring k, and B from the difference of two positions.
double direct_growth(const DeviceModel& device, const HandModel& hand, double k, double damping, double angular) {
  return growth(angular, [&](double seconds, auto&& each) {
    Plant plant(device, hand, device.rate);
    plant.put({0, 0, 1e-3});
    double last = 1e-3;
    const uint64_t ticks = static_cast<uint64_t>(seconds * device.rate);
    for (uint64_t i = 1; i <= ticks; ++i) {
      const double t = static_cast<double>(i) / device.rate;
      plant.advance(t);
      const double z = plant.measured().z;
      plant.command({0, 0, -k * z - damping * (z - last) * device.rate});
      last = z;
      each(t, z);
    }
  });
}

// The same spring rendered by the library.
double rendered_growth(const DeviceModel& device, const HandModel& hand, double k, double angular) {
  return growth(angular, [&](double seconds, auto&& each) {
    Rig rig(device, hand);
    rig.plant.put({0, 0, 1e-3});
    fs_object spring = fs_object_init("spring", FS_PRIMITIVE_PLANE);
    spring.front = spring.back = fs_profile_init(FS_PROFILE_LINEAR_INCREASING, FS_SENSE_ATTRACTIVE, k, 0, 1e6);
    rig.set(spring);
    rig.start(raw_options());
    rig.run(seconds, [&](double t) { each(t, rig.plant.position().z); });
  });
}

struct Case {
  HandModel hand;
  double rate, delay;
  double exact = 0, simulated = 0;  // N/m; a part of exact
};

void check_boundaries(Report& report) {
  report.title("The stiffness at which the loop becomes unstable: simulated, as a part of the exact boundary");
  std::vector<Case> cases;
  for (const HandModel& hand : {nominal, firm, light, released}) {
    for (const double rate : {500.0, 1000.0, 4000.0}) {
      for (const double delay : {0.0, 0.002, 0.005, 0.01, 0.02, 0.05}) cases.push_back({hand, rate, delay});
    }
  }
  in_parallel(cases.size(), [&](size_t i) {
    Case& c = cases[i];
    const DeviceModel device = linear_device(c.rate, c.delay);
    double angular;
    c.exact = critical_stiffness(linear_loop(device, c.hand), &angular);
    c.simulated = simulated_boundary([&](double part) {
      return direct_growth(device, c.hand, part * c.exact, 0, angular);
    });
  });
  double worst = 0;
  for (size_t i = 0; i < cases.size(); i += 6) {
    std::string line = format("%-8s %4.0f Hz:", cases[i].hand.name, cases[i].rate);
    for (size_t j = i; j < i + 6; ++j) {
      line += format("  %6.0f (%.4f)", cases[j].exact, cases[j].simulated);
      worst = std::max(worst, std::fabs(cases[j].simulated - 1));
    }
    report.note(line);
  }
  report.check("boundary/simulated", worst < 0.01, format("72 cases within 1 %%; the worst is %.2f %% off", 100 * worst));

  // facts, section 2: N/m, at delays of 0, 2, 5, 10, 20, 50 ms.
  const double held[3][6] = {{7472, 2496, 1254, 690, 369, 166}, {14922, 2992, 1366, 722, 378, 167},
                             {59622, 3517, 1465, 748, 385, 168}};
  const double free[6] = {2001, 401, 182, 96, 49, 20};
  double off = 0;
  for (size_t rate = 0; rate < 3; ++rate) {
    for (size_t delay = 0; delay < 6; ++delay) {
      off = std::max(off, std::fabs(cases[6 * rate + delay].exact / held[rate][delay] - 1));
    }
  }
  for (size_t delay = 0; delay < 6; ++delay) {  // 20 stands for 19.5 to 20.5
    off = std::max(off, (std::fabs(cases[60 + delay].exact - free[delay]) - 0.5) / free[delay]);
  }
  report.check("boundary/table", off < 0.01, format("the table of 24 stiffnesses within 1 %%; the worst is %.2f %% off", 100 * off));

  std::vector<Case> rendered;
  for (const Case& c : cases) {
    const bool is_nominal = !std::string(c.hand.name).compare("nominal"), is_free = c.hand.mass == 0;
    if ((is_nominal || is_free) && c.rate == 1000 && c.delay <= 0.02) rendered.push_back(c);
  }
  in_parallel(rendered.size(), [&](size_t i) {
    Case& c = rendered[i];
    const DeviceModel device = linear_device(c.rate, c.delay);
    double angular;
    critical_stiffness(linear_loop(device, c.hand), &angular);
    c.simulated = simulated_boundary([&](double part) {
      return rendered_growth(device, c.hand, part * c.exact, angular);
    });
  });
  worst = 0;
  for (const Case& c : rendered) worst = std::max(worst, std::fabs(c.simulated - 1));
  report.check("boundary/rendered", worst < 0.01,
               format("the same through the library, %zu cases within 1 %%; the worst is %.2f %% off", rendered.size(),
                      100 * worst));
}

// alpha = K T^2 / m at the boundary of a mass without any damping but the rendered one, beta = B T / m; d periods of delay.
double alpha(double beta, double d) {
  return critical_stiffness({1, 0, 0, 1, d, beta});
}

void check_damping(Report& report) {
  report.title("A mass with rendered damping only: alpha = K T^2/m at the boundary, beta = B T/m");
  for (const double beta : {0.2, 0.5, 0.828, 1.2}) {
    const double formula = 2 * beta * (2 - beta) / (2 + beta), exact = alpha(beta, 0);
    DeviceModel device = linear_device(1000, 0);
    device.mass = 1, device.damping = 0;
    double angular;
    critical_stiffness({1, 0, 0, 1, 0, beta}, &angular);
    const double simulated = exact * simulated_boundary([&](double part) {
      return direct_growth(device, released, part * exact * 1e6, beta * 1e3, angular * 1e3);
    });
    report.check(format("damping/beta_%g", beta),
                 std::fabs(exact / formula - 1) < 0.01 && std::fabs(simulated / formula - 1) < 0.01,
                 format("alpha %.4f expected, %.4f exact, %.4f simulated", formula, exact, simulated));
  }
  const double largest[7][2] = {{0, .686}, {1, .1445}, {2, .0624}, {3, .0348}, {5, .0154}, {10, .0046}, {20, .0012}};
  std::string line;
  bool is_right = true;
  for (const auto& [d, expected] : largest) {
    double best = 0;
    for (double beta = 0.002; beta < 1.5; beta += d > 4 ? 0.002 : 0.01) best = std::max(best, alpha(beta, d));
    is_right = is_right && std::fabs(best - expected) < 0.01 * expected + 0.5e-4;
    line += format(" %.4f", best);
  }
  report.check("damping/largest", is_right,
               "the largest alpha for a delay of 0, 1, 2, 3, 5, 10, 20 periods is .686 .1445 .0624 .0348 .0154 .0046 .0012:" + line);

  DeviceModel device;
  LinearLoop loop = linear_loop(device, released);
  loop.rendered_damping = 5, loop.cutoff = 100;
  const double with = critical_stiffness(loop);
  report.check("damping/local", std::fabs(with / 10814 - 1) < 0.01,
               format("5 N s/m filtered at 100 Hz: a released handle is stable up to 10814 N/m: %.0f", with));
}

// A direct loop with friction: an oscillation that begins with this amplitude (m). early: its amplitude soon after; returns
// whether it grows.
bool grows_from(double amplitude, double& early) {
  DeviceModel device = linear_device(1000, 0.01);
  device.friction = 0.3;
  Plant plant(device, nominal, device.rate);
  plant.put({0, 0, amplitude});
  early = 0;
  double late = 0;
  for (int i = 1; i <= 3000; ++i) {
    plant.advance(i * 1e-3);
    const double z = plant.position().z;
    plant.command({0, 0, -1000 * z});
    if (i > 300 && i <= 700) early = std::max(early, std::fabs(z));
    if (i > 2600) late = std::max(late, std::fabs(z));
  }
  return late > early;
}

// Half of the last second's motion, peak to peak, of a hand on an attractive plane of 3 N on both sides, with the library.
double relay_amplitude(double delay, double friction, const fs_servo_options& options) {
  DeviceModel device;
  device.friction = friction;
  device.encoder = 0;
  device.delay = delay;
  Rig rig(device, nominal);
  rig.plant.put({0, 0, 5e-3});
  fs_object object = fs_object_init("relay", FS_PRIMITIVE_PLANE);
  object.front = object.back = fs_profile_init(FS_PROFILE_CONSTANT, FS_SENSE_ATTRACTIVE, 3, 0, 3);
  rig.set(object);
  rig.start(options);
  Oscillation motion;
  rig.run(motion.end(), [&](double t) { motion.add(t, rig.plant.position()); });
  return motion.late() / 2;
}

void check_friction(Report& report) {
  report.title("Friction, jumps and delay");
  double low = 1e-4, high = 0.05, threshold = 0;
  for (int i = 0; i < 25; ++i) {
    const double middle = std::sqrt(low * high);
    (grows_from(middle, threshold) ? high : low) = middle;
  }
  report.check("friction/threshold", std::fabs(threshold / 3.75e-3 - 1) < 0.1,
               format("1000 N/m, 10 ms, 0.3 N: an oscillation grows from 3.75 mm +-10 %% on: %.2f mm", 1e3 * threshold));

  for (const double delay : {0.0, 0.002, 0.01}) {
    const double expected = 4 * 3 * (delay + 0.5e-3) / (pi * (1 + nominal.damping));
    const double measured = relay_amplitude(delay, 0, raw_options());
    report.check(format("relay/%g_ms", 1e3 * delay), std::fabs(measured / expected - 1) < 0.3,
                 format("a force of 3 N that reverses oscillates by 4 F tau/(pi b) = %.2f mm +-30 %%: %.2f mm", 1e3 * expected,
                        1e3 * measured));
    const double capped = relay_amplitude(delay, 0, default_options());
    report.check(format("relay/%g_ms/default", 1e3 * delay), capped < 0.05e-3,
                 format("with the protections it stands still: %.3f mm", 1e3 * capped));
  }

  const double stiffness[] = {300, 500, 1000, 2000, 3000}, expected[] = {33, 20, 10.1, 5.2, 3.6};
  std::string line;
  double off = 0, at_1000 = 0;
  std::array<double, 5> measured;
  in_parallel(5, [&](size_t i) { measured[i] = 1e3 * critical_delay(stiffness[i], 0.3); });
  for (size_t i = 0; i < 5; ++i) {
    off = std::max(off, std::fabs(measured[i] / expected[i] - 1));
    line += format(" %.1f", measured[i]);
    if (i == 2) at_1000 = measured[i];
  }
  report.check("delay/1000", std::fabs(at_1000 - 10) < 1,
               format("a wall of 1000 N/m with friction becomes unstable at 10 +-1 ms: %.2f ms", at_1000));
  report.check("delay/table", off < 0.15, "walls of 300, 500, 1000, 2000, 3000 N/m at 33, 20, 10.1, 5.2, 3.6 ms +-15 %:" + line);
  const double without = 1e3 * critical_delay(1000, 0);
  report.check("delay/1000_without_friction", std::fabs(without - 6.9) < 0.3,
               format("the same without friction at 6.9 +-0.3 ms: %.2f ms", without));
}

}  // namespace

void run_facts(Report& report) {
  check_boundaries(report);
  check_damping(report);
  check_friction(report);
}

}  // namespace stability
