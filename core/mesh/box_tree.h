// Which boxes meet: a bounding-volume tree over axis-aligned boxes in the plane.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

struct Box {
  Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity());
  Vec2 high = Vec2::Constant(-std::numeric_limits<double>::infinity());

  void Add(const Vec2& p) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  bool Meets(const Box& other) const {
    return (low.array() <= other.high.array()).all() && (other.low.array() <= high.array()).all();
  }
};

// Constant after construction: O(n log n).
class BoxTree {
 public:
  explicit BoxTree(std::vector<Box> boxes);

  // Calls visit(i) for every box that meets `box`, until it returns false. Returns whether all were visited.
  bool ForEachMeeting(const Box& box, const std::function<bool(std::int32_t)>& visit) const;

 private:
  struct Node {
    Box box;
    std::int32_t begin, end;  // range of order_
    std::int32_t right;       // the left child follows its parent; -1 in a leaf
  };

  void Build(std::int32_t begin, std::int32_t end);

  std::vector<Box> boxes_;
  std::vector<std::int32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace planish
