#include "shape/mesh/wide_node.h"

#include <algorithm>
#include <bit>

namespace fs {
namespace {

constexpr double unlimited = std::numeric_limits<double>::infinity();

// Moves a direction to the grid of WideDiscs.
struct GridNormal {
  int x, y;
  explicit GridNormal(Vec3 direction) {
    const double sum = std::fabs(direction.x) + std::fabs(direction.y) + std::fabs(direction.z);
    const double scale = sum > 0 ? std::copysign(WideDiscs::unit / sum, direction.z) : 0;
    x = static_cast<int>(std::lround(scale * direction.x));
    y = static_cast<int>(std::lround(scale * direction.y));
  }
  Vec3 vector() const {
    return (1.0 / WideDiscs::scale) * Vec3{double(x), double(y), double(WideDiscs::unit - std::abs(x) - std::abs(y))};
  }
};

float height_of(uint32_t bits) { return std::bit_cast<float>((bits << WideDiscs::height_shift) + WideDiscs::smallest_height); }

}  // namespace

void WideNode::set_boxes(std::span<const FloatBox> boxes) {
  double size = 1e-12;  // at least, so that the square of a distance in steps is a float
  for (int axis = 0; axis < 3; ++axis) {
    double least = unlimited, most = -unlimited;
    for (const FloatBox& box : boxes) {
      least = std::min(least, double{box.lower[axis]});
      most = std::max(most, double{box.upper[axis]});
    }
    origin[axis] = static_cast<float>(least);
    size = std::max(size, most - least);
  }
  step = rounded_above(size / grid * (1 + 1e-6));
  steps = 1 / step;
  const double wide_step = step;
  for (int axis = 0; axis < 3; ++axis) {
    const double from = origin[axis];
    for (size_t i = 0; i < boxes.size(); ++i) {
      const auto low = static_cast<uint32_t>(std::floor((boxes[i].lower[axis] - from) / wide_step * (1 - 1e-12)));
      const auto high = static_cast<uint32_t>(std::ceil((boxes[i].upper[axis] - from) / wide_step * (1 + 1e-12)));
      lower[i] |= low << 8 * axis;
      upper[i] |= high << 8 * axis;
    }
  }
  filled = (1u << boxes.size()) - 1;
}

Vec3 WideNode::middle(uint32_t i) const {
  const auto at = [&](int axis) {
    const auto steps_of = [&](uint32_t box) { return box >> 8 * axis & 255; };
    return origin[axis] + double{step} * (steps_of(lower[i]) + steps_of(upper[i])) / 2;
  };
  return {at(0), at(1), at(2)};
}

void WideDiscs::set(uint32_t i, const WideNode& node, Vec3 areas, std::span<const Vec3> corners) {
  const GridNormal grid_normal(normalized(areas));
  const Vec3 normal = grid_normal.vector(), middle = node.middle(i);
  double least = unlimited, most = -unlimited, most_beside = 0;
  for (const Vec3& corner : corners) {
    const Vec3 from = corner - middle;
    const double along = dot(normal, from);
    least = std::min(least, along);
    most = std::max(most, along);
    most_beside = std::max(most_beside, dot(from, from) - along * along / dot(normal, normal));
  }
  // Rounding is some 1e-16 of a coordinate. The largest sizes that can be stored are more than any child has.
  constexpr double rounding = 1e-12;
  const double radius = std::ceil((std::sqrt(most_beside) + rounding) / node.step * (1 + 1e-6));
  const double offset = std::clamp(std::round((least + most) / 2 / node.step * offsets_a_step), -32768.0, 32767.0);
  const double plane = offset / offsets_a_step * node.step;
  const double height = (std::max(most - plane, plane - least) + rounding) / node.step * (1 + 1e-6);
  uint32_t height_bits = 0;
  while (height_bits < 255 && height_of(height_bits) < height) ++height_bits;
  x_y[i] = static_cast<uint32_t>(grid_normal.x + unit) | static_cast<uint32_t>(grid_normal.y + unit) << 16;
  sizes[i] = static_cast<uint32_t>(static_cast<int>(offset) + zero_offset) |
             static_cast<uint32_t>(std::min(radius, 255.0)) << 16 | height_bits << 24;
}

}  // namespace fs
