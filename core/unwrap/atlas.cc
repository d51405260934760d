#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/pack/outline.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

// Of the faces of a chart, by their area on the surface; by their number where they have none.
double WeightOf(const UnwrapOptions& options, const Surface& surface, const Chart& chart) {
  if (options.face_weights.empty()) return 1;
  double area = 0, by_area = 0, by_number = 0;
  for (const std::int32_t f : chart.faces) {
    const double weight = options.face_weights[f];
    area += surface.area[f];
    by_area += surface.area[f] * weight;
    by_number += weight;
  }
  return area > 0 ? by_area / area : by_number / static_cast<double>(chart.faces.size());
}

// The numbers of the atlases, ascending; 0 alone if there is one for all.
std::vector<std::int32_t> AtlasNumbers(const UnwrapOptions& options) {
  std::vector<std::int32_t> numbers = options.face_atlas;
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  if (numbers.empty()) numbers.push_back(0);
  return numbers;
}

// Packs all charts at one scale, each atlas into its own tiles; or, stacked, each atlas by itself, all into the same
// tiles.
void PackAtlases(const UnwrapOptions& options, bool is_draft, const Execution& execution, const Charts& charts,
                 Atlas* atlas, std::vector<ChartPlacement>* placements) {
  const bool stacked = !options.face_atlas.empty() && options.layout == AtlasLayout::kStacked;
  const std::vector<std::int32_t> numbers = AtlasNumbers(options);
  PackOptions tiles = options.atlas;
  tiles.atlases = stacked ? 1 : numbers.back() + 1;
  if (stacked) tiles.tuning.least_work /= static_cast<double>(numbers.size());  // all together have as much as one
  if (is_draft) {
    tiles.effort = PackEffort::kFast;
    tiles.tuning.fast_share = 0;
  }
  std::map<std::int32_t, AtlasReport> reports;
  for (const std::int32_t number : numbers) {
    reports[number].atlas = number;
    reports[number].first_tile = stacked ? 0 : number * tiles.tiles;
  }
  std::map<std::int32_t, std::vector<std::int32_t>> at_once;
  for (std::int32_t i = 0; i < charts.count(); ++i) {
    at_once[stacked ? AtlasOf(options, charts.charts[i].chart.faces) : 0].push_back(i);
  }
  atlas->scale = std::numeric_limits<double>::infinity();
  atlas->padding = tiles.padding;
  for (const auto& [group, own] : at_once) {
    if (execution.IsCancelled()) return;
    std::vector<PackChart> to_pack;
    to_pack.reserve(own.size());
    for (const std::int32_t i : own) {
      const MappedChart& mapped = charts.charts[i];
      to_pack.push_back({mapped.map.positions, mapped.chart.topology.faces,
                         WeightOf(options, *charts.surface, mapped.chart),
                         stacked ? 0 : AtlasOf(options, mapped.chart.faces)});
    }
    const Packing packing = Pack(std::move(to_pack), tiles, execution);
    for (auto& [number, report] : reports) {
      if (!stacked || number == group) report.texels_per_unit = packing.scale * tiles.texture_size;
    }
    for (std::size_t k = 0; k < own.size(); ++k) {
      AtlasReport& report = reports[AtlasOf(options, charts.charts[own[k]].chart.faces)];
      (*placements)[own[k]] = packing.charts[k];
      ++report.charts;
      report.tiles = std::max(report.tiles, packing.charts[k].tile + 1 - report.first_tile);
    }
    atlas->tiles = std::max(atlas->tiles, packing.tiles);
    atlas->scale = std::min(atlas->scale, packing.scale);
    if (own.size() > 1) atlas->padding = std::min(atlas->padding, packing.padding);
  }
  if (!std::isfinite(atlas->scale)) atlas->scale = 1;
  for (const auto& [number, report] : reports) {
    if (!options.face_atlas.empty()) atlas->atlases.push_back(report);
  }
}

// Sets where each chart's map goes.
Atlas Place(const UnwrapOptions& options, bool is_draft, const Execution& execution, Charts* charts,
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
    MappedChart& disc = charts->charts[0];
    atlas.scale = PlaceInUnitSquare(OutlineOf(disc.chart, disc.map.positions), &disc.map.positions, execution);
    return atlas;
  }
  PackAtlases(options, is_draft, execution, *charts, &atlas, placements);
  return atlas;
}

// The UV of the two ends of an edge between two vertices, or of one corner at a vertex, wherever a face of the same
// atlas has UV there.
class ElsewhereUv {
 public:
  ElsewhereUv(const Mesh& mesh, const UnwrapOptions& options, const std::vector<std::int32_t>& face_chart,
              const CornerUv& uv)
      : mesh_(mesh), options_(options), uv_(uv) {
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
  std::array<Vec2, 3> Of(std::size_t f) const {
    const Face& face = mesh_.faces[f];
    const std::int32_t atlas = AtlasOfFace(f);
    // From a face that has both of its vertices, if there is one.
    for (int k = 0; k < 3; ++k) {
      const std::int32_t v = face[k], w = face[Next(k)];
      if (v == w) continue;
      for (const std::int32_t c : corners_[v]) {
        for (int j = 0; j < 3; ++j) {
          const std::int32_t d = 3 * (c / 3) + j;
          if (mesh_.faces[c / 3][j] != w || AtlasOfFace(c / 3) != atlas) continue;
          std::array<Vec2, 3> places;
          for (int i = 0; i < 3; ++i) places[i] = At(face[i] == v ? c : d);
          return places;
        }
      }
    }
    for (const std::int32_t v : face) {
      for (const std::int32_t c : corners_[v]) {
        if (AtlasOfFace(c / 3) == atlas) return {At(c), At(c), At(c)};
      }
    }
    const int tile = options_.layout == AtlasLayout::kUdim ? atlas * options_.atlas.tiles : 0;
    const Vec2 corner = CornerOfTile(tile);
    return {corner, corner, corner};
  }

 private:
  std::int32_t AtlasOfFace(std::size_t f) const { return options_.face_atlas.empty() ? 0 : options_.face_atlas[f]; }
  Vec2 At(std::int32_t corner) const { return {uv_[2 * corner], uv_[2 * corner + 1]}; }

  const Mesh& mesh_;
  const UnwrapOptions& options_;
  const CornerUv& uv_;
  std::vector<std::vector<std::int32_t>> corners_;  // with UV, per vertex of faces without
};

}  // namespace

std::int32_t AtlasOf(const UnwrapOptions& options, const std::vector<std::int32_t>& faces) {
  return options.face_atlas.empty() ? 0 : options.face_atlas[faces.front()];
}

absl::StatusOr<Atlas> PackCharts(Job* job, bool is_draft, Charts* charts) {
  Timer timer;
  const Mesh& mesh = job->mesh;
  job->progress.chart_count = charts->count();
  job->progress.chart = charts->count() - 1;
  PLANISH_RETURN_IF_ERROR(job->Enter(UnwrapStage::kPack));
  std::vector<ChartPlacement> placements;
  Atlas atlas = Place(job->options, is_draft, job->execution, charts, &placements);
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
    job->execution.ForEach(chart.topology.num_faces(), [&](std::int64_t f) {
      const std::size_t corner = 3 * static_cast<std::size_t>(chart.faces[f]);
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec2& p = positions[chart.topology.faces[f][k]];
        set(corner + k, stays ? Vec2(p + place.offset) : place(p));
      }
    });
  }
  if (!charts->ignored.empty()) {
    const std::vector<std::int32_t> face_chart = charts->FaceChart(mesh);
    const ElsewhereUv elsewhere(mesh, job->options, face_chart, atlas.uv);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      if (face_chart[f] >= 0) continue;
      const std::array<Vec2, 3> places = elsewhere.Of(f);
      for (std::size_t k = 0; k < 3; ++k) set(3 * f + k, places[k]);
    }
  }
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  job->seconds.pack += timer.Restart();
  return atlas;
}

}  // namespace planish
