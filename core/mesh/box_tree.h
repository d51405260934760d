// Which boxes meet: a bounding-volume tree over axis-aligned boxes in the plane.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

struct Box {
  Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity());
  Vec2 high = Vec2::Constant(-std::numeric_limits<double>::infinity());

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
};

// Constant after construction: O(n). Empty boxes meet nothing. Finds nothing if that was interrupted.
class BoxTree {
 public:
  explicit BoxTree(std::vector<Box> boxes, const Execution& execution = {});

  // Calls visit(i) for every box that meets `box`, until it returns false. Returns whether all were visited.
  // Thread-safe.
  bool ForEachMeeting(const Box& box, const std::function<bool(std::int32_t)>& visit) const;

  const std::vector<Box>& boxes() const { return boxes_; }

 private:
  static constexpr std::int32_t kLeafSize = 4;

  // Node i of a binary tree in an array has the children 2 i + 1 and 2 i + 2. The last `leaves_`, a power of two, are
  // leaves: leaf i has the boxes [kLeafSize i, kLeafSize (i + 1)) of order_, none if that is beyond its end.
  std::vector<Box> boxes_;
  std::vector<std::int32_t> order_;  // along a space-filling curve
  std::vector<Box> nodes_;
  std::int32_t leaves_ = 0;
};

}  // namespace planish
