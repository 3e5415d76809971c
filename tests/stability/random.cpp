// Many scenes at random: raw many of them oscillate, with the default options none.
#include <algorithm>
#include <cmath>

#include "boundary.h"
#include "random_scenes.h"
#include "stability.h"

namespace stability {

namespace {

// How many of `outcomes` are bad, and which first: by number.
std::string first_bad(const std::vector<Outcome>& outcomes, uint64_t seed, size_t& bad) {
  bad = 0;
  std::string list;
  for (size_t i = 0; i < outcomes.size(); ++i) {
    const Outcome& o = outcomes[i];
    if (!o.is_bad()) continue;
    if (++bad <= 24) list += format(" %zu (%.1f mm%s)", static_cast<size_t>(seed) + i, 1e3 * o.swing, o.faults ? ", fault" : "");
  }
  return list;
}

}  // namespace

void run_random(Report& report, size_t count, uint64_t seed) {
  report.title(format("%zu scenes of 1 to 6 objects at random, each with three hands", count));
  for (const HandModel& hand : hands) {
    for (const bool is_raw : {true, false}) {
      const size_t runs = is_raw ? std::min<size_t>(count, 100) : count;  // that raw ones oscillate some show, too
      std::vector<Outcome> outcomes(runs);
      in_parallel(runs, [&](size_t i) {
        outcomes[i] = run(simple_situation(seed + i, hand), is_raw ? raw_options() : default_options());
      });
      size_t bad;
      const std::string list = first_bad(outcomes, seed, bad);
      const double share = 100.0 * static_cast<double>(bad) / static_cast<double>(runs);
      if (is_raw) {
        report.check(format("random/raw/%s", hand.name), share >= 20, format("at least 20 %% oscillate: %.1f %%", share));
      } else {
        report.check(format("random/default/%s%s", hand.name, count >= 500 ? "/many" : ""), bad == 0,
                     format("none oscillates: %zu (%.1f %%)%s%s", bad, share, bad ? "; numbers" : "", list.c_str()));
      }
    }
  }
}

void run_known(Report& report) {
  report.title("Numbers that once oscillated, and how they were cured");
  struct Known {
    const char* id;
    Outcome outcome;
    const char* what;
  };
  const auto simple = [](uint64_t seed, const HandModel& hand) { return run(simple_situation(seed, hand), default_options()); };
  const auto any = [](uint64_t seed) { return run(any_situation(seed), default_options()); };
  for (const Known& k : {
           Known{"51_light", simple(51, light), "a point repels the hand and it slides for 15 s: not an oscillation"},
           Known{"404_firm", simple(404, firm), "a force goes on through a mesh, and turns at once at its edge: it begins at the surface"},
           Known{"sweep_502", any(502), "the profile of a solid mesh reverses in its middle: blended there too"},
           Known{"sweep_155", any(155), "what repels drives a handle away that nobody holds: not an oscillation"},
           Known{"link_313", run_link(313), "a bound given back pushes the hand to what takes it: it is given back slowly"},
       }) {
    report.check(format("known/%s", k.id), !k.outcome.is_bad(), format("%s: %.2f mm", k.what, 1e3 * k.outcome.swing));
  }
}

void run_sweep(Report& report, size_t count, uint64_t seed) {
  report.title(format("%zu scenes and devices at random: .05 to 1 kg, 500 Hz to 20 kHz, delays to 20 ms, all that a scene can have",
                      count));
  std::vector<Outcome> outcomes(count);
  in_parallel(count, [&](size_t i) { outcomes[i] = run(any_situation(seed + i), default_options()); });
  for (size_t i = 0; count <= 8 && i < count; ++i) {
    const Situation s = any_situation(seed + i);
    report.note(format("%zu: %s: %.3f mm", static_cast<size_t>(s.seed), described(s).c_str(), 1e3 * outcomes[i].swing));
  }
  size_t bad;
  const std::string list = first_bad(outcomes, seed, bad);
  const auto flung = std::count_if(outcomes.begin(), outcomes.end(), [](const Outcome& o) { return o.is_flung; });
  report.check(count >= 500 ? "sweep/many" : "sweep", bad == 0,
               format("none oscillates: %zu of %zu%s%s (%td handles that nobody holds are driven away)", bad, count,
                      bad ? "; numbers" : "", list.c_str(), flung));
}

void run_links(Report& report, size_t count, uint64_t seed) {
  report.title(format("%zu scenes at random behind a link that takes local models: 2 to 50 ms, 25 to 500 models a second", count));
  std::vector<Outcome> outcomes(count);
  in_parallel(count, [&](size_t i) { outcomes[i] = run_link(seed + i); });
  for (size_t i = 0; i < count; ++i) {
    if (count <= 8 || outcomes[i].is_bad()) report.note(format("%zu: %s", static_cast<size_t>(seed) + i, link_of(seed + i).c_str()));
  }
  size_t bad;
  const std::string list = first_bad(outcomes, seed, bad);
  report.check(count >= 500 ? "links/many" : "links", bad == 0,
               format("none oscillates: %zu of %zu%s%s", bad, count, bad ? "; numbers" : "", list.c_str()));
}

void run_limits(Report& report) {
  report.title("What the library renders by default on a device: the bound of the stiffness, and the local damping");
  struct Row {
    double mass, damping, rate, delay;
  };
  for (const Row& row : {Row{0.3, 1, 1000, 0}, Row{0.3, 1, 500, 0}, Row{0.3, 1, 1000, 2e-3}, Row{0.3, 1, 1000, 5e-3},
                         Row{0.3, 1, 1000, 10e-3}, Row{0.05, 0.5, 1000, 0}, Row{0.05, 0.5, 4000, 5e-3}, Row{1, 3, 20000, 0},
                         Row{0, 1, 1000, 1e-3}}) {
    DeviceModel device;
    device.mass = row.mass, device.damping = row.damping, device.rate = row.rate, device.delay = row.delay;
    const Budget expected = budget(device);
    DeviceModel built = device;
    if (built.mass == 0) built.mass = 0.05;
    Rig rig(built, released);
    rig.tells_no_mass = row.mass == 0;
    rig.start(default_options());
    rig.run(0.01, [](double) {});
    const fs_servo_stats stats = rig.stats();
    report.check(format("limits/%g_kg_%g_Hz_%g_ms", row.mass, row.rate, 1e3 * row.delay),
                 std::fabs(stats.max_stiffness / expected.stiffness - 1) < 0.02 &&
                     std::fabs(stats.damping / expected.damping - 1) < 0.02,
                 format("%.0f N/m, %.2f N s/m: %.0f, %.2f", expected.stiffness, expected.damping, stats.max_stiffness,
                        stats.damping));
  }
}

}  // namespace stability
