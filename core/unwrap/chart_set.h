// From a mesh to mapped charts: cutting, solving, and cutting again what did not come out well.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "core/base/execution.h"
#include "core/charts/segmentation.h"
#include "core/charts/surface.h"
#include "core/unwrap/chart.h"
#include "core/unwrap/unwrap.h"

namespace planish {

class ChartSet {
 public:
  // All must outlive this. `announce` is called at the start of every stage, from kCharts to kLayout, some of them
  // several times; it may return an error that ends the work.
  ChartSet(const Mesh& mesh, const UnwrapOptions& options, const UnwrapControl& control, const Execution& execution);

  // Charts and their maps. Errors as Unwrap(). Warnings are appended, wall-clock seconds added.
  absl::Status Make(std::vector<UnwrapWarning>* warnings, UnwrapSeconds* seconds);

  int count() const { return static_cast<int>(charts_.size()); }
  const Chart& chart(int i) const { return charts_[i]; }
  const ChartMap& map(int i) const { return maps_[i]; }
  // Of map(i), to be moved.
  std::vector<Vec2>* positions(int i) { return &maps_[i].positions; }
  // Per face of the mesh: its chart, -1 for those that have none (Surface::takes_part).
  std::vector<std::int32_t> FaceChart() const;
  // Per half-edge of the mesh: the one it is joined to in its chart, closed slits included; -1 on outlines.
  std::vector<std::int32_t> Opposite() const;
  // Faces that promises leave out, having no area; empty: none.
  const std::vector<char>& ignored() const { return ignored_; }
  // Angles on the surface of every corner.
  Eigen::VectorXd Measured() const;
  // Of the chart that was solved last.
  const FlattenProgress& last_progress() const { return progress_.flatten; }

 private:
  absl::Status MakeMaps(std::vector<UnwrapWarning>* warnings, UnwrapSeconds* seconds);
  // What became of MakeMaps(); STOPPED_EARLY if a stop left no valid map.
  absl::Status CheckStopped(const absl::Status& made) const;
  absl::Status Cut(std::vector<UnwrapWarning>* warnings);
  absl::Status CheckPieces() const;
  // Maps these charts.
  absl::Status MapAll(std::vector<std::int32_t> charts, UnwrapSeconds* seconds);
  // body(chart, execution, whether it runs on the calling thread) for each, the largest first, and those that are worth
  // it with the whole team.
  template <typename Body>
  void ForEachChart(const std::vector<std::int32_t>& charts, const Body& body);
  FlattenOptions OptionsWith(BoundaryType boundary) const;
  absl::StatusOr<Flattening> Flatten(std::int32_t i, BoundaryType boundary, const Execution& execution, bool reports);
  // Layout and faults.
  absl::Status Finish(std::int32_t i, const Execution& execution);
  // Where no seams are to be added: another map in place of one that needs them, if there is a better one.
  void KeepBorders(std::int32_t i, const Execution& execution);
  // Of these charts, those to be cut again.
  std::vector<Segmentation::Cut> ChartsToSplit(const std::vector<std::int32_t>& charts) const;
  // All that pack better in parts.
  std::vector<Segmentation::Cut> ChartsToPart() const;
  absl::Status Enter(UnwrapStage stage);
  bool MaySplit() const;

  const Mesh& mesh_;
  const UnwrapOptions& options_;
  const UnwrapControl& control_;
  const Execution& execution_;
  UnwrapProgress progress_;
  std::optional<Surface> surface_;            // unless the mesh is known to be a disc
  std::optional<Segmentation> segmentation_;  // as well
  std::vector<std::int32_t> disc_opposite_;   // if it is
  std::vector<char> ignored_;
  double total_area_ = 0;
  std::vector<Chart> charts_;
  std::vector<Flattening> flattenings_;  // between solve and layout
  std::vector<ChartMap> maps_;
  std::vector<ChartFaults> faults_;
  std::vector<absl::Status> statuses_;
};

}  // namespace planish
