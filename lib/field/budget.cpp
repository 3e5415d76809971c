#include "field/budget.h"

#include <cmath>
#include <array>

namespace fs {
namespace {

bool meets(const Claim& claim, const Box& box) {
  switch (claim.region) {
    case Claim::Region::everywhere: return true;
    case Claim::Region::ball: return box.distance(claim.centre) <= claim.radius;
    case Claim::Region::slab: break;
  }
  const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower), n = claim.normal;
  const double reach = std::fabs(n.x) * half.x + std::fabs(n.y) * half.y + std::fabs(n.z) * half.z;
  return std::fabs(dot(n, middle - claim.centre)) <= claim.radius + reach;
}

bool holds(const Claim& claim, const Box& box) {  // all of the box
  const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower), n = claim.normal;
  switch (claim.region) {
    case Claim::Region::everywhere: return true;
    case Claim::Region::ball: return norm(middle - claim.centre) + norm(half) <= claim.radius;
    case Claim::Region::slab: break;
  }
  const double reach = std::fabs(n.x) * half.x + std::fabs(n.y) * half.y + std::fabs(n.z) * half.z;
  return std::fabs(dot(n, middle - claim.centre)) + reach <= claim.radius;
}

// Halves a box until the claims that meet a part of it are few enough, or are felt all over it.
class Search {
 public:
  Search(std::span<const Claim> claims, double enough, std::vector<double>& sums)
      : claims_(claims), enough_(enough), sums_(sums), visits_left_(20'000 + 40 * claims.size()) {}

  // claims: the numbers of those that meet the box.
  void look(const Box& box, const std::vector<uint32_t>& claims, int depth) {
    double sum = 0;
    for (const uint32_t i : claims) sum += claims_[i].slope;
    // Halving it again can only make a difference where this sum is more than all of them have already.
    bool is_new = false;
    for (const uint32_t i : claims) is_new |= sums_[i] < sum;
    if (!(sum > enough_) || !is_new) return;
    visits_left_ -= std::min(visits_left_, claims.size());
    bool is_full = true;
    for (const uint32_t i : claims) is_full = is_full && holds(claims_[i], box);
    if (is_full || depth == most_depth || visits_left_ == 0) {
      for (const uint32_t i : claims) sums_[i] = std::max(sums_[i], sum);
      return;
    }
    for (const Box& half : halves(box)) {
      std::vector<uint32_t> inside;
      for (const uint32_t i : claims) {
        if (meets(claims_[i], half)) inside.push_back(i);
      }
      look(half, inside, depth + 1);
    }
  }

 private:
  static constexpr int most_depth = 30;

  static std::array<Box, 2> halves(const Box& box) {
    const Vec3 size = box.upper - box.lower;
    Box low = box, high = box;
    if (size.x >= size.y && size.x >= size.z) {
      low.upper.x = high.lower.x = 0.5 * (box.lower.x + box.upper.x);
    } else if (size.y >= size.z) {
      low.upper.y = high.lower.y = 0.5 * (box.lower.y + box.upper.y);
    } else {
      low.upper.z = high.lower.z = 0.5 * (box.lower.z + box.upper.z);
    }
    return {low, high};
  }

  const std::span<const Claim> claims_;
  const double enough_;
  std::vector<double>& sums_;
  size_t visits_left_;
};

}  // namespace

std::vector<double> greatest_sums(std::span<const Claim> claims, const Box& within, double enough) {
  std::vector<double> sums(claims.size());
  std::vector<uint32_t> all;
  for (uint32_t i = 0; i < claims.size(); ++i) {
    sums[i] = claims[i].slope;
    if (claims[i].slope > 0 && meets(claims[i], within)) all.push_back(i);
  }
  Search(claims, enough, sums).look(within, all, 0);
  return sums;
}

}  // namespace fs
