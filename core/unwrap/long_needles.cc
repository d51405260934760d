#include "core/unwrap/long_needles.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/mesh/diagnosis.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

// Texels across the outline of a thin chart, beside the padding.
constexpr double kTexelsAcross = 2;
constexpr int kMostRounds = 8;  // of the search for long needles

double AreaOfOthers(const Mesh& mesh, const Polygons& polygons, const std::vector<char>& needles) {
  double area = 0;
  for (std::int32_t i = 0; i < polygons.count(); ++i) {
    bool is_needle = false;
    polygons.ForEachFace(i, [&](std::int32_t f) { is_needle = needles[f] != 0; });
    if (!is_needle) area += SizeOfPolygon(mesh, polygons, i).area;
  }
  return area;
}

}  // namespace

std::vector<char> FindLongNeedles(const Mesh& mesh, const Polygons& polygons, const AtlasTuning& tuning) {
  std::vector<char> needles(mesh.faces.size(), 0);
  std::int64_t count = 0, before = -1;
  // Without the longest needles the texture is smaller, so that others become too long for it, and the search is
  // repeated. Once there are long needles, needles count as long from the length at which ReduceLongNeedles() draws
  // them.
  for (int round = 0; round < kMostRounds && count > before; ++round) {
    before = count;
    const double longest =
        (round == 0 ? tuning.max_extent : tuning.needle_length) * std::sqrt(AreaOfOthers(mesh, polygons, needles));
    for (std::int32_t i = 0; i < polygons.count(); ++i) {
      const auto [area, length] = SizeOfPolygon(mesh, polygons, i);
      if (length <= longest || 2 * tuning.needle_aspect * area > length * length) continue;
      polygons.ForEachFace(i, [&](std::int32_t f) {
        count += needles[f] == 0;
        needles[f] = 1;
      });
    }
  }
  const double most = tuning.needle_faces * static_cast<double>(mesh.faces.size());
  if (count == 0 || static_cast<double>(count) > most) return {};
  return needles;
}

std::vector<double> ReduceLongNeedles(const Mesh& mesh, const Polygons& polygons, const std::vector<char>& needles,
                                      const std::vector<std::vector<std::int32_t>>& charts,
                                      const UnwrapOptions& options, std::vector<UnwrapWarning>* warnings) {
  const AtlasTuning& tuning = options.tuning;
  std::vector<std::int32_t> found;
  for (std::size_t i = 0; i < charts.size(); ++i) {
    const std::vector<std::int32_t>& faces = charts[i];
    if (std::any_of(faces.begin(), faces.end(), [&](std::int32_t f) { return needles[f] != 0; })) {
      found.push_back(static_cast<std::int32_t>(i));
    }
  }
  const int texels = options.atlas.texture_size;
  const double across = (options.atlas.padding + kTexelsAcross) / texels;
  const double room = tuning.needle_room * options.atlas.tiles;
  const double side = std::sqrt(AreaOfOthers(mesh, polygons, needles) / options.atlas.tiles);
  const double longest = side * std::min(tuning.needle_length, room / (across * static_cast<double>(found.size())));
  std::vector<double> reduction(mesh.faces.size(), 1.0);
  std::vector<std::int32_t> faces;
  double least = 1;
  for (const std::int32_t i : found) {
    double length = 0;
    for (const std::int32_t f : charts[i]) {
      length = std::max(length, SizeOfPolygon(mesh, polygons, polygons.of(f)).length);
    }
    for (const std::int32_t f : charts[i]) reduction[f] = std::min(1.0, longest / length);
    least = std::min(least, longest / length);
    faces.insert(faces.end(), charts[i].begin(), charts[i].end());
  }
  if (found.empty()) return reduction;
  warnings->push_back(
      {"CHARTS_REDUCED",
       absl::StrCat(Counted(polygons.CountIn(faces), "face is a needle", "faces are needles"),
                    " much longer than the texture would be; ",
                    absl::StrFormat("their charts have down to %.2g times the texels per unit of the others, which "
                                    "leaves room for these; split the faces in the mesh to have one density",
                                    least)),
       {{"count", absl::StrCat(faces.size())}, {"least", absl::StrFormat("%g", least)}},
       faces});
  return reduction;
}

}  // namespace planish
