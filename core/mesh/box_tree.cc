#include "core/mesh/box_tree.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace planish {

BoxTree::BoxTree(std::vector<Box> boxes) : boxes_(std::move(boxes)), order_(boxes_.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  if (!order_.empty()) Build(0, static_cast<std::int32_t>(order_.size()));
}

void BoxTree::Build(std::int32_t begin, std::int32_t end) {
  constexpr std::int32_t kLeafSize = 4;
  Node node = {Box(), begin, end, -1};
  for (std::int32_t i = begin; i < end; ++i) {
    node.box.Add(boxes_[order_[i]].low);
    node.box.Add(boxes_[order_[i]].high);
  }
  const std::size_t index = nodes_.size();
  nodes_.push_back(node);
  if (end - begin <= kLeafSize) return;
  const Vec2 extent = node.box.high - node.box.low;
  const int axis = extent.x() >= extent.y() ? 0 : 1;
  const std::int32_t middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](std::int32_t a, std::int32_t b) {
                     return std::pair(boxes_[a].low[axis] + boxes_[a].high[axis], a) <
                            std::pair(boxes_[b].low[axis] + boxes_[b].high[axis], b);
                   });
  Build(begin, middle);
  nodes_[index].right = static_cast<std::int32_t>(nodes_.size());
  Build(middle, end);
}

bool BoxTree::ForEachMeeting(const Box& box, const std::function<bool(std::int32_t)>& visit) const {
  if (nodes_.empty()) return true;
  std::vector<std::int32_t> stack = {0};
  while (!stack.empty()) {
    const std::int32_t n = stack.back();
    stack.pop_back();
    const Node& node = nodes_[n];
    if (!node.box.Meets(box)) continue;
    if (node.right >= 0) {
      stack.push_back(n + 1);
      stack.push_back(node.right);
      continue;
    }
    for (std::int32_t i = node.begin; i < node.end; ++i) {
      if (boxes_[order_[i]].Meets(box) && !visit(order_[i])) return false;
    }
  }
  return true;
}

}  // namespace planish
