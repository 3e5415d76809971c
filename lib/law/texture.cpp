#include "law/texture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/enum.h"
#include "base/error.h"

namespace fs {
namespace {

constexpr uint32_t most_heights = 1 << 20;  // in a grid

void check_count(uint32_t count, const char* field) {
  if (count < 1 || count > most_heights) fail(FS_ERROR_INVALID, "%s is %u, must be within 1..%u", field, count, most_heights);
}

void check_width(double width, uint32_t count, const char* field) {
  if (width == 0 && count == 1) return;
  if (!(width >= 1e-6 && width <= 1e3)) fail(FS_ERROR_INVALID, "%s is %.9g, must be within 1e-6..1e3 m", field, width);
}

void check_begin(double begin, const char* field) {
  if (!(std::fabs(begin) <= 1e9)) fail(FS_ERROR_INVALID, "%s is %.9g, must be within -1e9..1e9 m", field, begin);
}

// The coefficients of a cubic spline that goes through values which repeat: two recursive filters.
std::vector<double> periodic_spline(const std::vector<double>& values) {
  const double pole = std::sqrt(3.0) - 2;
  const size_t size = values.size(), most = std::min<size_t>(size, 64);  // its 64th power is below rounding
  const double whole = 1 - std::pow(pole, static_cast<double>(size));
  std::vector<double> out(size);
  double sum = 0, power = 1;
  for (size_t k = 0; k < most; ++k, power *= pole) sum += power * values[(size - k) % size];
  out[0] = sum / whole;
  for (size_t k = 1; k < size; ++k) out[k] = values[k] + pole * out[k - 1];
  sum = 0, power = pole;
  for (size_t k = 0; k < most; ++k, power *= pole) sum -= power * out[(size - 1 + k) % size];
  double next = sum / whole;
  for (size_t k = size; k-- > 0;) {
    if (k + 1 < size) next = pole * (next - out[k]);
    out[k] = next;
  }
  for (double& value : out) value *= 6;
  return out;
}

struct Weights {
  double value[4], slope[4], curvature[4];  // of four coefficients

  Weights(double t, double width) noexcept {
    const double u = 1 - t, per = 1 / width;
    value[0] = u * u * u / 6, value[1] = 2.0 / 3 - t * t * (1 - t / 2), value[2] = 2.0 / 3 - u * u * (1 - u / 2),
    value[3] = t * t * t / 6;
    slope[0] = -u * u / 2 * per, slope[1] = t * (1.5 * t - 2) * per, slope[2] = -u * (1.5 * u - 2) * per,
    slope[3] = t * t / 2 * per;
    curvature[0] = u * per * per, curvature[1] = (3 * t - 2) * per * per, curvature[2] = (3 * u - 2) * per * per,
    curvature[3] = t * per * per;
  }
};

// The control points of the cubic that four coefficients give: the cubic lies between the least and the greatest of them.
std::array<double, 4> control_points(double a, double b, double c, double d) {
  return {(a + 4 * b + c) / 6, (2 * b + c) / 3, (b + 2 * c) / 3, (b + 4 * c + d) / 6};
}

double& component(Vec3& v, unsigned axis) noexcept { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }
Vec3 unit(unsigned axis) noexcept {
  Vec3 out{};
  component(out, axis) = 1;
  return out;
}

}  // namespace

// A grid that does not repeat goes on as its mirror image, so that its slope is 0 at the border, and beyond.
std::vector<double> Texture::Direction::coefficients(const std::vector<double>& heights) const {
  std::vector<double> period = heights;
  if (!repeats) {
    for (size_t i = count - 1; i-- > 1;) period.push_back(heights[i]);
  }
  const std::vector<double> spline = periodic_spline(period);
  std::vector<double> out(padded());
  for (size_t i = 0; i < out.size(); ++i) out[i] = spline[(i + spline.size() - 1) % spline.size()];
  return out;
}

size_t Texture::Direction::cell(double place, double& within, bool& is_beyond) const noexcept {
  const auto size = static_cast<double>(cells());
  double x = (place - begin) / width;
  x = repeats ? x - size * std::floor(x / size) : x;
  is_beyond = !(x >= 0 && x <= size);
  x = std::clamp(x, 0.0, size);
  const size_t out = std::min(static_cast<size_t>(x), cells() - 1);
  within = x - static_cast<double>(out);
  return out;
}

void Texture::check(const fs_surface_settings& of) {
  check_count(of.columns, "columns");
  check_count(of.rows, "rows");
  const uint64_t all = uint64_t{of.columns} * of.rows;
  if (all > most_heights)
    fail(FS_ERROR_INVALID, "columns * rows is %llu, must be at most %u", static_cast<unsigned long long>(all), most_heights);
  check_width(of.column_width, of.columns, "column_width");
  check_width(of.row_width, of.rows, "row_width");
  check_begin(of.first_column, "first_column");
  check_begin(of.first_row, "first_row");
  const int32_t axis = raw_value(of.axis);
  if (axis < FS_AXIS_Z || axis > FS_AXIS_Y) fail(FS_ERROR_INVALID, "axis is %d, must be an fs_axis (0..2)", axis);
}

Texture::Texture(const fs_surface_settings& of, std::span<const double> heights) {
  check(of);
  if (heights.size() != uint64_t{of.columns} * of.rows) {
    fail(FS_ERROR_INVALID, "count is %zu, must be columns * rows (%u * %u)", heights.size(), of.columns, of.rows);
  }
  for (size_t i = 0; i < heights.size(); ++i) {
    if (!(heights[i] <= 0 && heights[i] >= -deepest_height)) {
      fail(FS_ERROR_INVALID, "heights[%zu] is %.9g, must be within %g..0 m", i, heights[i], -deepest_height);
    }
  }
  const auto axis = static_cast<unsigned>(of.axis);
  const auto direction = [&](uint32_t count, double width, double begin, unsigned along) {
    return Direction{count, width > 0 ? width : 1, begin, of.repeats || count == 1, along % 3};
  };
  columns_ = direction(of.columns, of.column_width, of.first_column, axis);
  rows_ = direction(of.rows, of.row_width, of.first_row, axis + 1);
  heights_.assign(heights.begin(), heights.end());

  const size_t width = columns_.padded();
  coefficients_.resize(width * rows_.padded());
  std::vector<double> along_rows(width * rows_.count), line;
  for (size_t row = 0; row < rows_.count; ++row) {
    line.assign(heights_.begin() + row * columns_.count, heights_.begin() + (row + 1) * columns_.count);
    std::ranges::copy(columns_.coefficients(line), along_rows.begin() + row * width);
  }
  line.resize(rows_.count);
  for (size_t column = 0; column < width; ++column) {
    for (size_t row = 0; row < rows_.count; ++row) line[row] = along_rows[row * width + column];
    const std::vector<double> down = rows_.coefficients(line);
    for (size_t row = 0; row < down.size(); ++row) coefficients_[row * width + column] = down[row];
  }
  find_bounds();
}

// Of each cell from its 16 control points. Between the heights the spline may rise above 0: then all of it is lowered.
void Texture::find_bounds() {
  double lowest = 0, highest = -std::numeric_limits<double>::infinity(), square = 0;
  const double dx = columns_.width, dy = rows_.width;
  for (size_t row = 0; row < rows_.cells(); ++row) {
    for (size_t column = 0; column < columns_.cells(); ++column) {
      std::array<std::array<double, 4>, 4> lines, net;  // net[x][y]
      for (size_t i = 0; i < 4; ++i) {
        lines[i] = control_points(coefficient(column, row + i), coefficient(column + 1, row + i),
                                  coefficient(column + 2, row + i), coefficient(column + 3, row + i));
      }
      for (size_t i = 0; i < 4; ++i) net[i] = control_points(lines[0][i], lines[1][i], lines[2][i], lines[3][i]);
      double along_x = 0, along_y = 0, xx = 0, xy = 0, yy = 0;
      const auto grow = [](double& most, double value) { most = std::max(most, std::fabs(value)); };
      for (size_t x = 0; x < 4; ++x) {
        for (size_t y = 0; y < 4; ++y) {
          lowest = std::min(lowest, net[x][y]);
          highest = std::max(highest, net[x][y]);
          if (x < 3) grow(along_x, 3 * (net[x + 1][y] - net[x][y]) / dx);
          if (y < 3) grow(along_y, 3 * (net[x][y + 1] - net[x][y]) / dy);
          if (x < 2) grow(xx, 6 * (net[x + 2][y] - 2 * net[x + 1][y] + net[x][y]) / (dx * dx));
          if (y < 2) grow(yy, 6 * (net[x][y + 2] - 2 * net[x][y + 1] + net[x][y]) / (dy * dy));
          if (x < 3 && y < 3) grow(xy, 9 * (net[x + 1][y + 1] - net[x + 1][y] - net[x][y + 1] + net[x][y]) / (dx * dy));
        }
      }
      square = std::max(square, along_x * along_x + along_y * along_y);
      most_curved_ = std::max(most_curved_, std::max(xx, yy) + xy);
    }
  }
  const double above = std::max(highest, 0.0);
  for (double& value : coefficients_) value -= above;
  steepest_ = std::sqrt(square);
  deepest_ = above - lowest;
}

Texture::Sample Texture::at(Vec3 place) const noexcept {
  double x, y;
  bool is_beyond_x, is_beyond_y;
  const size_t column = columns_.cell(component(place, columns_.axis), x, is_beyond_x);
  const size_t row = rows_.cell(component(place, rows_.axis), y, is_beyond_y);
  const Weights across(x, columns_.width), down(y, rows_.width);
  double height = 0, along_x = 0, along_y = 0, xx = 0, xy = 0, yy = 0;
  for (size_t i = 0; i < 4; ++i) {
    const double* const line = &coefficients_[(row + i) * columns_.padded() + column];
    double value = 0, slope = 0, curvature = 0;
    for (size_t k = 0; k < 4; ++k) {
      value += across.value[k] * line[k];
      slope += across.slope[k] * line[k];
      curvature += across.curvature[k] * line[k];
    }
    height += down.value[i] * value;
    along_x += down.value[i] * slope;
    along_y += down.slope[i] * value;
    xx += down.value[i] * curvature;
    xy += down.slope[i] * slope;
    yy += down.curvature[i] * value;
  }
  if (is_beyond_x) along_x = xx = xy = 0;
  if (is_beyond_y) along_y = yy = xy = 0;
  const Vec3 u = unit(columns_.axis), v = unit(rows_.axis);
  return {std::min(height, 0.0), along_x * u + along_y * v,
          xx * outer(u, u) + yy * outer(v, v) + xy * (outer(u, v) + outer(v, u))};
}

}  // namespace fs
