#include "force/wide_tree.h"

#include <algorithm>
#include <bit>
#include <memory>
#include <new>

#if FORCESERVER_EMBREE >= 4  // what CMake found
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <tbb/task_arena.h>

#include "base/error.h"

namespace fs {
namespace {

constexpr float infinite = std::numeric_limits<float>::infinity();

// Rounded outwards.
float below(double v) {
  const float f = static_cast<float>(v);
  return f <= v ? f : std::nextafter(f, -infinite);
}
float above(double v) { return -below(-v); }

constexpr int width = WideTree::width;

// What the builder makes: a tree of two children a node.
struct Built {
  uint32_t count;         // items; 0: it is no leaf
  uint32_t items[width];
  Built* children[2];
  RTCBounds bounds[2];    // of the children
  float area;             // of its own bounds, once it is known
  float costs[width];     // see find_costs
  uint8_t cuts[width];
};

float half_area(const RTCBounds& b) {
  const float x = b.upper_x - b.lower_x, y = b.upper_y - b.lower_y, z = b.upper_z - b.lower_z;
  return x * y + y * z + z * x;
}

// What a subtree costs to search if it stands under a wide node as at most k + 1 children: costs[k], in areas. cuts[k]: how
// many of them are for the first child, when the two children share them; 0: the subtree is one child. After Ylitie, Karras
// & Laine, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs" (HPG 2017).
void find_costs(Built& node, float area, Wanted& wanted) {
  wanted.step();
  node.area = area;
  if (node.count > 0) {
    std::fill_n(node.costs, width, area);
    std::fill_n(node.cuts, width, uint8_t{0});
    return;
  }
  const Built &first = *node.children[0], &second = *node.children[1];
  for (int k = width - 1; k >= 0; --k) node.costs[k] = infinite;
  for (int k = 1; k < width; ++k) {
    for (int i = 1; i <= k; ++i) {
      const float cost = first.costs[i - 1] + second.costs[k - i];
      if (cost < node.costs[k]) {
        node.costs[k] = cost;
        node.cuts[k] = static_cast<uint8_t>(i);
      }
    }
  }
  const float alone = area + node.costs[width - 1];
  node.costs[0] = alone;
  node.cuts[0] = 0;
  for (int k = 1; k < width; ++k) {
    if (alone < node.costs[k]) {
      node.costs[k] = alone;
      node.cuts[k] = 0;
    }
  }
}

// The children of a wide node.
struct Children {
  uint32_t count = 0;
  const Built* nodes[width];
  RTCBounds bounds[width];

  // Adds a subtree as at most k + 1 children; is_top: it is the wide node itself.
  void add(const Built& node, const RTCBounds& box, int k, bool is_top = false) {
    const int cut = is_top ? top_cut(node) : node.cuts[k];
    if (cut == 0) {
      nodes[count] = &node;
      bounds[count++] = box;
      return;
    }
    add(*node.children[0], node.bounds[0], cut - 1);
    add(*node.children[1], node.bounds[1], k - cut);
  }
  // How a wide node shares its eight children out.
  static int top_cut(const Built& node) {
    int best = 1;
    float least = infinite;
    for (int i = 1; i < width; ++i) {
      const float cost = node.children[0]->costs[i - 1] + node.children[1]->costs[width - 1 - i];
      if (cost < least) {
        least = cost;
        best = i;
      }
    }
    return best;
  }
};

// The memory of what the builder makes, and what it has met. (Embree offers memory of its own; but when that runs out, a later
// build uses what has been freed.)
struct Work {
  Wanted& wanted;
  bool has_memory = true;
  static constexpr size_t block_size = 1000;
  std::vector<std::unique_ptr<Built[]>> blocks{};
  size_t left = 0;  // in the last block
  double done = 0;  // of the build, 0..1

  Built* make(size_t count) noexcept {
    if (left == 0) {
      try {
        blocks.push_back(std::make_unique_for_overwrite<Built[]>(block_size));
      } catch (const std::bad_alloc&) {
        has_memory = false;
        return nullptr;
      }
      left = block_size;
    }
    Built* const out = &blocks.back()[block_size - left--];
    *out = {};
    out->count = static_cast<uint32_t>(count);
    return out;
  }
};

void* make_node(RTCThreadLocalAllocator, unsigned, void* work) {
  return static_cast<Work*>(work)->make(0);
}
void set_children(void* node, void** children, unsigned count, void*) {
  for (unsigned i = 0; i < count && node; ++i) static_cast<Built*>(node)->children[i] = static_cast<Built*>(children[i]);
}
void set_bounds(void* node, const RTCBounds** bounds, unsigned count, void*) {
  for (unsigned i = 0; i < count && node; ++i) static_cast<Built*>(node)->bounds[i] = *bounds[i];
}
void* make_leaf(RTCThreadLocalAllocator, const RTCBuildPrimitive* items, size_t count, void* work) {
  Built* const leaf = static_cast<Work*>(work)->make(count);
  for (size_t i = 0; i < count && leaf; ++i) leaf->items[i] = items[i].primID;
  return leaf;
}
bool is_wanted(void* work, double done) {
  Work& w = *static_cast<Work*>(work);
  w.done = std::max(w.done, done);
  w.wanted.show_part(w.done);
  return w.has_memory && !w.wanted.is_abandoned();
}

struct Device {
  RTCDevice device = rtcNewDevice("ignore_config_files=1");
  RTCBVH bvh = device ? rtcNewBVH(device) : nullptr;
  ~Device() {
    if (bvh) rtcReleaseBVH(bvh);
    if (device) rtcReleaseDevice(device);
  }
};

// An assignment of {} would keep the memory.
template <class T>
void discard(std::vector<T>& list) {
  std::vector<T>().swap(list);
}

// The boxes of a node's children on its grid, never smaller than they are.
void set_boxes(WideTree::Node& node, const Children& built) {
  const auto lower = [&](uint32_t i, int axis) { return double{(&built.bounds[i].lower_x)[axis]}; };
  const auto upper = [&](uint32_t i, int axis) { return double{(&built.bounds[i].upper_x)[axis]}; };
  double size = 1e-12;  // at least, so that the square of a distance in steps is a float
  for (int axis = 0; axis < 3; ++axis) {
    double least = infinite, most = -infinite;
    for (uint32_t i = 0; i < built.count; ++i) {
      least = std::min(least, lower(i, axis));
      most = std::max(most, upper(i, axis));
    }
    node.origin[axis] = static_cast<float>(least);
    size = std::max(size, most - least);
  }
  node.step = above(size / WideTree::grid * (1 + 1e-6));
  node.steps = 1 / node.step;
  const double step = node.step;
  for (int axis = 0; axis < 3; ++axis) {
    for (uint32_t i = 0; i < built.count; ++i) {
      const double origin = node.origin[axis];
      const auto low = static_cast<uint32_t>(std::floor((lower(i, axis) - origin) / step * (1 - 1e-12)));
      const auto high = static_cast<uint32_t>(std::ceil((upper(i, axis) - origin) / step * (1 + 1e-12)));
      node.lower[i] |= low << 8 * axis;
      node.upper[i] |= high << 8 * axis;
    }
  }
}

// Moves a direction to the grid of Discs.
struct GridNormal {
  int x, y;
  explicit GridNormal(Vec3 direction) {
    const double sum = std::fabs(direction.x) + std::fabs(direction.y) + std::fabs(direction.z);
    const double scale = sum > 0 ? std::copysign(WideTree::Discs::unit / sum, direction.z) : 0;
    x = static_cast<int>(std::lround(scale * direction.x));
    y = static_cast<int>(std::lround(scale * direction.y));
  }
  Vec3 unit() const {
    return normalized({double(x), double(y), double(WideTree::Discs::unit - std::abs(x) - std::abs(y))});
  }
};

float height_of(uint32_t bits) {
  return std::bit_cast<float>((bits << WideTree::Discs::height_shift) + WideTree::Discs::smallest_height);
}

}  // namespace

void WideTree::add_discs(const std::vector<Vec3>& corners, Wanted& wanted) {
  constexpr uint32_t most_items = 1 << 14;  // what is larger is hardly flat
  discs_.resize(nodes_.size());
  std::vector<Leaf> ranges(nodes_.size());  // the items below a node
  const auto range_of = [&](uint32_t child) { return child & leaf_bit ? leaves_[child & ~leaf_bit] : ranges[child]; };
  for (size_t i = nodes_.size(); i-- > 0;) {
    Node& node = nodes_[i];
    Discs& discs = discs_[i];
    for (int c = 0; node.filled >> c & 1; ++c) {
      const Leaf range = range_of(node.child[c]);
      if (c == 0) ranges[i].begin = range.begin;
      ranges[i].end = range.end;
    }
    node.has_discs = ranges[i].end - ranges[i].begin <= most_items;
    for (int c = 0; node.has_discs && node.filled >> c & 1; ++c) {
      const Leaf range = range_of(node.child[c]);
      Vec3 areas{};
      for (uint32_t k = range.begin; k < range.end; ++k) {
        wanted.step();
        const Vec3* const p = corners.data() + size_t{3} * k;
        areas += cross(p[1] - p[0], p[2] - p[0]);
      }
      const GridNormal grid_normal(normalized(areas));
      const Vec3 normal = grid_normal.unit();
      double middle[3];
      for (int k = 0; k < 3; ++k) {
        const auto step = [&](uint32_t box) { return box >> 8 * k & 255; };
        middle[k] = node.origin[k] + double{node.step} * (step(node.lower[c]) + step(node.upper[c])) / 2;
      }
      double least = infinite, most = -infinite, most_beside = 0;
      for (size_t k = size_t{3} * range.begin; k < size_t{3} * range.end; ++k) {
        const Vec3 from = corners[k] - Vec3{middle[0], middle[1], middle[2]};
        const double along = dot(normal, from);
        least = std::min(least, along);
        most = std::max(most, along);
        most_beside = std::max(most_beside, dot(from, from) - along * along);
      }
      // Never smaller than it is: rounding is some 1e-16 of a coordinate. The largest sizes that can be stored are more than
      // any child has.
      constexpr double rounding = 1e-12;
      const double radius = std::ceil((std::sqrt(most_beside) + rounding) / node.step * (1 + 1e-6));
      const double offset = std::clamp(std::round((least + most) / 2 / node.step * Discs::offsets_a_step), -32768.0, 32767.0);
      const double plane = offset / Discs::offsets_a_step * node.step;
      const double height = (std::max(most - plane, plane - least) + rounding) / node.step * (1 + 1e-6);
      uint32_t height_bits = 0;
      while (height_bits < 255 && height_of(height_bits) < height) ++height_bits;
      discs.x_y[c] = static_cast<uint32_t>(grid_normal.x + Discs::unit) |
                     static_cast<uint32_t>(grid_normal.y + Discs::unit) << 16;
      discs.sizes[c] = static_cast<uint32_t>(static_cast<int>(offset) + Discs::zero_offset) |
                       static_cast<uint32_t>(std::min(radius, 255.0)) << 16 | height_bits << 24;
    }
  }
}

WideTree::WideTree(std::vector<Box> boxes, Wanted& wanted) {
  const size_t count = boxes.size();
  if (count <= width) {
    for (uint32_t i = 0; i < count; ++i) items_.push_back(i);
    leaves_.push_back({0, static_cast<uint32_t>(count)});
    return;
  }
  std::vector<RTCBuildPrimitive> primitives;
  primitives.reserve(count);
  for (const Box& b : boxes) {
    wanted.step();
    primitives.push_back({below(b.lower.x), below(b.lower.y), below(b.lower.z), 0, above(b.upper.x), above(b.upper.y),
                          above(b.upper.z), static_cast<unsigned>(primitives.size())});
  }
  discard(boxes);
  wanted.begin_part(0.45, infinite);  // Embree says how far it is
  Work work{wanted};
  const Device device;
  if (!device.bvh) throw std::bad_alloc();
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.maxBranchingFactor = 2;
  arguments.maxDepth = 32;  // beyond it ranges are split in halves, so that most_depth is never reached
  arguments.minLeafSize = arguments.maxLeafSize = width;  // as full as it gets
  arguments.sahBlockSize = width;                         // a leaf costs the same, however many items it has
  arguments.bvh = device.bvh;
  arguments.primitives = primitives.data();
  arguments.primitiveCount = arguments.primitiveArrayCapacity = primitives.size();
  arguments.createNode = make_node;
  arguments.setNodeChildren = set_children;
  arguments.setNodeBounds = set_bounds;
  arguments.createLeaf = make_leaf;
  arguments.buildProgress = is_wanted;
  arguments.userPtr = &work;
  // A library must not start threads in a host that did not ask for any: an arena with room for the caller alone needs none.
  // (Embree's own option "threads=1" slows all of the host's TBB meanwhile, and TBB starts a thread when that ends.)
  tbb::task_arena caller(1);
  const auto build = [&] { return static_cast<Built*>(caller.execute([&] { return rtcBuildBVH(&arguments); })); };
  Built* top = build();
  if (!top && work.has_memory && !wanted.is_abandoned() && rtcGetDeviceError(device.device) == RTC_ERROR_UNKNOWN) {
    // The tree is too deep. Where boxes have no area, as those of a line along an axis, all splits seem to cost the same.
    // Sorted along a curve the items give a tree that is less good to search, but never deep.
    work.blocks.clear();
    work.left = 0;
    arguments.buildQuality = RTC_BUILD_QUALITY_LOW;
    top = build();
  }
  if (wanted.is_abandoned()) throw Abandoned{};
  if (!top || !work.has_memory) throw std::bad_alloc();
  discard(primitives);

  wanted.begin_part(0.55, 0.5 * static_cast<double>(count));
  // From the leaves up.
  std::vector<std::pair<Built*, float>> order{{top, 0.0f}};
  size_t found = 0;
  for (size_t i = 0; i < order.size(); ++i) {
    Built& node = *order[i].first;
    found += node.count;
    for (int c = 0; c < 2 && node.count == 0; ++c) {
      if (!node.children[c]) throw std::bad_alloc();
      order.emplace_back(node.children[c], half_area(node.bounds[c]));
    }
  }
  if (found != count) throw std::bad_alloc();
  for (size_t i = order.size(); i-- > 0;) find_costs(*order[i].first, order[i].second, wanted);
  discard(order);

  items_.reserve(count);
  struct Task {
    const Built* built;
    uint32_t parent, child;  // where its number goes
    uint32_t depth;
  };
  std::vector<Task> tasks{{top, 0, 0, 0}};
  while (!tasks.empty()) {
    wanted.step();
    const Task task = tasks.back();
    tasks.pop_back();
    const Built& built = *task.built;
    uint32_t number;
    if (built.count > 0) {
      number = leaf_bit | static_cast<uint32_t>(leaves_.size());
      const auto begin = static_cast<uint32_t>(items_.size());
      items_.insert(items_.end(), built.items, built.items + built.count);
      leaves_.push_back({begin, static_cast<uint32_t>(items_.size())});
    } else {
      if (task.depth >= most_depth) fail(FS_ERROR_INTERNAL, "the tree of a shape is deeper than %u", most_depth);
      number = static_cast<uint32_t>(nodes_.size());
      Node& node = nodes_.emplace_back();
      Children children;
      children.add(built, {}, width - 1, true);
      node.filled = (1u << children.count) - 1;
      set_boxes(node, children);
      // The first child is taken next, so it stands beside its parent.
      for (uint32_t i = children.count; i-- > 0;) tasks.push_back({children.nodes[i], number, i, task.depth + 1});
    }
    if (task.depth > 0) nodes_[task.parent].child[task.child] = number;
  }
  nodes_.shrink_to_fit();
}

void WideTree::forget_items() {
  discard(leaves_);
  discard(items_);
}

}  // namespace fs
