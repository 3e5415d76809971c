#include "field/budget.h"

#include <array>
#include <cmath>
#include <deque>

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

// False: nothing is felt of both at one place.
bool meet(const Claim& a, const Claim& b) {
  if (a.region == Claim::Region::ball && b.region == Claim::Region::ball) return norm(a.centre - b.centre) <= a.radius + b.radius;
  if (a.region == Claim::Region::slab && b.region == Claim::Region::ball) {
    return std::fabs(dot(a.normal, b.centre - a.centre)) <= a.radius + b.radius;
  }
  return a.region != Claim::Region::ball || b.region != Claim::Region::slab || meet(b, a);
}

std::array<Box, 2> halves(const Box& box) {
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

// Halves the boxes, the largest first, until the claims that meet a part are few enough, or are felt all over it.
class Search {
 public:
  Search(std::span<const Claim> claims, double enough, std::vector<double>& sums)
      : claims_(claims), enough_(enough), sums_(sums), visits_left_(20'000 + 30 * claims.size()) {}

  void run(const Box& box, std::vector<uint32_t> claims) {
    parts_.push_back({box, std::move(claims), 0});
    while (!parts_.empty()) {
      const Part part = std::move(parts_.front());
      parts_.pop_front();
      look(part);
    }
  }

 private:
  static constexpr int most_depth = 30;
  static constexpr size_t few = 32;
  struct Part {
    Box box;
    std::vector<uint32_t> claims;  // the numbers of those that meet it
    int depth;
  };

  void look(const Part& part) {
    double sum = 0;
    for (const uint32_t i : part.claims) sum += claims_[i].slope;
    if (!can_raise(part.claims, [&](uint32_t) { return sum; })) return;
    visits_left_ -= std::min(visits_left_, part.claims.size());
    if (part.claims.size() <= few) {
      visits_left_ -= std::min(visits_left_, part.claims.size() * part.claims.size());
      // Without the ones that a claim does not meet.
      const auto own_sum = [&](uint32_t i) {
        double out = 0;
        for (const uint32_t k : part.claims) out += k == i || meet(claims_[i], claims_[k]) ? claims_[k].slope : 0;
        return out;
      };
      if (!can_raise(part.claims, own_sum)) return;
    }
    bool is_full = true;
    for (const uint32_t i : part.claims) is_full = is_full && holds(claims_[i], part.box);
    if (is_full || part.depth == most_depth || visits_left_ == 0) {
      for (const uint32_t i : part.claims) sums_[i] = std::max(sums_[i], sum);
      return;
    }
    for (const Box& half : halves(part.box)) {
      Part next{half, {}, part.depth + 1};
      for (const uint32_t i : part.claims) {
        if (meets(claims_[i], half)) next.claims.push_back(i);
      }
      parts_.push_back(std::move(next));
    }
  }

  // Whether a sum is more than a claim has already, and more than enough: if not, a part of the box is not needed.
  template <class Sum>
  bool can_raise(const std::vector<uint32_t>& claims, const Sum& sum) const {
    for (const uint32_t i : claims) {
      if (const double s = sum(i); s > enough_ && s > sums_[i]) return true;
    }
    return false;
  }

  const std::span<const Claim> claims_;
  const double enough_;
  std::vector<double>& sums_;
  size_t visits_left_;
  std::deque<Part> parts_;
};

}  // namespace

std::vector<double> greatest_sums(std::span<const Claim> claims, const Box& within, double enough) {
  std::vector<double> sums(claims.size());
  std::vector<uint32_t> all;
  for (uint32_t i = 0; i < claims.size(); ++i) {
    sums[i] = claims[i].slope;
    if (claims[i].slope > 0 && meets(claims[i], within)) all.push_back(i);
  }
  Search(claims, enough, sums).run(within, std::move(all));
  return sums;
}

}  // namespace fs
