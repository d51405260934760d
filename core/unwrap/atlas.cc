#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/pack/outline.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

// Packs all charts at one scale, each atlas into its own tiles; if stacked, packs each atlas separately, all into the
// same tiles.
void PackAtlases(const UnwrapOptions& options, bool is_draft, const Execution& execution, Charts* charts,
                 Atlas* atlas) {
  const bool stacked = !options.face_atlas.empty() && options.layout == AtlasLayout::kStacked;
  std::set<std::int32_t> numbers(options.face_atlas.begin(), options.face_atlas.end());
  if (numbers.empty()) numbers.insert(0);
  PackOptions tiles = options.atlas;
  tiles.texture_size = atlas->texture_size;
  if (options.texels_per_unit > 0) tiles.most_scale = options.texels_per_unit / tiles.texture_size;
  tiles.atlases = stacked ? 1 : *numbers.rbegin() + 1;
  if (stacked) tiles.tuning.least_work /= static_cast<double>(numbers.size());  // all atlases share the work of one
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
  for (std::int32_t i = 0; i < charts->count(); ++i) {
    at_once[stacked ? AtlasOf(options, charts->charts[i].chart.faces.front()) : 0].push_back(i);
  }
  atlas->scale = std::numeric_limits<double>::infinity();
  atlas->padding = tiles.padding;
  for (const auto& [group, own] : at_once) {
    if (execution.IsCancelled()) return;
    const auto make_chart = [&, &own = own](std::size_t k) -> PackChart {
      const MappedChart& mapped = charts->charts[own[k]];
      return {mapped.map.positions, mapped.chart.topology->faces, WeightOf(options, *charts->surface, mapped.chart),
              stacked ? 0 : AtlasOf(options, mapped.chart.faces.front())};
    };
    const Packing packing = Pack(own.size(), make_chart, tiles, execution);
    for (auto& [number, report] : reports) {
      if (!stacked || number == group) report.texels_per_unit = packing.scale * tiles.texture_size;
    }
    for (std::size_t k = 0; k < own.size(); ++k) {
      AtlasReport& report = reports[AtlasOf(options, charts->charts[own[k]].chart.faces.front())];
      charts->charts[own[k]].map.placement = packing.charts[k];
      ++report.charts;
      report.tiles = std::max(report.tiles, packing.charts[k].tile + 1 - report.first_tile);
    }
    atlas->tiles = std::max(atlas->tiles, packing.tiles);
    atlas->scale = std::min(atlas->scale, packing.scale);
    if (own.size() > 1) atlas->padding = std::min(atlas->padding, packing.padding);
  }
  if (!std::isfinite(atlas->scale)) atlas->scale = 1;
  if (!options.face_atlas.empty()) atlas->atlases = std::move(reports);
}

// The bounding box of the map.
Box BoxOf(const ChartMap& map) {
  Box box;
  for (const Vec2& p : map.positions) box.Add(p);
  return box;
}

// Sets the placement of each chart. `before`: the previous packing, or null.
Atlas Place(const UnwrapOptions& options, int texture_size, const Atlas* before, bool is_draft,
            const Execution& execution, Charts* charts) {
  Atlas atlas;
  atlas.texture_size = texture_size;
  if (!options.pack) {
    for (MappedChart& mapped : charts->charts) {
      mapped.map.placement = ChartPlacement();
      mapped.map.placement->offset = -BoxOf(mapped.map).low;
    }
  } else if (options.seams.policy == SeamPolicy::kNone) {
    MappedChart& disc = charts->charts[0];
    atlas.scale = PlaceInUnitSquare(OutlineOf(disc.chart, disc.map.positions), &disc.map.positions, execution);
    // A map that was placed before is already scaled.
    if (before != nullptr && disc.map.placement) atlas.scale *= before->scale;
    disc.map.placement = ChartPlacement();
  } else {
    PackAtlases(options, is_draft, execution, charts, &atlas);
  }
  return atlas;
}

// The smallest power of two that may be enough as a texture's size for the charts at this density, by their area alone.
int LeastTextureSize(const UnwrapOptions& options, const Charts& charts) {
  std::map<std::int32_t, double> areas;  // of each atlas, in texels
  for (const MappedChart& mapped : charts.charts) {
    double area = 0;
    for (const Face& face : mapped.chart.topology->faces) {
      const std::vector<Vec2>& p = mapped.map.positions;
      const Vec2 u = p[face[1]] - p[face[0]], v = p[face[2]] - p[face[0]];
      area += std::abs(u.x() * v.y() - u.y() * v.x()) / 2;
    }
    const double density = options.texels_per_unit * WeightOf(options, *charts.surface, mapped.chart);
    areas[AtlasOf(options, mapped.chart.faces.front())] += area * density * density;
  }
  int size = kMinTextureSize;
  const auto is_too_small = [&](const auto& atlas) {
    return atlas.second > static_cast<double>(options.atlas.tiles) * size * size;
  };
  while (size < kMaxTextureSize &&
         (size <= options.atlas.padding + 1 || std::any_of(areas.begin(), areas.end(), is_too_small))) {
    size *= 2;
  }
  return size;
}

// Place() at UnwrapOptions::texels_per_unit; with finds_texture_size, into the smallest texture that has room. Drafts,
// and packings that a stop request cuts short, may be less dense. OPTIONS_INVALID: no allowed texture has room.
absl::StatusOr<Atlas> PlaceAtDensity(const UnwrapOptions& options, const Atlas* before, bool is_draft,
                                     const Execution& execution, Charts* charts) {
  int size = options.finds_texture_size ? LeastTextureSize(options, *charts) : options.atlas.texture_size;
  if (before != nullptr && options.finds_texture_size) size = std::max(size, before->texture_size);
  while (true) {
    Atlas atlas = Place(options, size, before, is_draft, execution, charts);
    const double density = atlas.scale * size;
    const bool is_enough = density >= (1 - 1e-9) * options.texels_per_unit;
    if (is_enough || is_draft || execution.IsStopRequested() || execution.IsCancelled()) return atlas;
    if (!options.finds_texture_size || size >= kMaxTextureSize) {
      return OptionError("texels_per_unit",
                         absl::StrFormat("a texture of %d x %d texels%s has room for at most %.4g texels per unit, "
                                         "%.3g of the %.6g asked for; ask for fewer, or allow more tiles%s",
                                         size, size, options.atlas.tiles > 1 ? " in each tile" : "", density,
                                         density / options.texels_per_unit, options.texels_per_unit,
                                         size < kMaxTextureSize ? " or a larger texture" : ""),
                         {{"most", absl::StrFormat("%.6g", density)}, {"texture_size", absl::StrCat(size)}});
    }
    size *= 2;
  }
}

// Places the maps without a placement, which were solved since the last packing, at the scale of that packing: all at
// one place, round the middle of the quarter of a tile where rounding is coarsest.
void PlaceRoughly(const UnwrapOptions& options, const Atlas& atlas, Charts* charts) {
  const Vec2 middle(0.75, 0.75);
  for (MappedChart& mapped : charts->charts) {
    if (mapped.map.placement) continue;
    const Box box = BoxOf(mapped.map);
    const double weight = WeightOf(options, *charts->surface, mapped.chart);
    ChartPlacement& place = mapped.map.placement.emplace();
    PackOptions tiles = options.atlas;
    tiles.texture_size = atlas.texture_size;
    place.scale = DrawnScale(ExtentOf(mapped.map.positions) / 2, weight, atlas.scale, charts->count(), tiles);
    place.offset = middle - place.scale * (box.low + box.high) / 2;
  }
}

// Gives faces without a chart the UV of the two ends of an edge, or of one corner at a vertex, where a face of the same
// atlas has UV there; otherwise the corner of a tile.
void PlaceElsewhere(const Mesh& mesh, const UnwrapOptions& options, const std::vector<std::int32_t>& face_chart,
                    CornerUv* uv) {
  std::vector<char> wanted(mesh.positions.size(), 0);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (face_chart[f] >= 0) continue;
    for (const std::int32_t v : mesh.faces[f]) wanted[v] = 1;
  }
  std::vector<std::vector<std::int32_t>> corners(mesh.positions.size());  // corners with UV, of vertices that need them
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(3 * mesh.faces.size()); ++c) {
    const std::int32_t v = mesh.faces[c / 3][c % 3];
    if (face_chart[c / 3] >= 0 && wanted[v]) corners[v].push_back(c);
  }
  const auto places_of = [&](std::int32_t f) -> std::array<Vec2, 3> {
    const Face& face = mesh.faces[f];
    const std::int32_t atlas = AtlasOf(options, f);
    // Prefers a face that has both vertices.
    for (int k = 0; k < 3; ++k) {
      const std::int32_t v = face[k], w = face[Next(k)];
      if (v == w) continue;
      for (const std::int32_t c : corners[v]) {
        for (int j = 0; j < 3; ++j) {
          if (mesh.faces[c / 3][j] != w || AtlasOf(options, c / 3) != atlas) continue;
          const auto at = [&](std::int32_t vertex) { return UvOf(*uv, vertex == v ? c : 3 * (c / 3) + j); };
          return {at(face[0]), at(face[1]), at(face[2])};
        }
      }
    }
    for (const std::int32_t v : face) {
      for (const std::int32_t c : corners[v]) {
        if (AtlasOf(options, c / 3) == atlas) return {UvOf(*uv, c), UvOf(*uv, c), UvOf(*uv, c)};
      }
    }
    const Vec2 corner = CornerOfTile(options.layout == AtlasLayout::kUdim ? atlas * options.atlas.tiles : 0);
    return {corner, corner, corner};
  };
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(mesh.faces.size()); ++f) {
    if (face_chart[f] >= 0) continue;
    const std::array<Vec2, 3> places = places_of(f);
    for (int k = 0; k < 3; ++k) SetUv(3 * f + k, places[k], uv);
  }
}

}  // namespace

std::int32_t AtlasOf(const UnwrapOptions& options, std::int32_t face) {
  return options.face_atlas.empty() ? 0 : options.face_atlas[face];
}

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

void WriteUv(const MappedChart& mapped, Precision precision, const Execution& execution, CornerUv* uv) {
  const Chart& chart = mapped.chart;
  const ChartPlacement& place = *mapped.map.placement;
  execution.ForEach(chart.topology->num_faces(), [&](std::int64_t f) {
    for (int k = 0; k < 3; ++k) {
      Vec2 p = place(mapped.map.positions[chart.topology->faces[f][k]]);
      if (precision == Precision::kFloat) p = p.cast<float>().cast<double>();
      SetUv(3 * chart.faces[f] + k, p, uv);
    }
  });
}

absl::StatusOr<Atlas> PackCharts(Job* job, const Atlas* before, bool is_draft, Charts* charts) {
  Timer timer;
  const Mesh& mesh = job->mesh;
  job->progress.chart_count = charts->count();
  job->progress.chart = charts->count() - 1;
  PLANISH_RETURN_IF_ERROR(job->Enter(UnwrapStage::kPack));
  Atlas atlas;
  if (before != nullptr && is_draft && job->packs()) {
    atlas = *before;
    PlaceRoughly(job->options, atlas, charts);
  } else {
    PLANISH_ASSIGN_OR_RETURN(atlas, PlaceAtDensity(job->options, before, is_draft, job->execution, charts));
  }
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  atlas.uv.assign(6 * mesh.faces.size(), 0.0);
  for (const MappedChart& mapped : charts->charts) WriteUv(mapped, Precision::kDouble, job->execution, &atlas.uv);
  if (!charts->ignored.empty()) PlaceElsewhere(mesh, job->options, charts->FaceChart(mesh), &atlas.uv);
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  job->seconds.pack += timer.Restart();
  return atlas;
}

}  // namespace planish
