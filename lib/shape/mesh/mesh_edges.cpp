#include "shape/mesh/mesh_edges.h"

#include <algorithm>

namespace fs {

MeshEdges::MeshEdges(std::span<const uint32_t> corners, size_t vertex_count, StopToken& stop)
    : of_side(corners.size()), is_twin(corners.size() / 3) {
  struct Side {
    uint32_t other;  // the higher of its two vertices
    uint32_t number;
  };
  const auto for_each_side = [&](auto&& visit) {
    for (size_t t = 0; t + 2 < corners.size(); t += 3) {
      stop.check();
      const uint32_t v[3] = {corners[t], corners[t + 1], corners[t + 2]};
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t from = v[k], to = v[(k + 1) % 3];
        visit(std::min(from, to), Side{std::max(from, to), static_cast<uint32_t>(t + k)});
      }
    }
  };
  // A counting sort: begin[v] .. begin[v + 1] are the sides whose lower vertex is v.
  std::vector<uint32_t> begin(vertex_count + 2, 0);
  for_each_side([&](uint32_t low, Side) { ++begin[low + size_t{2}]; });
  for (size_t v = 2; v < begin.size(); ++v) begin[v] += begin[v - 1];
  std::vector<Side> sides(begin.back());
  for_each_side([&](uint32_t low, Side s) { sides[begin[low + size_t{1}]++] = s; });

  struct Candidate {
    uint64_t key;  // equal for triangles on this edge with the same vertices and orientation
    uint32_t triangle;
    bool runs_up() const { return key & 1; }  // from the lower vertex to the higher
  };
  std::vector<Candidate> candidates;
  const auto add_edge = [&](std::span<const Side> edge) {
    candidates.clear();
    size_t up = 0;
    for (const Side s : edge) {
      stop.check();
      of_side[s.number] = static_cast<uint32_t>(kinds.size());
      const uint32_t triangle = s.number / 3;
      if (is_collapsed(corners, triangle)) continue;
      const bool runs_up = corners[s.number] != s.other;
      up += runs_up;
      const uint64_t opposite = corners[size_t{3} * triangle + (s.number + 2 - 3 * triangle) % 3];
      candidates.push_back({opposite << 1 | runs_up, triangle});
    }
    const size_t count = candidates.size();
    open += count == 1;
    odd += count > 2 || (count == 2 && up != 1);
    if (count > 2) {
      std::sort(candidates.begin(), candidates.end(), [&](const Candidate& a, const Candidate& b) {
        stop.check();
        return a.key != b.key ? a.key < b.key : a.triangle < b.triangle;
      });
    }
    size_t different = count;
    for (size_t i = 1; i < count; ++i) {
      if (candidates[i].key != candidates[i - 1].key) continue;
      is_twin[candidates[i].triangle] = true;
      --different;
    }
    const bool is_regular = different == 2 && candidates.front().runs_up() != candidates.back().runs_up();
    kinds.push_back(count == 0 ? Kind::none : is_regular ? Kind::regular : Kind::irregular);
  };
  kinds.reserve(corners.size() / 2 + 1);  // as many as a closed mesh has
  for (size_t v = 0; v < vertex_count; ++v) {
    Side* first = sides.data() + begin[v];
    Side* const last = sides.data() + begin[v + 1];
    std::sort(first, last, [&](Side a, Side b) {
      stop.check();
      return a.other != b.other ? a.other < b.other : a.number < b.number;
    });
    stop.check();
    while (first != last) {
      Side* end = first + 1;
      while (end != last && end->other == first->other) ++end;
      add_edge({first, end});
      first = end;
    }
  }
}

}  // namespace fs
