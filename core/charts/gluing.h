// Discs made of faces: which half-edges are glued to the one across, and the way along a disc's outline.
//
// Every piece is a disc at any time. Two discs glued along one connected stretch of their outlines are a disc again,
// and so is one that is zipped up from the end of a slit. Nothing else is ever glued, so closed surfaces, handles,
// holes and one-sided surfaces need no cases of their own: they end as discs with seams in the right places.
#pragma once

#include <cstdint>
#include <numbers>
#include <vector>

#include "core/charts/surface.h"

namespace planish {

// No vertex of an outline should open wider, radians: next to a saddle a disc with 2 pi and more there would run over
// itself when it is flattened.
inline constexpr double kWidest = 1.85 * std::numbers::pi;

class Gluing {
 public:
  // Every face by itself. `surface` must outlive this.
  explicit Gluing(const Surface& surface);

  const Surface& surface() const { return *surface_; }
  // Per half-edge: the one it is glued to; -1 on an outline.
  const std::vector<std::int32_t>& opposite() const { return opposite_; }
  bool IsOutline(std::int32_t c) const { return opposite_[c] < 0; }

  // The outline half-edge that starts where outline half-edge c ends, and the one that ends where it starts.
  std::int32_t After(std::int32_t c) const;
  std::int32_t Before(std::int32_t c) const;

  // Sum of the angles of the faces round the vertex where outline half-edge c ends, radians.
  double OutlineAngle(std::int32_t c) const;

  // Glues c, which must have a half-edge across, to that one.
  void Glue(std::int32_t c);
  void Unglue(std::int32_t c);

  // Glues outline half-edges c and After(c) if they are the two sides of one edge, and goes on with what is then next
  // to each other; leaves an outline of at least three edges. Those glued are appended to `glued`, one of each pair.
  void Zip(std::int32_t c, std::vector<std::int32_t>* glued);

 private:
  const Surface* surface_;
  std::vector<std::int32_t> opposite_;
};

}  // namespace planish
