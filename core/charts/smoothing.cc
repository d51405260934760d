#include "core/charts/smoothing.h"

#include <algorithm>

namespace planish {
namespace {

constexpr int kSweeps = 40;
constexpr double kBendFactor = 0.1;  // of an edge's length where the surface bends by a right angle or more

class Smoothing {
 public:
  Smoothing(Gluing* gluing, std::vector<std::int32_t>* chart)
      : surface_(gluing->surface()), gluing_(*gluing), chart_(*chart) {}

  void Run(const Execution& execution) {
    std::vector<std::int32_t> faces, next;
    for (std::int32_t f = 0; f < surface_.num_faces(); ++f) {
      if (chart_[f] >= 0 && MayMove(f)) faces.push_back(f);
    }
    std::vector<char> queued(surface_.num_faces(), 0);
    for (int sweep = 0; sweep < kSweeps && !faces.empty() && !execution.IsStopped(); ++sweep) {
      next.clear();
      for (const std::int32_t f : faces) {
        if (!Move(f)) continue;
        for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
          const std::int32_t o = surface_.across[c];
          if (o < 0 || queued[o / 3]) continue;
          queued[o / 3] = 1;
          next.push_back(o / 3);
        }
      }
      for (const std::int32_t f : next) queued[f] = 0;
      std::sort(next.begin(), next.end());
      faces.swap(next);
    }
  }

 private:
  double Cost(std::int32_t c) const {
    return surface_.length(c) * (1 - (1 - kBendFactor) * std::clamp(1 - surface_.bend_cosine(c), 0.0, 1.0));
  }

  // The corner of a face that is glued by the edge it faces alone; -1 if it is not so.
  std::int32_t FreeCorner(std::int32_t f) const {
    std::int32_t corner = -1;
    for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
      if (gluing_.IsOutline(c)) continue;
      if (corner >= 0) return -1;
      corner = c;
    }
    return corner;
  }
  bool MayMove(std::int32_t f) const { return FreeCorner(f) >= 0; }

  bool Move(std::int32_t f) {
    constexpr double kGain = 1e-6;
    const std::int32_t glued = FreeCorner(f);
    if (glued < 0 || surface_.is_uncut(glued)) return false;
    // Along the outline: `first`, then `second`; on the other side `after` follows `before`.
    const std::int32_t k = glued % 3, first = 3 * f + Next(k), second = 3 * f + Prev(k);
    const std::int32_t before = surface_.across[second], after = surface_.across[first];
    if (before < 0 || after < 0 || chart_[before / 3] < 0 || gluing_.After(before) != after) return false;
    if (before / 3 == f || after / 3 == f) return false;
    const std::int32_t next = gluing_.After(after), previous = gluing_.Before(before);
    if (next == previous) return false;  // would leave an outline of two edges
    const double cost = Cost(first) + Cost(second);
    if (!(Cost(glued) < (1 - kGain) * cost)) return false;
    const std::int32_t neighbour = gluing_.opposite()[glued];
    gluing_.Unglue(glued);
    gluing_.Glue(first);
    gluing_.Glue(second);
    if (gluing_.OutlineAngle(glued) > kWidest || gluing_.OutlineAngle(gluing_.Before(glued)) > kWidest) {
      gluing_.Unglue(first);
      gluing_.Unglue(second);
      gluing_.Glue(glued);
      return false;
    }
    chart_[f] = chart_[before / 3];
    // Next to the end of a slit its sides may have come together.
    zipped_.clear();
    if (chart_[neighbour / 3] == chart_[f]) {
      gluing_.Zip(glued, &zipped_);
      if (gluing_.IsOutline(previous)) gluing_.Zip(previous, &zipped_);
    }
    return true;
  }

  const Surface& surface_;
  Gluing& gluing_;
  std::vector<std::int32_t>& chart_;
  std::vector<std::int32_t> zipped_;
};

}  // namespace

void SmoothOutlines(const Execution& execution, Gluing* gluing, std::vector<std::int32_t>* chart) {
  Smoothing(gluing, chart).Run(execution);
}

}  // namespace planish
