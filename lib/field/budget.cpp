#include "field/budget.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <iterator>
#include <queue>

namespace fs {

double distance(const Claim& claim, const Box& box) noexcept {
  switch (claim.region) {
    case Claim::Region::everywhere: return -std::numeric_limits<double>::infinity();
    case Claim::Region::ball: return box.distance(claim.centre) - claim.radius;
    case Claim::Region::slab: break;
  }
  const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower), n = claim.normal;
  const double reach = std::fabs(n.x) * half.x + std::fabs(n.y) * half.y + std::fabs(n.z) * half.z;
  return std::fabs(dot(n, middle - claim.centre)) - reach - claim.radius;
}

namespace {

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
  Search(std::span<const Claim> claims, size_t users, double total)
      : claims_(claims), total_(total), wants_(users), visits_left_(300'000 + 300 * claims.size()) {
    out_.levels.assign(users, std::numeric_limits<double>::infinity());
    out_.crowd.assign(users, Shares::none);
  }

  Shares run(const Box& box, std::vector<uint32_t> claims) {
    parts_.push_back({box, std::move(claims), 0});
    while (!parts_.empty()) {
      const Part part = std::move(parts_.front());
      parts_.pop_front();
      look(part);
    }
    return std::move(out_);
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
    add_up(part.claims);
    const double level = level_here();
    if (std::none_of(users_.begin(), users_.end(), [&](uint32_t user) { return is_lower(user, wants_[user], level); })) return;
    visits_left_ -= std::min(visits_left_, part.claims.size());
    if (part.claims.size() <= few) {
      visits_left_ -= std::min(visits_left_, part.claims.size() * part.claims.size());
      if (!is_lower_for_any(part.claims, level)) return;
      add_up(part.claims);
    }
    bool is_full = true;
    for (const uint32_t i : part.claims) is_full = is_full && holds(claims_[i], part.box);
    if (is_full || part.depth == most_depth || visits_left_ == 0) return lower(level);
    for (const Box& half : halves(part.box)) {
      Part next{half, {}, part.depth + 1};
      for (const uint32_t i : part.claims) {
        if (meets(claims_[i], half)) next.claims.push_back(i);
      }
      parts_.push_back(std::move(next));
    }
  }

  // What each user wants of these claims: users_, wants_.
  void add_up(const std::vector<uint32_t>& claims) {
    users_.clear();
    for (const uint32_t i : claims) wants_[claims_[i].user] = 0;
    for (const uint32_t i : claims) {
      const Claim& claim = claims_[i];
      if (wants_[claim.user] == 0) users_.push_back(claim.user), objects_[claim.user] = claim.object;
      wants_[claim.user] += claim.slope;
    }
  }
  double level_here() {
    values_.clear();
    for (const uint32_t user : users_) values_.push_back(wants_[user]);
    return level_of(values_, total_);
  }

  bool is_lower(uint32_t user, double want, double level) const { return want > level && out_.levels[user] > level; }

  // The same where for each user only those count whose claims meet one of its own.
  bool is_lower_for_any(const std::vector<uint32_t>& claims, double level) {
    std::vector<uint32_t> lower;
    for (const uint32_t user : users_) {
      if (is_lower(user, wants_[user], level)) lower.push_back(user);
    }
    std::vector<uint32_t> own, met;
    for (const uint32_t user : lower) {
      own.clear();
      met.clear();
      std::copy_if(claims.begin(), claims.end(), std::back_inserter(own), [&](uint32_t i) { return claims_[i].user == user; });
      std::copy_if(claims.begin(), claims.end(), std::back_inserter(met), [&](uint32_t k) {
        return claims_[k].user == user ||
               std::any_of(own.begin(), own.end(), [&](uint32_t i) { return meet(claims_[i], claims_[k]); });
      });
      add_up(met);
      if (is_lower(user, wants_[user], level_here())) return true;
    }
    return false;
  }

  void lower(double level) {
    Crowd crowd;
    std::sort(users_.begin(), users_.end(), [&](uint32_t a, uint32_t b) {
      return wants_[a] != wants_[b] ? wants_[a] > wants_[b] : a < b;
    });
    seen_.clear();
    for (const uint32_t user : users_) seen_.push_back(objects_[user]);
    size_t named = 0;
    for (size_t i = 0; i < seen_.size() && named < crowd.objects.size(); ++i) {
      if (std::find(seen_.begin(), seen_.begin() + i, seen_[i]) == seen_.begin() + i) crowd.objects[named++] = seen_[i];
    }
    std::sort(seen_.begin(), seen_.end());
    crowd.count = static_cast<uint32_t>(std::unique(seen_.begin(), seen_.end()) - seen_.begin());
    for (const uint32_t user : users_) {
      if (!is_lower(user, wants_[user], level)) continue;
      out_.levels[user] = level;
      out_.crowd[user] = static_cast<uint32_t>(out_.crowds.size());
    }
    out_.crowds.push_back(crowd);
  }

  const std::span<const Claim> claims_;
  const double total_;
  Shares out_;
  std::deque<Part> parts_;
  std::vector<double> wants_, values_;             // N/m, of each user; those of a part
  std::vector<uint32_t> objects_{std::vector<uint32_t>(wants_.size())};  // of each user
  std::vector<uint32_t> users_, seen_;             // of a part
  size_t visits_left_;
};

}  // namespace

double level_of(std::vector<double>& wants, double total) noexcept {
  double sum = 0;
  for (const double want : wants) sum += want;
  if (sum <= total) return std::numeric_limits<double>::infinity();
  std::sort(wants.begin(), wants.end());
  auto left = static_cast<double>(wants.size());
  for (const double want : wants) {
    if (want * left > total) return total / left;
    total -= want;
    --left;
  }
  return std::numeric_limits<double>::infinity();  // but for rounding they want no more
}

double most_wanted(std::span<const Claim> claims, const Box& within) {
  struct Part {
    Box box;
    std::vector<uint32_t> claims;  // the numbers of those that meet it
    double sum;                    // N/m, of these
    int depth;
    bool operator<(const Part& other) const { return sum < other.sum; }
  };
  constexpr int most_depth = 30;
  size_t visits_left = 30'000 + 30 * claims.size();
  const auto part_of = [&](const Box& box, const std::vector<uint32_t>& numbers, int depth) {
    Part part{box, {}, 0, depth};
    for (const uint32_t i : numbers) {
      if (!meets(claims[i], box)) continue;
      part.claims.push_back(i);
      part.sum += claims[i].slope;
    }
    visits_left -= std::min(visits_left, numbers.size());
    return part;
  };
  std::vector<uint32_t> all(claims.size());
  for (uint32_t i = 0; i < claims.size(); ++i) all[i] = i;
  std::priority_queue<Part> parts;  // the one where most may be wanted comes first
  parts.push(part_of(within, all, 0));
  for (;;) {
    const Part part = parts.top();
    parts.pop();
    const bool is_full = std::all_of(part.claims.begin(), part.claims.end(), [&](uint32_t i) { return holds(claims[i], part.box); });
    if (is_full || part.depth == most_depth || visits_left == 0) return part.sum;
    for (const Box& half : halves(part.box)) parts.push(part_of(half, part.claims, part.depth + 1));
  }
}

Shares fair_shares(std::span<const Claim> claims, size_t users, const Box& within, double total) {
  std::vector<uint32_t> all;
  for (uint32_t i = 0; i < claims.size(); ++i) {
    if (claims[i].slope > 0 && meets(claims[i], within)) all.push_back(i);
  }
  return Search(claims, users, total).run(within, std::move(all));
}

}  // namespace fs
