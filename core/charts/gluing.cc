#include "core/charts/gluing.h"

#include "core/mesh/half_edges.h"

namespace planish {

Gluing::Gluing(const Surface& surface) : surface_(&surface), opposite_(surface.across.size(), -1) {}

std::int32_t Gluing::After(std::int32_t c) const {
  return NextOnOutline(opposite_, c);
}

std::int32_t Gluing::Before(std::int32_t c) const {
  return PreviousOnOutline(opposite_, c);
}

double Gluing::OutlineAngle(std::int32_t c) const {
  double angle = 0;
  for (;;) {
    angle += surface_->angle[3 * (c / 3) + Prev(c % 3)];
    c = 3 * (c / 3) + Next(c % 3);
    if (opposite_[c] < 0) return angle;
    c = opposite_[c];
  }
}

void Gluing::Glue(std::int32_t c) {
  const std::int32_t d = surface_->across[c];
  opposite_[c] = d;
  opposite_[d] = c;
}

void Gluing::Unglue(std::int32_t c) {
  opposite_[opposite_[c]] = -1;
  opposite_[c] = -1;
}

void Gluing::Zip(std::int32_t c, std::vector<std::int32_t>* glued) {
  for (;;) {
    const std::int32_t after = After(c);
    if (surface_->across[c] != after) return;
    const std::int32_t before = Before(c), next = After(after);
    // Three or four edges would leave one or two.
    if (next == before || After(next) == before) return;
    Glue(c);
    glued->push_back(c);
    c = before;
  }
}

}  // namespace planish
