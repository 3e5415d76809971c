// A tree of boxes that finds the nearest of many items: the segments of a polyline or the triangles of a mesh. It knows
// only their boxes; the caller supplies the exact test.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "base/wanted.h"
#include "math/vec3.h"

namespace fs {

struct Box {
  Vec3 lower{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
             std::numeric_limits<double>::infinity()};
  Vec3 upper = -lower;

  void add(Vec3 p) {
    lower = {std::min(lower.x, p.x), std::min(lower.y, p.y), std::min(lower.z, p.z)};
    upper = {std::max(upper.x, p.x), std::max(upper.y, p.y), std::max(upper.z, p.z)};
  }
  void add(const Box& b) {
    lower = {std::min(lower.x, b.lower.x), std::min(lower.y, b.lower.y), std::min(lower.z, b.lower.z)};
    upper = {std::max(upper.x, b.upper.x), std::max(upper.y, b.upper.y), std::max(upper.z, b.upper.z)};
  }
  double half_area() const {
    const Vec3 e = upper - lower;
    return e.x * e.y + e.y * e.z + e.z * e.x;
  }
};

// Four-wide, built top down by the surface area heuristic in bins (Wald, "On fast construction of SAH-based bounding
// volume hierarchies", 2007).
//
// No rounding margin is needed. The distance to a box comes from lower - x and x - upper; the exact test clamps its
// points to the box of the item's vertices relative to x (triangle.h). Rounding is monotone, so the computed distance
// to a box never exceeds that to anything in it.
class BoxTree {
 public:
  // A few boxes stand in a line, without a tree. Throws Abandoned.
  BoxTree(std::vector<Box> boxes, Wanted& wanted) {
    items_.reserve(boxes.size());
    for (size_t i = 0; i < boxes.size(); ++i) items_.push_back({boxes[i], static_cast<uint32_t>(i)});
    boxes = {};
    if (items_.size() > few) {
      build(wanted);
    } else {
      line_up();
    }
    order_.reserve(items_.size());
    for (const Item& item : items_) order_.push_back(item.index);
    items_ = {};
  }

  // The indices of the boxes, leaf by leaf. A position, as in nearest(), is an index into this list.
  const std::vector<uint32_t>& order() const { return order_; }

  // [rt] Calls test(first, count, bound) for every leaf (a run of positions) that may hold something at a squared
  // distance of at most `bound` from x. test lowers bound when it finds something nearer. Near leaves come first.
  template <class Test>
  void nearest(Vec3 x, double bound, Test&& test) const {
    if (order_.size() <= few) return nearest_in_line(x, bound, test);
    struct Entry {
      double squared;
      uint32_t child, count;
    };
    Entry stack[stack_size];
    int size = 0;
    Entry now{0, 0, 0};
    for (;;) {
      if (now.count > 0) {
        test(now.child, now.count, bound);
      } else {
        const Node& node = nodes_[now.child];
        double squared[width];
        node.find_squared(x, squared);
        const int first = size;
        for (int i = 0; i < node.size; ++i) {
          if (squared[i] > bound) continue;
          int place = size++;  // the farthest child lies deepest in the stack
          for (; place > first && stack[place - 1].squared < squared[i]; --place) stack[place] = stack[place - 1];
          stack[place] = {squared[i], node.child[i], node.count[i]};
        }
      }
      do {
        if (size == 0) return;
        now = stack[--size];
      } while (now.squared > bound);
    }
  }

 private:
  static constexpr int width = 4;
  static constexpr size_t few = 12;         // up to this many boxes stand in a line
  static constexpr size_t leaf_size = 4;    // items at most
  static constexpr int heuristic_levels = 24;  // deeper nodes are split in halves, which bounds the depth and the stack
  static constexpr int stack_size = (heuristic_levels + 18) * (width - 1) + 1;
  static constexpr int bins = 16;

  struct Item {
    Box box;
    uint32_t index;
    double center(int axis) const {  // twice the centre: enough for comparisons
      return axis == 0   ? box.lower.x + box.upper.x
             : axis == 1 ? box.lower.y + box.upper.y
                         : box.lower.z + box.upper.z;
    }
  };

  struct Node {
    double lower_x[width], lower_y[width], lower_z[width], upper_x[width], upper_y[width], upper_z[width];
    uint32_t child[width];  // the index of a node, or the first position of a leaf
    uint8_t count[width];   // items of a leaf; 0: the child is a node
    int size;               // number of children

    void set_box(int i, const Box& box) {
      lower_x[i] = box.lower.x;
      lower_y[i] = box.lower.y;
      lower_z[i] = box.lower.z;
      upper_x[i] = box.upper.x;
      upper_y[i] = box.upper.y;
      upper_z[i] = box.upper.z;
    }
    // The squared distances from x to the boxes.
    void find_squared(Vec3 x, double* squared) const {
      for (int i = 0; i < width; ++i) {
        const double dx = std::max(std::max(lower_x[i] - x.x, x.x - upper_x[i]), 0.0);
        const double dy = std::max(std::max(lower_y[i] - x.y, x.y - upper_y[i]), 0.0);
        const double dz = std::max(std::max(lower_z[i] - x.z, x.z - upper_z[i]), 0.0);
        squared[i] = dx * dx + dy * dy + dz * dz;
      }
    }
  };

  // The nearest box first, then the others in their order, as far as they may hold something nearer. What is only as near
  // as what was found before it in the order is passed over: it could only be equal.
  template <class Test>
  void nearest_in_line(Vec3 x, double bound, Test&& test) const {
    double squared[few + width];
    double nearest[width];
    nodes_[0].find_squared(x, nearest);
    std::copy_n(nearest, width, squared);
    for (size_t n = 1; n < nodes_.size(); ++n) {
      double* const here = squared + n * width;
      nodes_[n].find_squared(x, here);
      for (int i = 0; i < width; ++i) nearest[i] = std::min(nearest[i], here[i]);
    }
    const double least = std::min(std::min(nearest[0], nearest[1]), std::min(nearest[2], nearest[3]));
    if (!(least <= bound)) return;
    const auto count = static_cast<uint32_t>(order_.size());
    const auto up_to = [&](double most) {  // bit i: box i is not farther
      uint32_t boxes = 0;
      for (uint32_t i = 0; i < count; ++i) boxes |= static_cast<uint32_t>(squared[i] <= most) << i;
      return boxes;
    };
    const auto first = static_cast<uint32_t>(std::countr_zero(up_to(least)));
    uint32_t found = count;  // where the nearest so far was found
    const auto ask = [&](uint32_t i) {
      const double before = bound;
      test(i, 1u, bound);
      if (bound < before) found = i;
    };
    ask(first);
    for (uint32_t rest = up_to(bound) & ~(1u << first); rest; rest &= rest - 1) {
      const auto i = static_cast<uint32_t>(std::countr_zero(rest));
      if (squared[i] < bound || (squared[i] == bound && i < found)) ask(i);
    }
  }

  void line_up() {
    nodes_.resize((items_.size() + width - 1) / width);
    for (size_t i = 0; i < width * nodes_.size(); ++i) {
      nodes_[i / width].set_box(static_cast<int>(i % width), i < items_.size() ? items_[i].box : Box());
    }
  }

  struct Range {
    size_t begin, end;
    Box box;
    size_t size() const { return end - begin; }
  };

  Box box_of(size_t begin, size_t end, Wanted& wanted) const {
    Box box;
    for (size_t i = begin; i < end; ++i) {
      wanted.step();
      box.add(items_[i].box);
    }
    return box;
  }

  void build(Wanted& wanted) {
    struct Task {
      Range range;
      uint32_t node;
      int level;
    };
    std::vector<Task> tasks;
    nodes_.reserve(items_.size() / 8 + 1);
    nodes_.emplace_back();
    tasks.push_back({{0, items_.size(), {}}, 0, 0});
    while (!tasks.empty()) {
      const Task task = tasks.back();
      tasks.pop_back();
      Range children[width] = {task.range};
      int size = 1;
      while (size < width) {
        // Split the child that costs the most to search.
        int largest = -1;
        double most = -1;
        for (int i = 0; i < size; ++i) {
          const double count = static_cast<double>(children[i].size());
          const double work = task.level < heuristic_levels && size > 1 ? children[i].box.half_area() * count : count;
          if (children[i].size() > leaf_size && work > most) {
            largest = i;
            most = work;
          }
        }
        if (largest < 0) break;
        const Range range = children[largest];
        const size_t middle = split(range.begin, range.end, task.level < heuristic_levels, wanted);
        children[largest] = {range.begin, middle, box_of(range.begin, middle, wanted)};
        children[size++] = {middle, range.end, box_of(middle, range.end, wanted)};
      }
      Node node{};
      node.size = size;
      for (int i = 0; i < size; ++i) {
        const Range& range = children[i];
        node.set_box(i, range.box);
        if (range.size() <= leaf_size) {
          node.child[i] = static_cast<uint32_t>(range.begin);
          node.count[i] = static_cast<uint8_t>(range.size());
        } else {
          node.child[i] = static_cast<uint32_t>(nodes_.size());
          nodes_.emplace_back();
          tasks.push_back({range, node.child[i], task.level + 1});
        }
      }
      nodes_[task.node] = node;
    }
  }

  // Divides the items of a range into two parts; returns where the second part begins.
  size_t split(size_t begin, size_t end, bool by_heuristic, Wanted& wanted) {
    double low[3], high[3];
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = high[axis] = items_[begin].center(axis);
    }
    for (size_t i = begin + 1; i < end; ++i) {
      wanted.step();
      for (int axis = 0; axis < 3; ++axis) {
        const double c = items_[i].center(axis);
        low[axis] = std::min(low[axis], c);
        high[axis] = std::max(high[axis], c);
      }
    }
    int axis = 0;
    for (int i = 1; i < 3; ++i) {
      if (high[i] - low[i] > high[axis] - low[axis]) axis = i;
    }
    const double scale = bins / (high[axis] - low[axis]);
    if (by_heuristic && scale > 0 && std::isfinite(scale)) {
      const auto bin = [&](const Item& item) {
        wanted.step();
        return std::min(static_cast<int>((item.center(axis) - low[axis]) * scale), bins - 1);
      };
      const int border = best_border(begin, end, bin);
      if (border > 0) {
        const auto middle = std::partition(items_.begin() + static_cast<ptrdiff_t>(begin),
                                           items_.begin() + static_cast<ptrdiff_t>(end),
                                           [&](const Item& item) { return bin(item) < border; });
        return static_cast<size_t>(middle - items_.begin());
      }
    }
    const size_t middle = begin + (end - begin) / 2;
    std::nth_element(items_.begin() + static_cast<ptrdiff_t>(begin), items_.begin() + static_cast<ptrdiff_t>(middle),
                     items_.begin() + static_cast<ptrdiff_t>(end),
                     [&](const Item& a, const Item& b) {
                       wanted.step();
                       return a.center(axis) < b.center(axis);
                     });
    return middle;
  }

  // The bin at which the second part of the cheapest split begins; 0: no split.
  template <class Bin>
  int best_border(size_t begin, size_t end, Bin bin) const {
    Box boxes[bins];
    size_t counts[bins] = {};
    for (size_t i = begin; i < end; ++i) {
      const int b = bin(items_[i]);
      boxes[b].add(items_[i].box);
      ++counts[b];
    }
    double right_cost[bins] = {};
    Box box;
    size_t count = 0;
    for (int b = bins - 1; b > 0; --b) {
      box.add(boxes[b]);
      count += counts[b];
      right_cost[b] = count > 0 ? static_cast<double>(count) * box.half_area() : -1;
    }
    box = {};
    count = 0;
    int best = 0;
    double best_cost = std::numeric_limits<double>::infinity();
    for (int b = 1; b < bins; ++b) {
      box.add(boxes[b - 1]);
      count += counts[b - 1];
      if (count == 0 || right_cost[b] < 0) continue;
      const double cost = static_cast<double>(count) * box.half_area() + right_cost[b];
      if (cost < best_cost) {
        best_cost = cost;
        best = b;
      }
    }
    return best;
  }

  std::vector<Item> items_;  // used only while building
  std::vector<Node> nodes_;  // the first is the root; or four boxes after the other, in a line
  std::vector<uint32_t> order_;
};

}  // namespace fs
