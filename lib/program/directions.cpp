#include "directions.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "words.h"

namespace {

constexpr const char* axis_names[] = {"x", "y", "z"};
constexpr std::string_view letters = "rlatud";

// Where each axis comes out; none: it was not tried, or came out nowhere.
struct Axes {
  std::optional<Direction> of[3];
  bool contradict = false;
};

Axes axes_of(const std::vector<Trial>& trials) {
  Axes axes;
  for (const Trial& trial : trials) {
    if (!trial.got) continue;
    const Direction found = {trial.got->axis, trial.asked.sign * trial.got->sign};
    std::optional<Direction>& known = axes.of[trial.asked.axis];
    axes.contradict |= known && *known != found;
    known = found;
  }
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < i; ++k) axes.contradict |= axes.of[i] && axes.of[k] && axes.of[i]->axis == axes.of[k]->axis;
  }
  return axes;
}

// Which axes come out as others: "x and y are exchanged", or each by itself.
void add_exchanges(const Axes& axes, std::vector<std::string>& found) {
  for (int i = 0; i < 3; ++i) {
    if (!axes.of[i] || axes.of[i]->axis == i) continue;
    const int other = axes.of[i]->axis;
    const bool is_pair = axes.of[other] && axes.of[other]->axis == i;
    if (is_pair && i < other) found.push_back(format("%s and %s are exchanged", axis_names[i], axis_names[other]));
    if (!is_pair) found.push_back(format("%s comes out as %s", axis_names[i], axis_names[other]));
  }
}

void add_signs(const Axes& axes, std::vector<std::string>& found) {
  std::vector<std::string> wrong;
  for (int i = 0; i < 3; ++i) {
    if (axes.of[i] && axes.of[i]->sign < 0) wrong.push_back(axis_names[i]);
  }
  if (wrong.empty()) return;
  found.push_back((wrong.size() > 1 ? "the signs of " : "the sign of ") + join(wrong, "") + (wrong.size() > 1 ? " are" : " is") +
                  " wrong");
}

void add_nothing(const std::vector<Trial>& trials, std::vector<std::string>& found) {
  std::vector<std::string> names;
  for (const Trial& trial : trials) {
    if (!trial.got) names.push_back(name_of(trial.asked));
  }
  std::sort(names.begin(), names.end());
  if (!names.empty()) found.push_back("nothing comes out along " + join(names, ""));
}

// A push is felt the way in which the pose takes a motion of the hand: then the whole frame is wrong, and not one of the two.
bool are_wrong_alike(const std::vector<Trial>& moves, const std::vector<Trial>& pushes) {
  const Axes poses = axes_of(moves);
  return !pushes.empty() && std::all_of(pushes.begin(), pushes.end(), [&](const Trial& push) {
    if (!push.got) return false;
    const std::optional<Direction>& pose = poses.of[push.got->axis];
    return pose && Direction{pose->axis, pose->sign * push.got->sign} == push.asked;
  });
}

std::string unit_cause(double scale) {
  const char* cause = "";
  if (scale > 7 && scale < 14) cause = ": are millimetres taken for centimetres?";
  if (scale > 700 && scale < 1400) cause = ": are millimetres taken for metres?";
  if (scale > 0.07 && scale < 0.14) cause = ": are centimetres taken for millimetres?";
  return format("The poses are %.3g times as far apart as the places of the hand", scale) + cause +
         (*cause ? "" : ". Look for a wrong length, gear ratio or number of encoder steps in the driver.");
}

}  // namespace

std::string name_of(const Direction& direction) {
  return std::string(direction.sign > 0 ? "+" : "-") + axis_names[direction.axis];
}

std::string words_for(const Direction& direction) {
  constexpr const char* words[3][2] = {{"to the left", "to the right"}, {"towards you", "away from you"}, {"down", "up"}};
  return words[direction.axis][direction.sign > 0];
}

fs_vec3 vector_of(const Direction& direction, double length) {
  fs_vec3 v{};
  (direction.axis == 0 ? v.x : direction.axis == 1 ? v.y : v.z) = direction.sign * length;
  return v;
}

std::optional<Direction> direction_of(const fs_vec3& v) {
  const double parts[] = {v.x, v.y, v.z};
  for (int axis = 0; axis < 3; ++axis) {
    if (std::fabs(parts[axis]) > 0.8 * length(v)) return Direction{axis, parts[axis] > 0 ? 1 : -1};
  }
  return std::nullopt;
}

std::optional<Direction> direction_of(char letter) {
  const std::size_t at = letters.find(letter);
  if (at == letters.npos) return std::nullopt;
  return Direction{static_cast<int>(at / 2), at % 2 ? -1 : 1};
}

std::string difference(const std::vector<Trial>& trials) {
  const Axes axes = axes_of(trials);
  std::vector<std::string> found;
  if (axes.contradict) {
    found.push_back("the answers contradict one another (do it again, and hold the handle loosely)");
  } else {
    add_exchanges(axes, found);
    add_signs(axes, found);
  }
  add_nothing(trials, found);
  return join(found, "");
}

bool may_be_rendered(const std::vector<Trial>& moves, const std::vector<Trial>& pushes) {
  return (difference(moves).empty() && difference(pushes).empty()) || are_wrong_alike(moves, pushes);
}

std::string likely_cause(const std::vector<Trial>& moves, const std::vector<Trial>& pushes, const std::vector<double>& scales) {
  const std::string poses = difference(moves), forces = difference(pushes);
  std::vector<std::string> causes;
  if (!poses.empty() && !forces.empty() && may_be_rendered(moves, pushes)) {
    causes
        .push_back("Poses and forces are turned or mirrored alike (poses: " + poses +
                   "): the frame of the driver is not x to the right, y away from you, z up, or the device stands turned round.");
  } else {
    if (!poses.empty()) {
      causes.push_back("The poses are wrong: " + poses +
                       ". Look at the order and the signs of the encoders, and at the kinematics.");
    }
    if (!forces.empty()) {
      causes.push_back("The forces are wrong: " + forces +
                       ". Look at the order and the signs of the motors, and at their power.");
    }
    if (!poses.empty() || !forces.empty()) {
      causes.push_back("Until that is right a wall may drive the hand deeper instead of holding it.");
    }
  }
  if (!scales.empty()) causes.push_back(unit_cause(scales[scales.size() / 2]));
  std::string text;
  for (const std::string& cause : causes) text += (text.empty() ? "" : " ") + cause;
  return text;
}
