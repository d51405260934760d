#include "core/unwrap/long_needles.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/mesh/angles.h"
#include "core/mesh/diagnosis.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

// Texels that the outline of a thin chart covers across, beside the padding.
constexpr double kTexelsAcross = 2;
constexpr int kMostRounds = 8;  // of the search

struct FaceSize {
  double area = 0, longest = 0;
};

// 0 and 0 of a face that refers to a vertex that does not exist, or is not finite.
FaceSize SizeOf(const Mesh& mesh, const Face& face) {
  for (const std::int32_t v : face) {
    if (v < 0 || v >= mesh.num_vertices() || !mesh.positions[v].allFinite()) return {};
  }
  const std::array<Vec3, 3> p = TriangleOf(mesh.positions, face);
  return {DoubleArea(p) / 2, LongestEdge(p)};
}

double AreaOf(const Mesh& mesh, const std::vector<char>& left_out) {
  double area = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (!left_out[f]) area += SizeOf(mesh, mesh.faces[f]).area;
  }
  return area;
}

}  // namespace

std::vector<char> FindLongNeedles(const Mesh& mesh, const AtlasTuning& tuning) {
  std::vector<char> needles(mesh.faces.size(), 0);
  std::int64_t count = 0, before = -1;
  // Without the longest ones the texture is smaller, and others are too long for it. Where there are any, none is drawn
  // longer than ReduceLongNeedles() draws those.
  for (int round = 0; round < kMostRounds && count > before; ++round) {
    before = count;
    const double longest = (round == 0 ? tuning.max_extent : tuning.needle_length) * std::sqrt(AreaOf(mesh, needles));
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      if (needles[f]) continue;
      const FaceSize size = SizeOf(mesh, mesh.faces[f]);
      if (size.longest <= longest || 2 * tuning.needle_aspect * size.area > size.longest * size.longest) continue;
      needles[f] = 1;
      ++count;
    }
  }
  const double most = tuning.needle_faces * static_cast<double>(mesh.faces.size());
  if (count == 0 || static_cast<double>(count) > most) return {};
  return needles;
}

std::vector<double> ReduceLongNeedles(const Mesh& mesh, const std::vector<char>& needles,
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
  const double side = std::sqrt(AreaOf(mesh, needles) / options.atlas.tiles);
  const double longest = side * std::min(tuning.needle_length, room / (across * static_cast<double>(found.size())));
  std::vector<double> reduction(mesh.faces.size(), 1.0);
  std::vector<std::int32_t> faces;
  for (const std::int32_t i : found) {
    double length = 0;
    for (const std::int32_t f : charts[i]) length = std::max(length, SizeOf(mesh, mesh.faces[f]).longest);
    for (const std::int32_t f : charts[i]) reduction[f] = std::min(1.0, longest / length);
    faces.insert(faces.end(), charts[i].begin(), charts[i].end());
  }
  if (found.empty()) return reduction;
  warnings->push_back({"CHARTS_REDUCED",
                       absl::StrCat(Counted(std::ssize(faces), "face is a needle", "faces are needles"),
                                    " much longer than the texture would be; ",
                                    "their charts are drawn smaller than the others, which leaves room for these"),
                       {{"count", absl::StrCat(faces.size())}},
                       faces});
  return reduction;
}

}  // namespace planish
