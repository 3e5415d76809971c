#include "force/wide_tree.h"

#include <memory>
#include <new>

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "base/error.h"

namespace fs {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

// Rounded outwards.
float below(double v) {
  const float f = static_cast<float>(v);
  return f <= v ? f : std::nextafter(f, -infinity);
}
float above(double v) { return -below(-v); }

// What the builder makes, before it is packed. In memory of the builder's.
struct Built {
  uint32_t count;                      // children; of a leaf: items
  bool is_leaf;
  uint32_t items[WideTree::width];     // of a leaf
  Built* children[WideTree::width];
  RTCBounds bounds[WideTree::width];   // of the children
};

// The builder's memory and what it has met.
struct Work {
  Wanted& wanted;
  size_t nodes = 0, leaves = 0;
  bool has_memory = true;

  Built* make(RTCThreadLocalAllocator allocator, size_t count, bool is_leaf) {
    auto* const out = static_cast<Built*>(rtcThreadLocalAlloc(allocator, sizeof(Built), alignof(Built)));
    if (!out) {
      has_memory = false;
      return nullptr;
    }
    out->count = static_cast<uint32_t>(count);
    out->is_leaf = is_leaf;
    ++(is_leaf ? leaves : nodes);
    return out;
  }
};

void* make_node(RTCThreadLocalAllocator allocator, unsigned count, void* work) {
  return static_cast<Work*>(work)->make(allocator, count, false);
}
void set_children(void* node, void** children, unsigned count, void*) {
  for (unsigned i = 0; i < count && node; ++i) static_cast<Built*>(node)->children[i] = static_cast<Built*>(children[i]);
}
void set_bounds(void* node, const RTCBounds** bounds, unsigned count, void*) {
  for (unsigned i = 0; i < count && node; ++i) static_cast<Built*>(node)->bounds[i] = *bounds[i];
}
void* make_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* items, size_t count, void* work) {
  Built* const leaf = static_cast<Work*>(work)->make(allocator, count, true);
  for (size_t i = 0; i < count && leaf; ++i) leaf->items[i] = items[i].primID;
  return leaf;
}
bool is_wanted(void* work, double) {
  const Work& w = *static_cast<Work*>(work);
  return w.has_memory && !w.wanted.is_abandoned();
}

struct Device {
  // One thread, the caller's: a library must not start threads in a host that did not ask for any.
  RTCDevice device = rtcNewDevice("threads=1");
  RTCBVH bvh = device ? rtcNewBVH(device) : nullptr;
  ~Device() {
    if (bvh) rtcReleaseBVH(bvh);
    if (device) rtcReleaseDevice(device);
  }
};

// The boxes of a node's children on its grid, never smaller than they are.
void set_boxes(WideTree::Node& node, const Built& built) {
  const auto lower = [&](uint32_t i, int axis) { return double{(&built.bounds[i].lower_x)[axis]}; };
  const auto upper = [&](uint32_t i, int axis) { return double{(&built.bounds[i].upper_x)[axis]}; };
  double size = std::numeric_limits<float>::min();  // so that a step is never 0
  for (int axis = 0; axis < 3; ++axis) {
    double least = infinity, most = -infinity;
    for (uint32_t i = 0; i < built.count; ++i) {
      least = std::min(least, lower(i, axis));
      most = std::max(most, upper(i, axis));
    }
    node.origin[axis] = static_cast<float>(least);
    size = std::max(size, most - least);
  }
  node.step = above(size / 255 * (1 + 1e-6));
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

}  // namespace

WideTree::WideTree(const std::vector<Box>& boxes, Wanted& wanted) {
  if (boxes.size() <= width) {
    for (uint32_t i = 0; i < boxes.size(); ++i) items_.push_back(i);
    leaves_.push_back({0, static_cast<uint32_t>(boxes.size())});
    return;
  }
  std::vector<RTCBuildPrimitive> primitives;
  primitives.reserve(boxes.size());
  for (const Box& b : boxes) {
    wanted.step();
    primitives.push_back({below(b.lower.x), below(b.lower.y), below(b.lower.z), 0, above(b.upper.x), above(b.upper.y),
                          above(b.upper.z), static_cast<unsigned>(primitives.size())});
  }
  Work work{wanted};
  const Device device;
  if (!device.bvh) throw std::bad_alloc();
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.maxBranchingFactor = width;
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
  const auto* const top = static_cast<const Built*>(rtcBuildBVH(&arguments));
  if (wanted.is_abandoned()) throw Abandoned{};
  if (!top || !work.has_memory) throw std::bad_alloc();
  primitives = {};

  nodes_.reserve(work.nodes);
  leaves_.reserve(work.leaves);
  items_.reserve(boxes.size());
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
    if (built.is_leaf) {
      number = leaf_bit | static_cast<uint32_t>(leaves_.size());
      const auto begin = static_cast<uint32_t>(items_.size());
      items_.insert(items_.end(), built.items, built.items + built.count);
      leaves_.push_back({begin, static_cast<uint32_t>(items_.size())});
    } else {
      if (task.depth >= most_depth) fail(FS_ERROR_INTERNAL, "the tree of a shape is deeper than %u", most_depth);
      number = static_cast<uint32_t>(nodes_.size());
      Node& node = nodes_.emplace_back();
      node.filled = (1u << built.count) - 1;
      set_boxes(node, built);
      // The first child is taken next, so it stands beside its parent.
      for (uint32_t i = built.count; i-- > 0;) tasks.push_back({built.children[i], number, i, task.depth + 1});
    }
    if (task.depth > 0) nodes_[task.parent].child[task.child] = number;
  }
}

}  // namespace fs
