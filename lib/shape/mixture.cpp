#include "shape/mixture.h"

#include <cmath>
#include <limits>

namespace fs {
namespace {

constexpr int most_chosen = 5;  // four directions give every mean; the fifth then replaces one of them

// The directions that have a part.
struct Support {
  int count = 0;
  int index[most_chosen];
  double change[most_chosen];  // of the parts, see find_change

  void drop(int i) noexcept {
    --count;
    for (; i < count; ++i) index[i] = index[i + 1];
  }

  // The change to the parts that would be best if parts could be negative. False: the last of the directions is a mean of the
  // others; then the change leaves the mean as it is and lowers the costs, however far it goes.
  bool find_change(const Mixture& of) noexcept {
    // The differences from the first direction as products of unit vectors across each other and a triangle of factors.
    Vec3 unit[most_chosen];
    double factor[most_chosen][most_chosen];
    const Vec3 first = of.directions[index[0]];
    for (int j = 1; j < count; ++j) {
      const Vec3 difference = of.directions[index[j]] - first;
      Vec3 rest = difference;
      for (int i = 1; i < j; ++i) {
        factor[i][j] = dot(unit[i], rest);
        rest += -factor[i][j] * unit[i];
      }
      factor[j][j] = norm(rest);
      if (factor[j][j] > 1e-7 * norm(difference)) {
        unit[j] = normalized(rest);
        continue;
      }
      count = j + 1;
      change[0] = -1;
      change[j] = 1;
      for (int i = j - 1; i > 0; --i) {
        double sum = factor[i][j];
        for (int k = i + 1; k < j; ++k) sum += factor[i][k] * change[k];
        change[i] = -sum / factor[i][i];
        change[0] -= change[i];
      }
      double slope = 0;
      for (int i = 0; i <= j; ++i) slope += change[i] * of.costs[index[i]];
      for (int i = 0; i <= j && slope > 0; ++i) change[i] = -change[i];
      return false;
    }
    double along[most_chosen];  // the best mean less the first direction, along each unit vector
    for (int j = 1; j < count; ++j) {
      double sum = of.costs[index[j]] - of.costs[index[0]];
      for (int i = 1; i < j; ++i) sum -= factor[i][j] * along[i];
      along[j] = sum / factor[j][j];
    }
    for (int j = 1; j < count; ++j) along[j] = -along[j] - dot(unit[j], first);
    double best[most_chosen] = {1};
    for (int i = count - 1; i > 0; --i) {
      double sum = along[i];
      for (int k = i + 1; k < count; ++k) sum -= factor[i][k] * best[k];
      best[i] = sum / factor[i][i];
      best[0] -= best[i];
    }
    for (int i = 0; i < count; ++i) change[i] = best[i] - of.parts[index[i]];
    return true;
  }
};

}  // namespace

void Mixture::mix() noexcept {
  for (double& part : parts) part = 0;
  Support chosen;
  chosen.index[0] = 0;
  for (int i = 1; i < size; ++i) {
    if (costs[i] < costs[chosen.index[0]]) chosen.index[0] = i;
  }
  chosen.count = 1;
  parts[chosen.index[0]] = 1;
  mean = directions[chosen.index[0]];
  for (int round = 0; round < 4 * most; ++round) {
    // The one that lowers the sum most.
    double level = 0;
    for (int i = 0; i < chosen.count; ++i) {
      const int k = chosen.index[i];
      level += parts[k] * (costs[k] + dot(directions[k], mean));
    }
    int next = -1;
    double least = level - 1e-12 * (1 + std::fabs(level));
    for (int i = 0; i < size; ++i) {
      const double here = costs[i] + dot(directions[i], mean);
      if (parts[i] > 0 || !(here < least)) continue;
      least = here;
      next = i;
    }
    if (next < 0) return;
    chosen.index[chosen.count++] = next;
    // As far as no part becomes negative; the first that would be is dropped, and so on.
    for (;;) {
      double way = chosen.find_change(*this) ? 1 : std::numeric_limits<double>::infinity();
      int first = -1;
      for (int i = 0; i < chosen.count; ++i) {
        if (!(chosen.change[i] < 0)) continue;
        const double until = parts[chosen.index[i]] / -chosen.change[i];
        if (until > way) continue;
        way = until;
        first = i;
      }
      for (int i = 0; i < chosen.count && way > 0; ++i) parts[chosen.index[i]] += way * chosen.change[i];
      if (first < 0) break;
      parts[chosen.index[first]] = 0;
      chosen.drop(first);
    }
    double sum = 0;
    mean = {};
    for (int i = 0; i < chosen.count; ++i) sum += parts[chosen.index[i]];
    for (int i = 0; i < chosen.count; ++i) {
      parts[chosen.index[i]] /= sum;
      mean += parts[chosen.index[i]] * directions[chosen.index[i]];
    }
  }
}

int Mixture::count() const noexcept {
  int out = 0;
  for (int i = 0; i < size; ++i) out += parts[i] > 0;
  return out;
}

Mat3 Mixture::across() const noexcept {
  Mat3 out{};
  int first = -1;
  for (int i = 0; i < size; ++i) {
    if (!(parts[i] > 0)) continue;
    if (first < 0) {
      first = i;
      continue;
    }
    const Vec3 difference = directions[i] - directions[first];
    const Vec3 rest = difference - out * difference;
    if (!(norm(rest) > 1e-6 * norm(difference))) continue;
    const Vec3 unit = normalized(rest);
    out += outer(unit, unit);
  }
  return out;
}

}  // namespace fs
