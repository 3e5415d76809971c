// The numbers of two pictures: the map of stability, and what the bound of the stiffness is worth on another device than the
// one that was assumed.
#include <cmath>

#include "boundary.h"
#include "csv.h"
#include "stability.h"
#include "wall.h"

namespace stability {

namespace {

DeviceModel with_delay(double delay) {
  DeviceModel device;
  device.delay = delay;
  return device;
}

void write_map(const std::string& folder) {
  {
    Csv csv(folder, "map_boundary", "delay ms,nominal hand,firm hand,light hand,released,released with local damping,bound");
    for (double delay = 0; delay < 0.0505; delay += delay < 0.002 ? 0.125e-3 : 0.5e-3) {
      const DeviceModel device = with_delay(delay);
      LinearLoop damped = linear_loop(device, released);
      const Budget bound = budget(device);
      damped.rendered_damping = bound.damping, damped.cutoff = 100;
      csv.row({1e3 * delay, critical_stiffness(linear_loop(device, nominal)), critical_stiffness(linear_loop(device, firm)),
               critical_stiffness(linear_loop(device, light)), critical_stiffness(linear_loop(device, released)),
               critical_stiffness(damped), bound.stiffness});
    }
  }
  constexpr size_t columns = 51, rows = 41;
  std::vector<double> swing(columns * rows);
  const auto delay_of = [](size_t column) { return 1e-3 * static_cast<double>(column); };
  const auto stiffness_of = [](size_t row) { return 50 * std::pow(400, static_cast<double>(row) / (rows - 1)); };
  in_parallel(swing.size(), [&](size_t i) {
    const Oscillation motion = pushed_wall(with_delay(delay_of(i % columns)), stiffness_of(i / columns));
    swing[i] = motion.lasts() ? motion.late() : 0;
  });
  Csv csv(folder, "map_simulated", "delay ms,stiffness N/m,oscillation mm");
  for (size_t i = 0; i < swing.size(); ++i) csv.row({1e3 * delay_of(i % columns), stiffness_of(i / columns), 1e3 * swing[i]});
}

// The stiffness at which the handle becomes unstable, divided by the bound that was worked out for the assumed device.
double margin(const Budget& bound, const DeviceModel& device, const HandModel& hand) {
  LinearLoop loop = linear_loop(device, hand);
  loop.rendered_damping = bound.damping, loop.cutoff = 100;
  return critical_stiffness(loop) / bound.stiffness;
}

void write_sensitivity(const std::string& folder) {
  Csv csv(folder, "sensitivity", "what,factor,0 ms,2 ms,10 ms");
  struct Row {
    const char* what;
    void (*change)(double factor, DeviceModel& device, HandModel& hand);
    const HandModel& hand;
  };
  const Row rows[] = {
      {"device mass", [](double f, DeviceModel& d, HandModel&) { d.mass *= f; }, released},
      {"device damping", [](double f, DeviceModel& d, HandModel&) { d.damping *= f; }, released},
      {"delay", [](double f, DeviceModel& d, HandModel&) { d.delay *= f; }, released},
      {"light hand: mass", [](double f, DeviceModel&, HandModel& h) { h.mass *= f; }, light},
      {"light hand: damping", [](double f, DeviceModel&, HandModel& h) { h.damping *= f; }, light},
      {"light hand: stiffness", [](double f, DeviceModel&, HandModel& h) { h.stiffness *= f; }, light},
      {"nominal hand: mass", [](double f, DeviceModel&, HandModel& h) { h.mass *= f; }, nominal},
      {"nominal hand: damping", [](double f, DeviceModel&, HandModel& h) { h.damping *= f; }, nominal},
  };
  for (const Row& row : rows) {
    for (const double factor : {0.5, 1.0, 2.0}) {
      std::vector<double> values{factor};
      for (const double delay : {0.0, 0.002, 0.01}) {
        const Budget bound = budget(with_delay(delay));
        DeviceModel device = with_delay(delay);
        HandModel hand = row.hand;
        row.change(factor, device, hand);
        values.push_back(margin(bound, device, hand));
      }
      csv.row(row.what, values);
    }
  }
  Csv friction(folder, "sensitivity_friction", "friction N,stiffness N/m,critical delay ms");
  for (const double stiffness : {300.0, 1000.0, 3000.0}) {
    for (const double f : {0.0, 0.15, 0.3, 0.6}) friction.row({f, stiffness, 1e3 * critical_delay(stiffness, f)});
  }
}

}  // namespace

void write_maps(const std::string& folder) {
  write_map(folder);
  write_sensitivity(folder);
}

}  // namespace stability
