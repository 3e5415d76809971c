#include "force/binary_tree.h"

#include <algorithm>
#include <limits>
#include <new>

#if FORCESERVER_EMBREE >= 4  // what CMake found
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <tbb/task_arena.h>

namespace fs {
namespace {

using BuiltNode = BinaryTree::Node;

// What Embree's calls back need.
struct BinaryBuild {
  Wanted& wanted;
  BinaryTree::Memory& memory;
  bool has_memory = true;
  double done = 0;  // of the build, 0..1

  BuiltNode* make(size_t count) noexcept {
    BuiltNode* const out = memory.make(count);
    if (!out) has_memory = false;
    return out;
  }
};

void* make_node(RTCThreadLocalAllocator, unsigned, void* build) {
  return static_cast<BinaryBuild*>(build)->make(0);
}
void set_children(void* node, void** children, unsigned count, void*) {
  for (unsigned i = 0; i < count && node; ++i) {
    static_cast<BuiltNode*>(node)->children[i] = static_cast<BuiltNode*>(children[i]);
  }
}
void set_bounds(void* node, const RTCBounds** bounds, unsigned count, void*) {
  for (unsigned i = 0; i < count && node; ++i) {
    const RTCBounds& b = *bounds[i];
    static_cast<BuiltNode*>(node)->bounds[i] = {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}};
  }
}
void* make_leaf(RTCThreadLocalAllocator, const RTCBuildPrimitive* items, size_t count, void* build) {
  BuiltNode* const leaf = static_cast<BinaryBuild*>(build)->make(count);
  for (size_t i = 0; i < count && leaf; ++i) leaf->items[i] = items[i].primID;
  return leaf;
}
bool goes_on(void* build, double done) {
  BinaryBuild& b = *static_cast<BinaryBuild*>(build);
  b.done = std::max(b.done, done);
  b.wanted.show_part(b.done);
  return b.has_memory && !b.wanted.is_abandoned();
}

struct Builder {
  RTCDevice device = rtcNewDevice("ignore_config_files=1");
  RTCBVH bvh = device ? rtcNewBVH(device) : nullptr;
  ~Builder() {
    if (bvh) rtcReleaseBVH(bvh);
    if (device) rtcReleaseDevice(device);
  }
};

}  // namespace

BinaryTree::Node* BinaryTree::Memory::make(size_t count) noexcept {
  if (left_ == 0) {
    try {
      blocks_.push_back(std::make_unique_for_overwrite<Node[]>(block_size));
    } catch (const std::bad_alloc&) {
      return nullptr;
    }
    left_ = block_size;
  }
  Node* const out = &blocks_.back()[block_size - left_--];
  *out = {};
  out->count = static_cast<uint32_t>(count);
  return out;
}

void BinaryTree::Memory::clear() {
  blocks_.clear();
  left_ = 0;
}

BinaryTree::BinaryTree(std::vector<Box> boxes, Wanted& wanted) : item_count_(boxes.size()) {
  std::vector<RTCBuildPrimitive> primitives;
  primitives.reserve(boxes.size());
  for (const Box& b : boxes) {
    wanted.step();
    primitives.push_back({rounded_below(b.lower.x), rounded_below(b.lower.y), rounded_below(b.lower.z), 0,
                          rounded_above(b.upper.x), rounded_above(b.upper.y), rounded_above(b.upper.z),
                          static_cast<unsigned>(primitives.size())});
  }
  std::vector<Box>().swap(boxes);  // an assignment of {} would keep the memory
  wanted.begin_part(0.45, std::numeric_limits<double>::infinity());  // Embree says how far it is
  BinaryBuild work{wanted, memory_};
  const Builder builder;
  if (!builder.bvh) throw std::bad_alloc();
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.maxBranchingFactor = 2;
  arguments.maxDepth = 32;  // beyond it ranges are split in halves, so that WideTree::most_depth is never reached
  arguments.minLeafSize = arguments.maxLeafSize = leaf_size;  // as full as it gets
  arguments.sahBlockSize = leaf_size;                         // a leaf costs the same, however many items it has
  arguments.bvh = builder.bvh;
  arguments.primitives = primitives.data();
  arguments.primitiveCount = arguments.primitiveArrayCapacity = primitives.size();
  arguments.createNode = make_node;
  arguments.setNodeChildren = set_children;
  arguments.setNodeBounds = set_bounds;
  arguments.createLeaf = make_leaf;
  arguments.buildProgress = goes_on;
  arguments.userPtr = &work;
  // A library must not start threads in a host that did not ask for any: an arena with room for the caller alone needs none.
  // (Embree's own option "threads=1" slows all of the host's TBB meanwhile, and TBB starts a thread when that ends.)
  tbb::task_arena caller(1);
  const auto build = [&] { return static_cast<Node*>(caller.execute([&] { return rtcBuildBVH(&arguments); })); };
  top_ = build();
  if (!top_ && work.has_memory && !wanted.is_abandoned() && rtcGetDeviceError(builder.device) == RTC_ERROR_UNKNOWN) {
    // The tree is too deep. Where boxes have no area, as those of a line along an axis, all splits seem to cost the same.
    // Sorted along a curve the items give a tree that is less good to search, but never deep.
    memory_.clear();
    arguments.buildQuality = RTC_BUILD_QUALITY_LOW;
    top_ = build();
  }
  if (wanted.is_abandoned()) throw Abandoned{};
  if (!top_ || !work.has_memory) throw std::bad_alloc();
}

}  // namespace fs
