#include "core/mesh/box_tree.h"

#include <utility>

namespace planish {
namespace {

// Spreads the low 31 bits of x: puts a 0 before each.
std::uint64_t Spread(std::uint64_t x) {
  x = (x | x << 16) & 0x0000ffff0000ffff;
  x = (x | x << 8) & 0x00ff00ff00ff00ff;
  x = (x | x << 4) & 0x0f0f0f0f0f0f0f0f;
  x = (x | x << 2) & 0x3333333333333333;
  return (x | x << 1) & 0x5555555555555555;
}

// Half of the centre of a box, since the centre itself may overflow.
Vec2 HalfCentre(const Box& box) {
  return box.low / 4 + box.high / 4;
}

// The indices of the boxes in the order of a Z-curve through their centres.
std::vector<std::int32_t> InSpatialOrder(const std::vector<Box>& boxes, const Execution& execution) {
  const auto n = static_cast<std::int64_t>(boxes.size());
  const Box all = execution.SumUp<Box>(n, [&](std::int64_t i, Box* box) {
    if (boxes[i].Meets(boxes[i])) box->Add(HalfCentre(boxes[i]));
  });
  constexpr double kLastCell = (std::int64_t{1} << 31) - 1;
  const double extent = (all.high - all.low).maxCoeff(), scale = extent > 0 ? kLastCell / extent : 0;
  std::vector<KeyedIndex> entries(boxes.size());
  execution.ForEach(n, [&](std::int64_t i) {
    const bool is_empty = !boxes[i].Meets(boxes[i]);
    const Vec2 cell = is_empty ? Vec2(0, 0) : Vec2((HalfCentre(boxes[i]) - all.low) * scale);
    const std::uint64_t key =
        Spread(static_cast<std::uint64_t>(cell.x())) << 1 | Spread(static_cast<std::uint64_t>(cell.y()));
    entries[i] = {key, static_cast<std::int32_t>(i)};
  });
  if (execution.IsCancelled()) return {};
  SortByKey(&entries);
  std::vector<std::int32_t> order(boxes.size());
  for (std::int64_t i = 0; i < n; ++i) order[i] = entries[i].index;
  return order;
}

}  // namespace

BoxTree::BoxTree(std::vector<Box> boxes, const Execution& execution) : boxes_(std::move(boxes)) {
  if (boxes_.size() <= kFew) return;
  order_ = InSpatialOrder(boxes_, execution);
  if (execution.IsCancelled()) return;
  const auto n = static_cast<std::int64_t>(boxes_.size());
  std::int32_t leaves = 1;
  while (std::int64_t{kLeafSize} * leaves < n) leaves *= 2;
  std::vector<Box> nodes(2 * leaves - 1);
  execution.ForEach(leaves, [&](std::int64_t leaf) {
    for (std::int64_t i = kLeafSize * leaf; i < kLeafSize * (leaf + 1) && i < n; ++i) {
      nodes[leaves - 1 + leaf].Add(boxes_[order_[i]]);
    }
  });
  if (execution.IsCancelled()) return;
  for (std::int32_t i = leaves - 2; i >= 0; --i) {
    nodes[i].Add(nodes[2 * i + 1]);
    nodes[i].Add(nodes[2 * i + 2]);
  }
  leaves_ = leaves;
  nodes_ = std::move(nodes);
}

}  // namespace planish
