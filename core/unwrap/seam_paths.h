// Seams as paths over a surface, and the search for cheaper paths.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/charts/seam_cost.h"
#include "core/charts/segmentation.h"

namespace planish {

// Half-edges of one chart that follow each other, with a chart on the other side, which may be the same one. At the
// vertices between them no other seam ends.
struct SeamPath {
  std::vector<HalfedgeHandle> half_edges;
  bool is_loop = false;  // meets no other seam and no boundary
  bool slides = true;    // both ends may be moved along other seams
};

// All seams. Every edge between two charts, or of a slit, is in one path. Paths are in the order of their lowest edges.
std::vector<SeamPath> SeamPaths(const Segmentation& segmentation);

// Whether these half-edges still are a path.
bool IsPath(const Gluing& gluing, std::span<const HalfedgeHandle> path);

// Finds cheaper ways for seams. Not thread-safe.
class SeamRouter {
 public:
  // All arguments must outlive this.
  SeamRouter(const Segmentation& segmentation, const SeamCost& cost, const AtlasTuning& tuning);

  // The cheapest way (SeamCost::OfPath()) between the two ends of a path, or of part of one, through the two charts
  // beside it; nullopt if it is no cheaper than the path. The way stays within `band` edges of the path. If it
  // `slides`, its ends may move along the outlines of the two charts.
  std::optional<std::vector<HalfedgeHandle>> Reroute(std::span<const HalfedgeHandle> path, bool slides, int band);

 private:
  enum class Role : char { kNone, kPath, kStart, kEnd };

  bool IsOnPath(HalfedgeHandle h) const;
  void MarkEnds(std::span<const HalfedgeHandle> path, double reach);
  void MarkBand(std::span<const HalfedgeHandle> path, int band);
  void Mark(VertexHandle v, Role role);

  const Segmentation& segmentation_;
  const SeamCost& cost_;
  const AtlasTuning& tuning_;
  // Per vertex: its role, and its number of edges from the path. kNone and -1 except in touched_, which is empty
  // between calls.
  std::vector<Role> role_;
  std::vector<std::int32_t> ring_;
  std::vector<VertexHandle> touched_, starts_;
  std::vector<char> is_on_path_;  // per edge
  // Per half-edge: the cheapest way that ends with it.
  std::vector<double> so_far_;
  std::vector<HalfedgeHandle> before_;
  std::vector<HalfedgeHandle> reached_;
};

}  // namespace planish
