#include "device/sim/options.h"

#include <cmath>
#include <iterator>

#include "device/support/address.h"
#include "device/support/refusal.h"

namespace fs {
namespace {

int steps_of(double ms) { return static_cast<int>(std::lround(ms * 1e-3 / fidel::substep)); }

void read_link(const Address& address, SimOptions& options) {
  const auto link = address.choice("link", {"force", "model"});
  for (const char* key : {"link_ms", "link_hz"}) {
    if (!link && address.has(key)) refuse(FS_ERROR_INVALID, "option '%s' needs the option 'link'", key);
  }
  if (!link) return;
  options.link = *link == 0 ? SimLink::FORCE : SimLink::MODEL;
  options.link_delay_steps = steps_of(address.number("link_ms", 0, 1000).value_or(10));
  options.link_period_steps = steps_of(1000 / address.number("link_hz", 10, 10000).value_or(100));
}

HandPath read_path(const Address& address) {
  const auto path = address.text("path");
  const auto hold = address.vector("hold", -1, 1);  // m
  if (hold && path) refuse(FS_ERROR_INVALID, "hold and path cannot be given together");
  if (path) return HandPath::named(*path);
  return HandPath::hold(hold ? Vec3{(*hold)[0], (*hold)[1], (*hold)[2]} : Vec3{});
}

}  // namespace

SimOptions parse_sim_options(const char* text) {
  const Address address(text, {"hand", "hand_mass", "hand_damping", "hand_stiffness", "hold", "path", "mass", "friction",
                               "encoder", "wrist", "delay_ms", "link", "link_ms", "link_hz", "seed"});
  if (!address.place().empty()) {
    refuse(FS_ERROR_INVALID, "sim: takes no address, is '%s'; options begin with '?'", shortened(address.place()).c_str());
  }
  SimOptions options;
  double delay_ms = 0;
  if (const auto chosen = address.choice("hand", {"nominal", "firm", "light", "released", "worst"})) {
    const fidel::Hand hands[] = {fidel::nominal_hand, fidel::firm_hand, fidel::light_hand, fidel::released_hand,
                                 fidel::light_hand};
    const size_t worst = std::size(hands) - 1;
    options.hand = hands[*chosen];
    if (*chosen == worst) {
      options.friction = 0;
      delay_ms = fidel::worst_delay_ms;
    }
  }
  const auto read = [&](const char* key, double low, double high, double& out) {
    out = address.number(key, low, high).value_or(out);
  };
  read("hand_mass", 0, 10, options.hand.mass);                // kg
  read("hand_damping", 0, 1000, options.hand.damping);        // N s/m
  read("hand_stiffness", 0, 100000, options.hand.stiffness);  // N/m
  read("mass", 0.01, 10, options.mass);                       // kg
  read("friction", 0, 20, options.friction);                  // N
  read("delay_ms", 0, 1000, delay_ms);
  options.delay_steps = steps_of(delay_ms);
  read_link(address, options);
  options.seed = static_cast<uint32_t>(address.whole("seed", 0, UINT32_MAX).value_or(0));
  options.ideal_encoder = address.choice("encoder", {"joint", "ideal"}) == 1;
  options.active_wrist = address.choice("wrist", {"passive", "active"}) == 1;
  options.path = read_path(address);
  return options;
}

}  // namespace fs
