// A bounding-volume tree over axis-aligned boxes in the plane, to find boxes that intersect.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/base/execution.h"
#include "core/base/radix_sort.h"
#include "core/mesh/mesh.h"

namespace planish {

struct Box {
  Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity());
  Vec2 high = Vec2::Constant(-std::numeric_limits<double>::infinity());

  // The smallest box that holds a segment.
  static Box Around(const Vec2& a, const Vec2& b) { return {a.cwiseMin(b), a.cwiseMax(b)}; }

  void Add(const Vec2& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  void Add(const Box& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
  bool Meets(const Box& other) const {
    return (low.array() <= other.high.array()).all() && (other.low.array() <= high.array()).all();
  }
  bool Has(const Vec2& p) const { return Meets({p, p}); }
  // Larger by `reach` on every side.
  Box Grown(double reach) const { return {low - Vec2::Constant(reach), high + Vec2::Constant(reach)}; }
};

// Calls visit(a, b) once for every two boxes that are at most `reach` apart along both axes, from left to right. A
// sweep that compares all boxes with overlapping x ranges: for few boxes, or boxes spread out from left to right.
template <typename Visit>
void ForEachNearPair(const std::vector<Box>& boxes, double reach, const Visit& visit) {
  const std::vector<std::int32_t> order =
      SortedIndices(boxes.size(), [&](std::int32_t a, std::int32_t b) { return boxes[a].low.x() < boxes[b].low.x(); });
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Box& box = boxes[order[i]];
    for (std::size_t j = i + 1; j < order.size() && boxes[order[j]].low.x() <= box.high.x() + reach; ++j) {
      const Box& other = boxes[order[j]];
      if (other.low.y() > box.high.y() + reach || box.low.y() > other.high.y() + reach) continue;
      visit(order[i], order[j]);
    }
  }
}

// Constant after construction, which takes O(n). Empty boxes intersect nothing. After a cancelled construction the tree
// finds nothing.
class BoxTree {
 public:
  explicit BoxTree(std::vector<Box> boxes, const Execution& execution = {});

  // Calls visit(i) for every box that intersects `box`, until visit returns false. Returns whether all were visited.
  // Thread-safe.
  template <typename Visit>
  bool ForEachMeeting(const Box& box, const Visit& visit) const {
    if (boxes_.size() <= kFew) {
      for (std::int32_t i = 0; i < static_cast<std::int32_t>(boxes_.size()); ++i) {
        if (boxes_[i].Meets(box) && !visit(i)) return false;
      }
      return true;
    }
    if (nodes_.empty()) return true;
    // Depth first: the stack holds at most one node for each level, and one more.
    std::array<std::int32_t, 64> stack = {0};
    for (int top = 1; top > 0;) {
      const std::int32_t node = stack[--top];
      if (!nodes_[node].Meets(box)) continue;
      if (node < leaves_ - 1) {
        stack[top++] = 2 * node + 2;
        stack[top++] = 2 * node + 1;
        continue;
      }
      const std::size_t first = static_cast<std::size_t>(kLeafSize) * (node - leaves_ + 1);
      for (std::size_t i = first; i < first + kLeafSize && i < order_.size(); ++i) {
        if (boxes_[order_[i]].Meets(box) && !visit(order_[i])) return false;
      }
    }
    return true;
  }

  const std::vector<Box>& boxes() const { return boxes_; }

 private:
  static constexpr std::int32_t kLeafSize = 4;
  static constexpr std::size_t kFew = 24;  // up to this number, boxes are searched linearly, without a tree

  // Node i of a binary tree in an array has the children 2 i + 1 and 2 i + 2. The last `leaves_` nodes, a power of two,
  // are leaves. Leaf i has the boxes [kLeafSize i, kLeafSize (i + 1)) of order_, as far as these exist.
  std::vector<Box> boxes_;
  std::vector<std::int32_t> order_;  // along a space-filling curve
  std::vector<Box> nodes_;
  std::int32_t leaves_ = 0;
};

}  // namespace planish
