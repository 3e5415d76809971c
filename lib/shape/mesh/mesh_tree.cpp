#include "shape/mesh/mesh_tree.h"

namespace fs {
namespace {

LocalFrame frame_of(std::span<const Vec3> points, std::span<const uint32_t> corners, StopToken& stop) {
  stop.begin_part(0.01, static_cast<double>(corners.size()));
  Box box;
  for (const uint32_t i : corners) {
    stop.check();
    box.add(points[i]);
  }
  return LocalFrame(box);
}

std::vector<Box> boxes_of(std::span<const Vec3> points, std::span<const uint32_t> corners, const LocalFrame& frame,
                          StopToken& stop) {
  stop.begin_part(0.11, 1.35 * static_cast<double>(corners.size()));  // with the start of the tree
  std::vector<Box> boxes(corners.size() / 3);
  for (size_t i = 0; i < corners.size(); ++i) {
    stop.check();
    boxes[i / 3].add(frame.local(points[corners[i]]));
  }
  return boxes;
}

}  // namespace

MeshTree::MeshTree(std::span<const Vec3> points, std::span<const uint32_t> corners, std::unique_ptr<MeshEdges> edges,
                   const MeshParts& parts, StopToken& stop)
    : points_(points), corners_(corners), frame_(frame_of(points, corners, stop)),
      tree_(boxes_of(points, corners, frame_, stop), stop), normals_(points, corners, std::move(edges), stop) {
  stop.begin_part(1, 3 * static_cast<double>(tree_.leaves().size()));
  std::vector<Vec3> places;  // of the corners, in the order of the leaves
  places.reserve(corners.size());
  for (const uint32_t triangle : tree_.items()) {
    stop.check();
    for (int k = 0; k < 3; ++k) places.push_back(frame_.local(points[corners[size_t{3} * triangle + k]]));
  }
  tree_.add_discs(places, stop);
  packets_.reserve(tree_.leaves().size());
  for (const WideTree::Leaf leaf : tree_.leaves()) {
    stop.check();
    packets_.emplace_back(tree_.items().data() + leaf.begin, places.data() + size_t{3} * leaf.begin, leaf.end - leaf.begin);
  }
  tree_.forget_items();
  StopToken rest = stop;  // nobody is shown how far that is
  rest.show(nullptr);
  if (std::unique_ptr<MeshUnion> whole = MeshUnion::of(*this, points, corners, parts, rest)) build_union(std::move(whole), rest);
}

void MeshTree::build_union(std::unique_ptr<MeshUnion> whole, StopToken& stop) {
  MeshUnion& made = *whole;
  union_ = std::move(whole);
  std::vector<uint32_t> items;
  for (uint32_t i = 0; i < triangle_count(); ++i) {
    if (made.counts[i]) items.push_back(i);
  }
  for (uint32_t i = 0; i < made.pieces.size(); ++i) items.push_back(triangle_count() + i);
  std::vector<Box> boxes(items.size());
  for (size_t i = 0; i < items.size(); ++i) {
    for (int k = 0; k < 3; ++k) boxes[i].add(frame_.local(corner(items[i], k)));
  }
  made.tree = WideTree(std::move(boxes), stop);
  std::vector<uint32_t> numbers;  // in the order of the leaves
  std::vector<Vec3> places;
  for (const uint32_t i : made.tree.items()) {
    numbers.push_back(items[i]);
    for (int k = 0; k < 3; ++k) places.push_back(frame_.local(corner(items[i], k)));
  }
  made.tree.add_discs(places, stop);
  for (const WideTree::Leaf leaf : made.tree.leaves()) {
    made.packets.emplace_back(numbers.data() + leaf.begin, places.data() + size_t{3} * leaf.begin, leaf.end - leaf.begin);
  }
  made.tree.forget_items();
}

size_t MeshTree::size() const noexcept {
  size_t out = tree_.size() + packets_.size() * sizeof(Packet) + normals_.size();
  if (union_) {
    out += union_->tree.size() + union_->packets.size() * sizeof(Packet) + union_->pieces.size() * sizeof(MeshUnion::Piece) +
           (union_->counts.size() + union_->is_met.size() + union_->is_inward.size()) / 8;
  }
  return out;
}

}  // namespace fs
