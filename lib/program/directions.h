// Directions along the axes of a device, as hello-device asks for them, and what is wrong where others come out.
// Device frame: x to the person's right, y away from the person, z up.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "program.h"

struct Direction {
  int axis;  // 0..2
  int sign;  // 1 or -1
  bool operator==(const Direction&) const = default;
};

std::string name_of(const Direction& direction);    // "+x"
std::string words_for(const Direction& direction);  // "to the right"
fs_vec3 vector_of(const Direction& direction, double length);
std::optional<Direction> direction_of(const fs_vec3& v);  // none: it is along no single axis
std::optional<Direction> direction_of(char letter);       // r right, l left, a away, t towards you, u up, d down

// A trial: the direction that was asked of the hand or of the motors, and the one that came out; none: nothing came out.
struct Trial {
  Direction asked;
  std::optional<Direction> got;
};

// What is wrong, such as "x and y are exchanged, the sign of z is wrong"; "": nothing.
std::string difference(const std::vector<Trial>& trials);

// The forces of objects push as they should: nothing is wrong, or poses and forces are wrong alike.
bool may_be_rendered(const std::vector<Trial>& moves, const std::vector<Trial>& pushes);

// The likely cause of what is wrong; "": nothing is. moves: of the hand, and which way the pose went. pushes: of the motors, and
// which way the person felt them. scales: how far the pose went, as a part of how far the hand went; only those that are wrong.
std::string likely_cause(const std::vector<Trial>& moves, const std::vector<Trial>& pushes, const std::vector<double>& scales);
