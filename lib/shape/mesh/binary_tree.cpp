#include "shape/mesh/binary_tree.h"

#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <new>
#include <thread>

#if FORCESERVER_EMBREE >= 4  // what CMake found
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <tbb/task_arena.h>

#include "base/error.h"

namespace fs {
namespace {

// A thread that is inside of Embree. When the process ends, Embree's static objects are destroyed, also under a thread of the
// application that still builds. Ours go before them, because this library needs Embree: so there those who are inside
// give up, and nobody else comes in.
class Inside {
 public:
  Inside() {
    ++count;
    if (!is_process_ending) return;
    --count;
    fail();
  }
  ~Inside() { --count; }
  Inside(const Inside&) = delete;
  Inside& operator=(const Inside&) = delete;

  static bool is_over() noexcept { return is_process_ending; }
  [[noreturn]] static void fail() { fs::fail(FS_ERROR_STATE, "the process is ending: no mesh is built any more"); }

 private:
  static inline std::atomic<bool> is_process_ending{false};
  static inline std::atomic<int> count{0};
  [[maybe_unused]] static inline const int is_watching = pthread_atfork(nullptr, nullptr, [] { count = 0; });
  static inline const struct End {
    ~End() {
      is_process_ending = true;
      constexpr int most = 5000;  // ms, should one hang
      for (int ms = 0; count > 0 && ms < most; ++ms) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  } end;
};

using BuiltNode = BinaryTree::Node;

// What Embree's calls back need.
struct BinaryBuild {
  StopToken& stop;
  BinaryTree::Memory& memory;
  bool has_memory = true;
  double done = 0;  // of the build, 0..1

  BuiltNode* make(size_t count) noexcept {
    BuiltNode* const out = memory.make(count);
    if (!out) has_memory = false;
    return out;
  }
};

void* make_node(RTCThreadLocalAllocator, unsigned, void* build) { return static_cast<BinaryBuild*>(build)->make(0); }
void set_children(void* node, void** children, unsigned count, void*) {
  for (unsigned i = 0; i < count && node; ++i) {
    static_cast<BuiltNode*>(node)->children[i] = static_cast<BuiltNode*>(children[i]);
  }
}
void set_boxes(void* node, const RTCBounds** boxes, unsigned count, void*) {
  for (unsigned i = 0; i < count && node; ++i) {
    const RTCBounds& b = *boxes[i];
    static_cast<BuiltNode*>(node)->boxes[i] = {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}};
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
  b.stop.show_part(b.done);
  return b.has_memory && !b.stop.is_stopped() && !Inside::is_over();
}

struct TreeBuilder {
  // Without its cache of tessellations, which is not needed: where the memory for it (128 MB) cannot be had, Embree leaves
  // that locked, and waits for it without end when the next device is made or released.
  RTCDevice device = rtcNewDevice("ignore_config_files=1,tessellation_cache_size=0");
  RTCBVH bvh = device ? rtcNewBVH(device) : nullptr;
  ~TreeBuilder() {
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

BinaryTree::BinaryTree(std::vector<Box> boxes, StopToken& stop) : item_count_(boxes.size()) {
  std::vector<RTCBuildPrimitive> primitives;
  primitives.reserve(boxes.size());
  for (const Box& b : boxes) {
    stop.check();
    primitives.push_back({rounded_below(b.lower.x), rounded_below(b.lower.y), rounded_below(b.lower.z), 0,
                          rounded_above(b.upper.x), rounded_above(b.upper.y), rounded_above(b.upper.z),
                          static_cast<unsigned>(primitives.size())});
  }
  std::vector<Box>().swap(boxes);  // an assignment of {} would keep the memory
  stop.begin_part(0.45, std::numeric_limits<double>::infinity());  // Embree says how far it is
  BinaryBuild work{stop, memory_};
  const Inside inside;
  const TreeBuilder builder;
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
  arguments.setNodeBounds = set_boxes;
  arguments.createLeaf = make_leaf;
  arguments.buildProgress = goes_on;
  arguments.userPtr = &work;
  // A library must not start threads in a host that did not ask for any: an arena with room for the caller alone needs none.
  // (Embree's own option "threads=1" slows all of the host's TBB meanwhile, and TBB starts a thread when that ends.)
  tbb::task_arena caller(1);
  const auto build = [&] { return static_cast<Node*>(caller.execute([&] { return rtcBuildBVH(&arguments); })); };
  top_ = build();
  const bool is_wanted = work.has_memory && !stop.is_stopped() && !Inside::is_over();
  if (!top_ && is_wanted && rtcGetDeviceError(builder.device) == RTC_ERROR_UNKNOWN) {
    // The tree is too deep. Where boxes have no area, as those of a line along an axis, all splits seem to cost the same.
    // Sorted along a curve the items give a tree that is less good to search, but never deep.
    memory_.clear();
    arguments.buildQuality = RTC_BUILD_QUALITY_LOW;
    top_ = build();
  }
  if (stop.is_stopped()) throw Stopped{};
  if (!top_ && Inside::is_over()) Inside::fail();
  if (!top_ || !work.has_memory) throw std::bad_alloc();
}

}  // namespace fs
