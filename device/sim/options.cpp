#include "device/sim/options.h"

#include <cmath>
#include <iterator>
#include <string>

#include "base/error.h"
#include "driver/uri.h"

namespace fs {
namespace {

const std::string* find_option(const Uri& uri, const char* key) {
  for (const auto& [name, value] : uri.options) {
    if (name == key) return &value;
  }
  return nullptr;
}

void read_option(const Uri& uri, const char* key, double low, double high, double& out) {
  if (const std::string* value = find_option(uri, key)) out = parse_number(key, *value, low, high);
}

bool is_second(const Uri& uri, const char* key, const char* first, const char* second) {
  const std::string* value = find_option(uri, key);
  return value && parse_choice(key, *value, {first, second}) == 1;
}

void parse_link(const Uri& uri, SimOptions& options) {
  const std::string* link = find_option(uri, "link");
  for (const char* key : {"link_ms", "link_hz"}) {
    if (!link && find_option(uri, key)) fail(FS_ERROR_INVALID, "option '%s' needs the option 'link'", key);
  }
  if (!link) return;
  options.link = parse_choice("link", *link, {"force", "model"}) == 0 ? SimLink::FORCE : SimLink::MODEL;
  double link_ms = 10, link_hz = 100;
  read_option(uri, "link_ms", 0, 1000, link_ms);
  read_option(uri, "link_hz", 10, 10000, link_hz);
  options.link_delay_steps = static_cast<int>(std::lround(link_ms * 1e-3 / fidel::substep));
  options.link_period_steps = static_cast<int>(std::lround(1 / (link_hz * fidel::substep)));
}

HandPath parse_path(const Uri& uri) {
  const std::string* hold = find_option(uri, "hold");
  const std::string* path = find_option(uri, "path");
  if (hold && path) fail(FS_ERROR_INVALID, "hold and path cannot be given together");
  if (path) return HandPath::named(*path);
  return HandPath::hold(hold ? parse_vector("hold", *hold, -1, 1) : Vec3{});
}

}  // namespace

SimOptions parse_sim_options(const char* address) {
  const Uri uri = parse_address(address);
  if (!uri.address.empty()) fail(FS_ERROR_INVALID, "sim: takes no address, is '%s'", uri.address.c_str());
  check_keys(uri, {"hand", "hand_mass", "hand_damping", "hand_stiffness", "hold", "path", "mass", "friction", "encoder", "wrist",
                   "delay_ms", "link", "link_ms", "link_hz", "seed"});
  SimOptions options;
  double delay_ms = 0, seed = 0;
  if (const std::string* hand = find_option(uri, "hand")) {
    const fidel::Hand hands[] = {fidel::nominal_hand, fidel::firm_hand, fidel::light_hand, fidel::released_hand,
                                 fidel::light_hand};
    const size_t worst = std::size(hands) - 1;
    const size_t chosen = parse_choice("hand", *hand, {"nominal", "firm", "light", "released", "worst"});
    options.hand = hands[chosen];
    if (chosen == worst) {
      options.friction = 0;
      delay_ms = fidel::worst_delay_ms;
    }
  }
  read_option(uri, "hand_mass", 0, 10, options.hand.mass);                // kg
  read_option(uri, "hand_damping", 0, 1000, options.hand.damping);        // N s/m
  read_option(uri, "hand_stiffness", 0, 100000, options.hand.stiffness);  // N/m
  read_option(uri, "mass", 0.01, 10, options.mass);                       // kg
  read_option(uri, "friction", 0, 20, options.friction);                  // N
  read_option(uri, "delay_ms", 0, 1000, delay_ms);
  options.delay_steps = static_cast<int>(std::lround(delay_ms * 1e-3 / fidel::substep));
  parse_link(uri, options);
  read_option(uri, "seed", 0, UINT32_MAX, seed);
  if (seed != std::floor(seed)) fail(FS_ERROR_INVALID, "seed is %.9g, must be a whole number", seed);
  options.seed = static_cast<uint32_t>(seed);
  options.ideal_encoder = is_second(uri, "encoder", "joint", "ideal");
  options.active_wrist = is_second(uri, "wrist", "passive", "active");
  options.path = parse_path(uri);
  return options;
}

}  // namespace fs
