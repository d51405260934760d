#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/unwrap/placement.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

// Sets where each chart's map goes.
Atlas Place(const UnwrapOptions& options, const Execution& execution, Charts* charts,
            std::vector<ChartPlacement>* placements) {
  Atlas atlas;
  placements->resize(charts->count());
  if (!options.pack) {
    for (std::int32_t i = 0; i < charts->count(); ++i) {
      Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity());
      for (const Vec2& p : charts->charts[i].map.positions) low = low.cwiseMin(p);
      (*placements)[i].offset = -low;
    }
    return atlas;
  }
  if (options.seams.policy == SeamPolicy::kNone) {
    atlas.scale = PlaceInUnitSquare(&charts->charts[0].map.positions, execution);
    return atlas;
  }
  std::vector<PackChart> to_pack;
  for (const MappedChart& mapped : charts->charts) {
    to_pack.push_back({mapped.map.positions, mapped.chart.topology.faces});
  }
  Packing packing = Pack(to_pack, options.atlas, execution);
  atlas.tiles = packing.tiles;
  atlas.scale = packing.scale;
  atlas.padding = packing.padding;
  *placements = std::move(packing.charts);
  return atlas;
}

// The UV of the two ends of an edge between two vertices, or of one corner at a vertex, wherever a face has UV there.
class ElsewhereUv {
 public:
  ElsewhereUv(const Mesh& mesh, const std::vector<std::int32_t>& face_chart, const CornerUv& uv)
      : mesh_(mesh), uv_(uv) {
    corners_.resize(mesh.positions.size());
    std::vector<char> wanted(mesh.positions.size(), 0);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      if (face_chart[f] >= 0) continue;
      for (const std::int32_t v : mesh.faces[f]) wanted[v] = 1;
    }
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      if (face_chart[f] < 0) continue;
      for (int k = 0; k < 3; ++k) {
        if (wanted[mesh.faces[f][k]]) corners_[mesh.faces[f][k]].push_back(static_cast<std::int32_t>(3 * f) + k);
      }
    }
  }

  // Of each corner of a face without a chart.
  std::array<Vec2, 3> Of(const Face& face) const {
    // From a face that has both of its vertices, if there is one.
    for (int k = 0; k < 3; ++k) {
      const std::int32_t v = face[k], w = face[Next(k)];
      if (v == w) continue;
      for (const std::int32_t c : corners_[v]) {
        for (int j = 0; j < 3; ++j) {
          const std::int32_t d = 3 * (c / 3) + j;
          if (mesh_.faces[c / 3][j] != w) continue;
          std::array<Vec2, 3> places;
          for (int i = 0; i < 3; ++i) places[i] = At(face[i] == v ? c : d);
          return places;
        }
      }
    }
    for (const std::int32_t v : face) {
      if (!corners_[v].empty()) return {At(corners_[v].front()), At(corners_[v].front()), At(corners_[v].front())};
    }
    return {Vec2::Zero(), Vec2::Zero(), Vec2::Zero()};
  }

 private:
  Vec2 At(std::int32_t corner) const { return {uv_[2 * corner], uv_[2 * corner + 1]}; }

  const Mesh& mesh_;
  const CornerUv& uv_;
  std::vector<std::vector<std::int32_t>> corners_;  // with UV, per vertex of faces without
};

}  // namespace

absl::StatusOr<Atlas> PackCharts(Job* job, Charts* charts) {
  Timer timer;
  const Mesh& mesh = job->mesh;
  job->progress.chart_count = charts->count();
  job->progress.chart = charts->count() - 1;
  PLANISH_RETURN_IF_ERROR(job->Enter(UnwrapStage::kPack));
  std::vector<ChartPlacement> placements;
  Atlas atlas = Place(job->options, job->execution, charts, &placements);
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  atlas.uv.assign(6 * mesh.faces.size(), 0.0);
  const auto set = [&](std::size_t corner, const Vec2& p) {
    atlas.uv[2 * corner] = p.x();
    atlas.uv[2 * corner + 1] = p.y();
  };
  const bool stays = !job->options.pack || job->options.seams.policy == SeamPolicy::kNone;
  for (std::int32_t i = 0; i < charts->count(); ++i) {
    const Chart& chart = charts->charts[i].chart;
    const std::vector<Vec2>& positions = charts->charts[i].map.positions;
    const ChartPlacement& place = placements[i];
    job->execution.For(chart.topology.num_faces(), [&](std::int64_t begin, std::int64_t end) {
      for (std::int64_t f = begin; f < end; ++f) {
        const std::size_t corner = 3 * static_cast<std::size_t>(chart.faces[f]);
        for (std::size_t k = 0; k < 3; ++k) {
          const Vec2& p = positions[chart.topology.faces[f][k]];
          set(corner + k, stays ? Vec2(p + place.offset) : place(p));
        }
      }
    });
  }
  if (!charts->ignored.empty()) {
    const std::vector<std::int32_t> face_chart = charts->FaceChart(mesh);
    const ElsewhereUv elsewhere(mesh, face_chart, atlas.uv);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      if (face_chart[f] >= 0) continue;
      const std::array<Vec2, 3> places = elsewhere.Of(mesh.faces[f]);
      for (std::size_t k = 0; k < 3; ++k) set(3 * f + k, places[k]);
    }
  }
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  job->seconds.pack += timer.Restart();
  return atlas;
}

}  // namespace planish
