// Gluing parts of borders: two charts become one, and the rest of their border becomes a dart, a slit into that chart.
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "core/unwrap/seam_search.h"

namespace planish {

// Tries parts that begin at either end of the border, or have the same middle as a border that crosses the mirror
// plane. The longer the part, the more the chart is stretched. A dart ends at the most curved vertex nearby, where it
// opens most.
std::optional<Segmentation::Joint> SeamSearch::BestPart(const Segmentation::Joint& joint) {
  enum class From { kStart, kEnd, kMiddle };
  constexpr int kTrials = 2;  // from each end; with 3, seams are no shorter
  const Gluing& gluing = segmentation_.gluing();
  const std::vector<HalfedgeHandle>& border = joint.border;
  const std::int64_t all = std::ssize(border);
  const auto angle_before = [&](std::int64_t i) {
    return gluing.OutlineAngle(border[i - 1]) + gluing.OutlineAngle(gluing.mesh().opposite_halfedge_handle(border[i]));
  };
  const bool crosses = ImageOf(joint.chart) == joint.chart && ImageOf(joint.other) == joint.other;
  double most = 0;
  std::optional<Segmentation::Joint> best;
  for (const From from : {From::kStart, From::kEnd, From::kMiddle}) {
    if ((from == From::kMiddle) != crosses) continue;
    std::int64_t shorter = 0, longer = all;
    for (int trial = 0; trial < kTrials && longer - shorter > 1; ++trial) {
      std::int64_t length = (shorter + longer) / 2;
      if (from == From::kMiddle) {
        length -= (all - length) % 2;
      } else {
        const std::int64_t reach = std::max<std::int64_t>(0, (longer - shorter) / 4 - 1);
        double least = std::numeric_limits<double>::infinity();
        for (std::int64_t i = (shorter + longer) / 2 - reach; i <= (shorter + longer) / 2 + reach; ++i) {
          const double angle = angle_before(from == From::kStart ? i : all - i);
          if (!(angle < least)) continue;
          least = angle;
          length = i;
        }
      }
      if (length <= shorter) break;
      const std::int64_t begin = from == From::kStart ? 0 : from == From::kEnd ? all - length : (all - length) / 2;
      Segmentation::Joint part = {joint.chart, joint.other, {border.begin() + begin, border.begin() + begin + length}};
      part.is_part = true;
      const std::optional<double> gain = Try(part, std::numeric_limits<double>::infinity());
      (gain && *gain > 0 ? shorter : longer) = length;
      if (!gain || !(*gain > most)) continue;
      most = *gain;
      best = std::move(part);
    }
  }
  return most >= kWorthIt ? best : std::nullopt;
}

double SeamSearch::SewDarts() {
  constexpr double kLeastCost = 0.05;     // of a border
  constexpr std::size_t kLeastEdges = 4;  // the same
  struct Whole {
    double cost;
    Segmentation::Joint joint;
  };
  std::vector<Whole> borders;
  for (std::int32_t i = 0; i < count(); ++i) {
    if (segmentation_.charts()[i].empty()) continue;
    std::vector<HalfedgeHandle> outline = segmentation_.Outline(i);
    for (const auto& [border, other] : BordersAlong(segmentation_.gluing(), segmentation_.chart(), &outline)) {
      if (other < i || IsImage(i, other) || border.size() < kLeastEdges) continue;
      const double cost = cost_.OfPath(border);
      if (cost >= kLeastCost) borders.push_back({cost, {i, other, {border.begin(), border.end()}}});
    }
  }
  std::stable_sort(borders.begin(), borders.end(), [](const Whole& a, const Whole& b) { return a.cost > b.cost; });
  const double of_later_rounds = dart_left_ - dart_left_ / (tuning_.seam_rounds - round_);
  dart_left_ -= of_later_rounds;
  std::swap(glue_left_, dart_left_);  // Try() counts in glue_left_
  double gained = 0;
  std::vector<char> has_changed(count(), 0);
  for (const Whole& border : borders) {
    if (glue_left_ <= 0 || !GoesOn()) break;
    Tell();
    const std::int32_t i = border.joint.chart, j = border.joint.other;
    if (has_changed[i] != 0 || has_changed[j] != 0) continue;
    const std::array<std::int32_t, 4> charts = {i, j, ImageOf(i), ImageOf(j)};
    const std::optional<Segmentation::Joint> part = BestPart(border.joint);
    const std::optional<double> gain = part ? Try(*part, kWorthIt) : std::nullopt;
    if (!gain || !(*gain >= kWorthIt)) continue;
    gained += *gain;
    for (const std::int32_t k : charts) {
      if (k >= 0) has_changed[k] = 1;
    }
  }
  std::swap(glue_left_, dart_left_);
  dart_left_ += of_later_rounds;
  return gained;
}

}  // namespace planish
