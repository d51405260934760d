#include "core/unwrap/verify.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <optional>
#include <utility>

#include "core/mesh/box_tree.h"
#include "core/mesh/predicates.h"
#include "core/unwrap/outlines.h"

namespace planish {
namespace {

constexpr std::size_t kMaxNamed = 16;

Vec2 Uv(const CornerUv& uv, std::int32_t corner) {
  return {uv[2 * corner], uv[2 * corner + 1]};
}

}  // namespace

CornerUv RoundToFloat(const CornerUv& uv, const Execution& execution) {
  CornerUv rounded(uv.size());
  execution.For(static_cast<std::int64_t>(uv.size()), [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) rounded[i] = static_cast<double>(static_cast<float>(uv[i]));
  });
  return rounded;
}

OrientationFaults CheckOrientations(const CornerUv& uv, const Execution& execution, const std::vector<char>& ignored) {
  OrientationFaults faults;
  for (const OrientationFaults& part : execution.Collect<OrientationFaults>(
           static_cast<std::int64_t>(uv.size() / 6), [&](std::int64_t begin, std::int64_t end) {
             OrientationFaults chunk;
             for (auto f = static_cast<std::int32_t>(begin); f < end; ++f) {
               if (!ignored.empty() && ignored[f]) continue;
               const int orientation = Orientation(Uv(uv, 3 * f), Uv(uv, 3 * f + 1), Uv(uv, 3 * f + 2));
               if (orientation > 0) continue;
               ++(orientation < 0 ? chunk.flipped : chunk.degenerate);
               if (chunk.faces.size() < kMaxNamed) chunk.faces.push_back(f);
             }
             return chunk;
           })) {
    faults.flipped += part.flipped;
    faults.degenerate += part.degenerate;
    for (const std::int32_t f : part.faces) {
      if (faults.faces.size() < kMaxNamed) faults.faces.push_back(f);
    }
  }
  return faults;
}

namespace {

// Every triangle against all later ones.
class PairwiseCheck {
 public:
  PairwiseCheck(const CornerUv& uv, const std::vector<char>& ignored, const Execution& execution)
      : execution_(execution), num_faces_(static_cast<std::int32_t>(uv.size() / 6)), triangles_(num_faces_) {
    std::vector<Box> boxes(num_faces_);
    execution_.For(num_faces_, [&](std::int64_t begin, std::int64_t end) {
      for (auto f = static_cast<std::int32_t>(begin); f < end; ++f) {
        Triangle& t = triangles_[f];
        for (int k = 0; k < 3; ++k) {
          t[k] = Uv(uv, 3 * f + k);
          boxes[f].Add(t[k]);
        }
        const int sign = Orientation(t[0], t[1], t[2]);
        if (sign < 0) std::swap(t[1], t[2]);
        // Without an interior it meets nothing.
        if (sign == 0 || (!ignored.empty() && ignored[f])) boxes[f] = Box();
      }
    });
    tree_.emplace(std::move(boxes), execution_);
  }

  Overlaps Run() const {
    // Some faces at a time, so that counting can stop early with the same result for any team.
    constexpr std::int64_t kBlock = 64, kBlocks = 64;
    Overlaps all;
    for (std::int64_t begin = 0; begin < num_faces_; begin += kBlock * kBlocks) {
      const std::int64_t end = std::min<std::int64_t>(begin + kBlock * kBlocks, num_faces_);
      std::atomic<std::int64_t> count = all.pairs;
      std::array<std::vector<std::int32_t>, kBlocks> named;
      const auto look = [&](std::int64_t first, std::int64_t last) {
        for (std::int64_t i = first; i < last; ++i) {
          const std::int64_t from = std::min(begin + i * kBlock, end);
          Look(from, std::min(from + kBlock, end), &count, &named[i]);
        }
      };
      if (execution_.team != nullptr) {
        execution_.team->For(kBlocks, 1, look);
      } else {
        look(0, kBlocks);
      }
      all.pairs = std::min(count.load(), kMaxOverlaps);
      all.limited = all.pairs == kMaxOverlaps || execution_.IsStopped();
      if (all.limited) {
        // Blocks were cut short, who knows where.
        named = {};
        std::atomic<std::int64_t> enough = kMaxOverlaps - static_cast<std::int64_t>(kMaxNamed / 2);
        Look(begin, end, &enough, &named[0]);
      }
      for (const std::vector<std::int32_t>& faces : named) {
        for (const std::int32_t f : faces) {
          if (all.faces.size() < kMaxNamed) all.faces.push_back(f);
        }
      }
      if (all.limited) break;
    }
    return all;
  }

 private:
  using Triangle = std::array<Vec2, 3>;  // counter-clockwise

  // Counts the pairs of the faces in [begin, end), which go on from `count`, until kMaxOverlaps; names the first ones.
  void Look(std::int64_t begin, std::int64_t end, std::atomic<std::int64_t>* count,
            std::vector<std::int32_t>* named) const {
    for (auto f = static_cast<std::int32_t>(begin); f < end && !execution_.IsStopped(); ++f) {
      const Box& box = tree_->boxes()[f];
      if (!box.Meets(box)) continue;
      const bool go_on = tree_->ForEachMeeting(box, [&](std::int32_t g) {
        if (g <= f || !InteriorsMeet(triangles_[f].data(), triangles_[g].data())) return true;
        if (named->size() < kMaxNamed) named->insert(named->end(), {f, g});
        return count->fetch_add(1, std::memory_order_relaxed) + 1 < kMaxOverlaps;
      });
      if (!go_on || count->load(std::memory_order_relaxed) >= kMaxOverlaps) return;
    }
  }

  const Execution& execution_;
  const std::int32_t num_faces_;
  std::vector<Triangle> triangles_;
  std::optional<BoxTree> tree_;
};

}  // namespace

Overlaps CheckOverlaps(const std::vector<std::int32_t>& opposite, const CornerUv& uv,
                       const OrientationFaults& orientation, const Execution& execution,
                       const std::vector<char>& ignored) {
  const bool all_upright =
      orientation.flipped == 0 && orientation.degenerate == 0 &&
      (ignored.empty() || execution.Count(static_cast<std::int64_t>(ignored.size()), [&](std::int64_t f) {
        const auto c = static_cast<std::int32_t>(3 * f);
        return ignored[f] && Orientation(Uv(uv, c), Uv(uv, c + 1), Uv(uv, c + 2)) <= 0;
      }) == 0);
  if (all_upright && OutlinesAreApart(opposite, uv, execution)) return {};
  if (execution.IsStopped()) return {0, true, {}};
  const PairwiseCheck check(uv, ignored, execution);
  if (execution.IsStopped()) return {0, true, {}};
  return check.Run();
}

}  // namespace planish
