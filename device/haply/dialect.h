// The messages of the Haply Inverse Service, JSON, to and from plain values. Sources: README.md.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <forceserver/base.h>

namespace fs::haply {

// What a force is called in a command: "values" in a service before 3.5, "vector" since then.
enum class Dialect { values, vector };
Dialect dialect_of_version(std::string_view version) noexcept;  // "3.4.1" and so on; vector where that says nothing

// An arm, as a message has it: nothing where the message does not tell.
struct Arm {
  std::string id, kind;                              // kind: such as "inverse3" or "minverse"
  std::optional<fs_vec3> position, velocity, force;  // m, m/s, N: application space
  std::optional<bool> is_calibrated, is_ready, has_power, is_in_use;
  std::optional<fs_vec3> transform_scale, mount_scale;
  std::optional<fs_quat> transform_rotation;
  std::optional<double> damping, force_scale, force_gate;  // of the filters
  std::string basis, preset;
};

struct Grip {
  std::string id;
  std::optional<fs_quat> orientation;
  uint32_t buttons = 0;  // bit 0: the button, or a; 1: b; 2: c
};

struct Message {
  std::vector<Arm> arms;
  std::vector<Grip> grips;  // of both kinds
};

// Reads a message of at most 64 levels of brackets. Returns what is wrong with it, in words; null: nothing.
const char* read_message(std::string_view text, Message& out);

std::string version_in(const std::string& text);  // the answer to GET /version; "": it does not tell

// The commands. Numbers are written as JSON wants them, whatever the locale.
void write_force(std::string& out, Dialect dialect, const std::string& id, fs_vec3 force);  // N
std::string set_up_message(Dialect dialect, const std::string& id);  // the preset, no force, and all is to be told again

}  // namespace fs::haply
