// Compares the texel density of each chart with AtlasReport::texels_per_unit, and explains differences.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/mesh/angles.h"
#include "core/mesh/diagnosis.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

constexpr double kSameDensity = 0.02;  // relative; rounding a chart of some texels to float changes far less
// A chart with less area than this times the sum of its squared edges consists of needles. Rounding changes their UV
// area many times over, so their density is measured along edges.
constexpr double kLeastAreaOfSquares = 1e-4;
// A polygon sets the scale if it spans this part of a tile or more.
constexpr double kSpansTile = 0.7;
// Charts usually fill about this part of a texture if no polygon is too long.
constexpr double kUsuallyFilled = 0.6;
// The warning is given if all charts could have this many times their texels per unit.
constexpr double kWorthAWord = 1.5;

// Length in UV over length on the surface for a chart, without widened faces and faces without area; 0 if no others are
// left.
double DensityOf(const Job& job, const Charts& charts, const Chart& chart, const CornerUv& uv) {
  double area = 0, uv_area = 0, squares = 0, edges = 0, uv_edges = 0;
  for (std::int32_t i = 0; i < chart.topology->num_faces(); ++i) {
    const std::int32_t f = chart.faces[i];
    if (chart.is_widened(i) || charts.is_ignored(f)) continue;
    const std::array<Vec2, 3> p = TriangleOf(uv, f);
    const std::array<Vec3, 3> q = TriangleOf(job.mesh.positions, job.mesh.faces[f]);
    area += DoubleArea(q) / 2;
    uv_area += std::abs(DoubleArea(p)) / 2;
    for (int k = 0; k < 3; ++k) {
      const double length = (q[Next(k)] - q[k]).norm();
      squares += length * length;
      edges += length;
      uv_edges += (p[Next(k)] - p[k]).norm();
    }
  }
  if (area > kLeastAreaOfSquares * squares) return std::sqrt(uv_area / area);
  return edges > 0 ? uv_edges / edges : 0;
}

// The scale of a face's atlas.
double ScaleOf(const Job& job, const Atlas& atlas, std::int32_t face) {
  const auto own = atlas.atlases.find(AtlasOf(job.options, face));
  return own == atlas.atlases.end() ? atlas.scale : own->second.texels_per_unit / atlas.texture_size;
}

void WarnOfOtherDensities(const Job& job, const Charts& charts, const Atlas& atlas, const CornerUv& uv,
                          std::vector<UnwrapWarning>* warnings) {
  std::vector<std::int32_t> faces;
  std::int64_t count = 0;
  double least = 1, most = 1;
  for (const MappedChart& mapped : charts.charts) {
    const Chart& chart = mapped.chart;
    if (charts.ReductionOf(chart.faces) < 1) continue;  // the warning CHARTS_REDUCED names them
    const double told = ScaleOf(job, atlas, chart.faces.front()) * WeightOf(job.options, *charts.surface, chart);
    const double ratio = DensityOf(job, charts, chart, uv) / told;
    if (ratio == 0 || std::abs(ratio - 1) <= kSameDensity) continue;
    ++count;
    least = std::min(least, ratio);
    most = std::max(most, ratio);
    faces.insert(faces.end(), chart.faces.begin(), chart.faces.end());
  }
  if (count == 0) return;
  std::sort(faces.begin(), faces.end());
  const std::string range =
      least < 1 - kSameDensity ? absl::StrFormat("%.3g to %.3g", least, most) : absl::StrFormat("up to %.3g", most);
  warnings->push_back({"DENSITY_VARIES",
                       absl::StrCat(Counted(count, "chart has ", "charts have "), range,
                                    " times the texels per unit of the others: charts are enlarged that would be "
                                    "smaller than a texel, or too small for the type of the UV; a larger texture "
                                    "would hold them"),
                       {{"chart_count", absl::StrCat(count)},
                        {"least", absl::StrFormat("%g", least)},
                        {"most", absl::StrFormat("%g", most)},
                        {"count", absl::StrCat(faces.size())}},
                       std::move(faces)});
}

// A group of atlases that share one scale: a single atlas if they are stacked, otherwise all atlases.
struct OneScale {
  double scale = 1;
  std::map<std::int32_t, double> area;  // by atlas, drawn at scale 1
  struct Long {
    double length;  // as drawn at scale 1
    std::int32_t polygon;
  };
  std::vector<Long> polygons;  // too long for the scale at which the area would fit

  // The scale at which the charts would fill the tiles as usual, without long polygons.
  double ByArea(int tiles) const {
    double most = 0;
    for (const auto& [number, of_atlas] : area) most = std::max(most, of_atlas);
    return most > 0 ? std::sqrt(kUsuallyFilled * tiles / most) : 0;
  }
};

// Calls body(group, polygon, atlas, area, length) for each polygon with a face that takes part (Surface::takes_part).
// Area and length are as drawn at scale 1.
template <typename Body>
void ForEachPolygon(const Job& job, const Charts& charts, const Atlas& atlas, std::map<std::int32_t, OneScale>* groups,
                    const Body& body) {
  const UnwrapOptions& options = job.options;
  const Surface& surface = *charts.surface;
  const bool stacked = !options.face_atlas.empty() && options.layout == AtlasLayout::kStacked;
  for (std::int32_t i = 0; i < job.polygons.count(); ++i) {
    double drawn = 0, area = 0;
    std::int32_t first = -1;
    job.polygons.ForEachFace(i, [&](std::int32_t f) {
      if (!surface.takes_part[f]) return;
      if (first < 0) first = f;
      const double weight = options.face_weights.empty() ? 1 : options.face_weights[f];
      const double own = weight * (charts.reduction.empty() ? 1 : charts.reduction[f]);
      drawn = std::max(drawn, own);
      area += own * own * surface.area[f];
    });
    if (first < 0) continue;
    OneScale& group = (*groups)[stacked ? AtlasOf(options, first) : 0];
    group.scale = ScaleOf(job, atlas, first);
    body(&group, i, AtlasOf(options, first), area, drawn * SizeOfPolygon(job.mesh, job.polygons, i).length);
  }
}

// Warns of polygons that determine the scale, if all charts would be much denser without them.
void WarnOfLongPolygons(const Job& job, const Charts& charts, const Atlas& atlas,
                        std::vector<UnwrapWarning>* warnings) {
  const int tiles = job.options.atlas.tiles;
  std::map<std::int32_t, OneScale> groups;
  ForEachPolygon(
      job, charts, atlas, &groups,
      [](OneScale* group, std::int32_t, std::int32_t number, double area, double) { group->area[number] += area; });
  ForEachPolygon(job, charts, atlas, &groups,
                 [&](OneScale* group, std::int32_t i, std::int32_t, double, double length) {
                   if (length * group->ByArea(tiles) > kSpansTile) group->polygons.push_back({length, i});
                 });
  std::vector<std::int32_t> faces;
  std::int64_t count = 0;
  double denser = 1;
  for (const auto& [number, group] : groups) {
    double longest = 0;
    for (const OneScale::Long& each : group.polygons) longest = std::max(longest, each.length);
    const double times = group.ByArea(tiles) / group.scale;
    if (longest * group.scale < kSpansTile || times < kWorthAWord) continue;
    denser = std::max(denser, times);
    count += std::ssize(group.polygons);
    for (const OneScale::Long& each : group.polygons) {
      job.polygons.ForEachFace(each.polygon, [&](std::int32_t f) { faces.push_back(f); });
    }
  }
  if (count == 0) return;
  std::sort(faces.begin(), faces.end());
  warnings->push_back(
      {"FACES_TOO_LONG",
       absl::StrCat(Counted(count, "face is so long that it sets", "faces are so long that they set"),
                    absl::StrFormat(" the texel density of all charts: about %.2g times as many texels per unit would "
                                    "fit if the mesh had shorter faces there; split them in the mesh, or give them a "
                                    "lower weight or an atlas of their own",
                                    denser)),
       {{"count", absl::StrCat(faces.size())}, {"denser", absl::StrFormat("%.3g", denser)}},
       std::move(faces)});
}

}  // namespace

void WarnOfDensity(const Job& job, const Charts& charts, const Atlas& atlas, const CornerUv& uv,
                   std::vector<UnwrapWarning>* warnings) {
  if (!job.packs()) return;
  WarnOfOtherDensities(job, charts, atlas, uv, warnings);
  WarnOfLongPolygons(job, charts, atlas, warnings);
}

}  // namespace planish
