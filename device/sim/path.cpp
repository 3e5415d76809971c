#include "device/sim/path.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include "base/error.h"
#include "base/text.h"
#include "base/whole_file.h"
#include "device/sim/parameters.h"
#include "device/support/refusal.h"

namespace fs {
namespace {

constexpr uint64_t largest_path = 64 << 20;  // bytes: half an hour at 1000 lines a second
constexpr double coordinate_max = 1;  // m: a target may lie beyond the stops, but not beyond an arm's length

// Reads at most 5 numbers of a line and returns how many; -1 when the line has anything else.
int parse_line(std::string_view text, double (&numbers)[5]) {
  text = text.substr(0, text.find('#'));
  int count = 0;
  for (;;) {
    const size_t begin = text.find_first_not_of(" \t\r\n");
    if (begin == std::string_view::npos || count == 5) return count;
    text.remove_prefix(begin);
    const std::string_view word = text.substr(0, text.find_first_of(" \t\r\n"));
    if (!read_number(word, numbers[count]) || !std::isfinite(numbers[count])) return -1;
    text.remove_prefix(word.size());
    ++count;
  }
}

}  // namespace

HandPath HandPath::hold(Vec3 position) {
  HandPath path;
  path.points_ = {{0, position}};
  return path;
}

HandPath HandPath::named(const std::string& name) {
  HandPath path;
  if (name == "figure8") path.kind_ = Kind::FIGURE8;
  else if (name == "sweep") path.kind_ = Kind::SWEEP;
  else if (name == "touch") path.kind_ = Kind::TOUCH;
  else return read_file(name);
  return path;
}

HandPath HandPath::read_file(const std::string& name) {
  std::string text;
  try {
    text = read_whole_file(name, largest_path);
  } catch (const Error& error) {
    throw Refusal{error.status, "path '" + name + "' is none of figure8, sweep, touch, and as a file: " + error.text};
  }
  HandPath path;
  int number = 0;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line(text.data() + begin, end - begin);
    begin = end + 1;
    ++number;
    double n[5];
    const int count = parse_line(line, n);
    if (count == 0) continue;
    if (count != 4) refuse(FS_ERROR_PARSE, "%s:%d: must be four numbers, t x y z", name.c_str(), number);
    if (!path.points_.empty() && !(n[0] > path.points_.back().time)) {
      refuse(FS_ERROR_PARSE, "%s:%d: t is %.9g, must be above the %.9g before it", name.c_str(), number, n[0],
             path.points_.back().time);
    }
    for (int i = 1; i < 4; ++i) {
      if (!(std::fabs(n[i]) <= coordinate_max)) {
        refuse(FS_ERROR_PARSE, "%s:%d: a coordinate is %.9g, must be within %.9g..%.9g m", name.c_str(), number, n[i],
               -coordinate_max, coordinate_max);
      }
    }
    path.points_.push_back({n[0], {n[1], n[2], n[3]}});
  }
  if (path.points_.empty()) refuse(FS_ERROR_PARSE, "%s: there is no line t x y z", name.c_str());
  return path;
}

HandPath::Target HandPath::at(double time) noexcept {
  using namespace fidel;
  switch (kind_) {
    case Kind::FIGURE8: {
      const double w = 2 * std::numbers::pi / figure8_period, a = w * time;
      return {{figure8_width * std::sin(a), figure8_height * std::sin(2 * a), 0},
              {w * figure8_width * std::cos(a), 2 * w * figure8_height * std::cos(2 * a), 0}};
    }
    case Kind::SWEEP: {
      const double w = 2 * std::numbers::pi / sweep_period, a = w * time;
      return {{-sweep_width * std::cos(a), 0, 0}, {w * sweep_width * std::sin(a), 0, 0}};
    }
    case Kind::TOUCH: {
      const double w = 2 * std::numbers::pi / touch_period, a = w * time;
      return {{0, 0, touch_middle + touch_stroke * std::cos(a)}, {0, 0, -w * touch_stroke * std::sin(a)}};
    }
    case Kind::POINTS: break;
  }
  while (next_ < points_.size() && points_[next_].time <= time) ++next_;
  if (next_ == 0) return {points_.front().position, {}};
  if (next_ == points_.size()) return {points_.back().position, {}};
  const Point &from = points_[next_ - 1], &to = points_[next_];
  const Vec3 velocity = (1 / (to.time - from.time)) * (to.position - from.position);
  return {from.position + (time - from.time) * velocity, velocity};
}

}  // namespace fs
