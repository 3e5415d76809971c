#include "budget/fair.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <iterator>
#include <queue>

namespace fs {

double distance(const SlopeWant& want, const Box& box) noexcept {
  switch (want.region) {
    case SlopeWant::Region::everywhere: return -std::numeric_limits<double>::infinity();
    case SlopeWant::Region::ball: return box.distance(want.centre) - want.radius;
    case SlopeWant::Region::slab: break;
  }
  const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower), n = want.normal;
  const double reach = std::fabs(n.x) * half.x + std::fabs(n.y) * half.y + std::fabs(n.z) * half.z;
  return std::fabs(dot(n, middle - want.centre)) - reach - want.radius;
}

namespace {

bool holds(const SlopeWant& want, const Box& box) {  // all of the box
  const Vec3 middle = 0.5 * (box.lower + box.upper), half = 0.5 * (box.upper - box.lower), n = want.normal;
  switch (want.region) {
    case SlopeWant::Region::everywhere: return true;
    case SlopeWant::Region::ball: return norm(middle - want.centre) + norm(half) <= want.radius;
    case SlopeWant::Region::slab: break;
  }
  const double reach = std::fabs(n.x) * half.x + std::fabs(n.y) * half.y + std::fabs(n.z) * half.z;
  return std::fabs(dot(n, middle - want.centre)) + reach <= want.radius;
}

// False: nothing is felt of both at one place.
bool meet(const SlopeWant& a, const SlopeWant& b) {
  using enum SlopeWant::Region;
  if (a.region == ball && b.region == ball) return norm(a.centre - b.centre) <= a.radius + b.radius;
  if (a.region == slab && b.region == ball) return std::fabs(dot(a.normal, b.centre - a.centre)) <= a.radius + b.radius;
  return a.region != ball || b.region != slab || meet(b, a);
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

// Halves the boxes, the largest first, until the wants that meet a part are few enough, or are felt all over it.
class Search {
 public:
  Search(std::span<const SlopeWant> wants, size_t users, double limit)
      : all_(wants), limit_(limit), wants_(users), visits_left_(300'000 + 60 * wants.size()) {
    out_.bounds.assign(users, std::numeric_limits<double>::infinity());
    out_.neighbours_of.assign(users, FairBounds::none);
  }

  FairBounds run(const Box& box, std::vector<uint32_t> wants) {
    parts_.push_back({box, std::move(wants), 0});
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
    std::vector<uint32_t> wants;  // the numbers of those that meet it
    int depth;
  };

  void look(const Part& part) {
    add_up(part.wants);
    const double bound = bound_here();
    if (std::none_of(users_.begin(), users_.end(), [&](uint32_t user) { return is_lower(user, wants_[user], bound); })) return;
    visits_left_ -= std::min(visits_left_, part.wants.size());
    if (part.wants.size() <= few) {
      visits_left_ -= std::min(visits_left_, part.wants.size() * part.wants.size());
      if (!is_lower_for_any(part.wants, bound)) return;
      add_up(part.wants);
    }
    bool is_full = true;
    for (const uint32_t i : part.wants) is_full = is_full && holds(all_[i], part.box);
    if (is_full || part.depth == most_depth || visits_left_ == 0) return lower(bound);
    for (const Box& half : halves(part.box)) {
      Part next{half, {}, part.depth + 1};
      for (const uint32_t i : part.wants) {
        if (meets(all_[i], half)) next.wants.push_back(i);
      }
      parts_.push_back(std::move(next));
    }
  }

  // Adds up what each user wants by these wants: users_, wants_.
  void add_up(const std::vector<uint32_t>& wants) {
    users_.clear();
    for (const uint32_t i : wants) wants_[all_[i].user] = 0;
    for (const uint32_t i : wants) {
      const SlopeWant& want = all_[i];
      if (wants_[want.user] == 0) users_.push_back(want.user), objects_[want.user] = want.object;
      wants_[want.user] += want.slope;
    }
  }
  double bound_here() {
    values_.clear();
    for (const uint32_t user : users_) values_.push_back(wants_[user]);
    return fair_bound(values_, limit_);
  }

  bool is_lower(uint32_t user, double want, double bound) const { return want > bound && out_.bounds[user] > bound; }

  // The same where for each user only those count whose wants meet one of its own.
  bool is_lower_for_any(const std::vector<uint32_t>& wants, double bound) {
    std::vector<uint32_t> lower;
    for (const uint32_t user : users_) {
      if (is_lower(user, wants_[user], bound)) lower.push_back(user);
    }
    std::vector<uint32_t> own, met;
    for (const uint32_t user : lower) {
      own.clear();
      met.clear();
      std::copy_if(wants.begin(), wants.end(), std::back_inserter(own), [&](uint32_t i) { return all_[i].user == user; });
      std::copy_if(wants.begin(), wants.end(), std::back_inserter(met), [&](uint32_t k) {
        return all_[k].user == user || std::any_of(own.begin(), own.end(), [&](uint32_t i) { return meet(all_[i], all_[k]); });
      });
      add_up(met);
      if (is_lower(user, wants_[user], bound_here())) return true;
    }
    return false;
  }

  void lower(double bound) {
    Neighbours neighbours;
    std::sort(users_.begin(), users_.end(),
              [&](uint32_t a, uint32_t b) { return wants_[a] != wants_[b] ? wants_[a] > wants_[b] : a < b; });
    seen_.clear();
    for (const uint32_t user : users_) seen_.push_back(objects_[user]);
    size_t named = 0;
    for (size_t i = 0; i < seen_.size() && named < neighbours.objects.size(); ++i) {
      if (std::find(seen_.begin(), seen_.begin() + i, seen_[i]) == seen_.begin() + i) neighbours.objects[named++] = seen_[i];
    }
    std::sort(seen_.begin(), seen_.end());
    neighbours.count = static_cast<uint32_t>(std::unique(seen_.begin(), seen_.end()) - seen_.begin());
    for (const uint32_t user : users_) {
      if (!is_lower(user, wants_[user], bound)) continue;
      out_.bounds[user] = bound;
      out_.neighbours_of[user] = static_cast<uint32_t>(out_.neighbours.size());
    }
    out_.neighbours.push_back(neighbours);
  }

  const std::span<const SlopeWant> all_;
  const double limit_;
  FairBounds out_;
  std::deque<Part> parts_;
  std::vector<double> wants_, values_;             // N/m, of each user; those of a part
  std::vector<uint32_t> objects_{std::vector<uint32_t>(wants_.size())};  // of each user
  std::vector<uint32_t> users_, seen_;             // of a part
  size_t visits_left_;
};

}  // namespace

double fair_bound(std::vector<double>& wants, double limit) noexcept {
  double sum = 0;
  for (const double want : wants) sum += want;
  if (sum <= limit) return std::numeric_limits<double>::infinity();
  std::sort(wants.begin(), wants.end());
  auto left = static_cast<double>(wants.size());
  for (const double want : wants) {
    if (want * left > limit) return limit / left;
    limit -= want;
    --left;
  }
  return std::numeric_limits<double>::infinity();  // but for rounding they want no more
}

double most_wanted(std::span<const SlopeWant> wants, const Box& within) {
  struct Part {
    Box box;
    std::vector<uint32_t> wants;  // the numbers of those that meet it
    double sum;                   // N/m, of these
    int depth;
    bool operator<(const Part& other) const { return sum < other.sum; }
  };
  constexpr int most_depth = 30;
  size_t visits_left = 30'000 + 30 * wants.size();
  const auto part_of = [&](const Box& box, const std::vector<uint32_t>& numbers, int depth) {
    Part part{box, {}, 0, depth};
    for (const uint32_t i : numbers) {
      if (!meets(wants[i], box)) continue;
      part.wants.push_back(i);
      part.sum += wants[i].slope;
    }
    visits_left -= std::min(visits_left, numbers.size());
    return part;
  };
  std::vector<uint32_t> all(wants.size());
  for (uint32_t i = 0; i < wants.size(); ++i) all[i] = i;
  std::priority_queue<Part> parts;  // the one where most may be wanted comes first
  parts.push(part_of(within, all, 0));
  for (;;) {
    const Part part = parts.top();
    parts.pop();
    const bool is_full = std::all_of(part.wants.begin(), part.wants.end(), [&](uint32_t i) { return holds(wants[i], part.box); });
    if (is_full || part.depth == most_depth || visits_left == 0) return part.sum;
    for (const Box& half : halves(part.box)) parts.push(part_of(half, part.wants, part.depth + 1));
  }
}

FairBounds fair_bounds(std::span<const SlopeWant> wants, size_t users, const Box& within, double limit) {
  std::vector<uint32_t> all;
  for (uint32_t i = 0; i < wants.size(); ++i) {
    if (wants[i].slope > 0 && meets(wants[i], within)) all.push_back(i);
  }
  return Search(wants, users, limit).run(within, std::move(all));
}

}  // namespace fs
