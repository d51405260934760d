#include "core/unwrap/map_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "Eigen/Geometry"
#include "core/mesh/angles.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/predicates.h"
#include "core/mesh/visibility.h"
#include "core/pack/pack.h"
#include "core/unwrap/distortion.h"

namespace planish {
namespace {

constexpr double kDegreesPerRadian = 180 / std::numbers::pi;

// A face in the map and on the surface.
struct FaceSizes {
  int orientation = 0;
  double uv_area = 0;  // signed
  double surface_area = 0;

  bool HasStretch() const { return orientation != 0 && uv_area != 0 && surface_area > 0; }
};

// Errors of the angles of faces, degrees.
struct AngleErrors {
  double sum = 0, angles = 0;

  void Add(double of_face) {
    sum += of_face;
    angles += 3;
  }
  double Mean() const { return angles > 0 ? sum / angles : 0; }
};

class MapJudge {
 public:
  MapJudge(const Mesh& mesh, const CornerUv& uv, const MapTopology& topology, const MapCheckOptions& options,
           const Execution& execution)
      : mesh_(mesh), uv_(uv), topology_(topology), options_(options), execution_(execution) {}

  MapCheck Run() {
    check_.faults.assign(mesh_.faces.size(), 0);
    check_.charts.resize(topology_.num_charts);
    MeasureFaces();
    FindFlips();
    JoinEdges();
    FindTiles();
    FindOverlapping();
    MeasureStretch();
    MeasureAngleErrors();
    MeasureDensities();
    MeasureSeams();
    if (options_.with_spacing) MeasureSpacing();
    return std::move(check_);
  }

 private:
  std::int64_t num_faces() const { return mesh_.num_faces(); }

  std::array<Vec2, 3> InMap(std::int64_t f) const { return TriangleOf(uv_, f); }
  std::array<Vec3, 3> OnSurface(std::int64_t f) const { return TriangleOf(mesh_.positions, mesh_.faces[f]); }

  void MeasureFaces() {
    sizes_.resize(mesh_.faces.size());
    is_without_area_.resize(mesh_.faces.size());
    execution_.ForEach(num_faces(), [&](std::int64_t f) {
      sizes_[f] = {Orientation(InMap(f)), DoubleArea(InMap(f)) / 2, DoubleArea(OnSurface(f)) / 2};
      const auto [p, q, r] = OnSurface(f);
      is_without_area_[f] = !HasThreeCorners(mesh_.faces[f]) || IsDegenerateTriangle(p, q, r);
    });
    for (std::int64_t f = 0; f < num_faces(); ++f) {
      if (!is_without_area_[f]) continue;
      sizes_[f] = {0, 0, 0};
      check_.faults[f] |= kFaceWithoutArea;
      ++check_.without_area;
    }
    if (check_.without_area == 0) is_without_area_.clear();
  }

  // A chart is mirrored as a whole if its signed area is negative; faces of the opposite orientation are flipped.
  void FindFlips() {
    std::vector<double> area(check_.charts.size(), 0.0);
    std::vector<std::int64_t> upright(check_.charts.size(), 0);
    for (std::int64_t f = 0; f < num_faces(); ++f) {
      const std::int32_t c = topology_.chart_of_face[f];
      area[c] += sizes_[f].uv_area;
      upright[c] += sizes_[f].orientation;
      ChartCheck& chart = check_.charts[c];
      ++chart.triangles;
      chart.uv_area += std::abs(sizes_[f].uv_area);
      chart.surface_area += sizes_[f].surface_area;
    }
    for (std::size_t c = 0; c < check_.charts.size(); ++c) {
      // If areas are too small to have a sign, counts faces.
      check_.charts[c].is_mirrored = area[c] < 0 || (area[c] == 0 && upright[c] < 0);
      check_.mirrored_charts += check_.charts[c].is_mirrored;
    }
    for (std::int64_t f = 0; f < num_faces(); ++f) {
      const bool is_mirrored = check_.charts[topology_.chart_of_face[f]].is_mirrored;
      const int orientation = is_mirrored ? -sizes_[f].orientation : sizes_[f].orientation;
      check_.uv_area += std::abs(sizes_[f].uv_area);
      check_.surface_area += sizes_[f].surface_area;
      if (orientation < 0) check_.faults[f] |= kFlippedFace, ++check_.flipped;
      const bool has_area = (check_.faults[f] & kFaceWithoutArea) == 0;
      if (orientation == 0 && has_area) check_.faults[f] |= kDegenerateFace, ++check_.degenerate;
      if (orientation > 0 && is_mirrored) ++check_.mirrored_triangles;
    }
  }

  // The allowed tile whose closed square contains the box; otherwise -1. At a border, the tile of the centre.
  std::int32_t TileOf(const Eigen::AlignedBox2d& box) const {
    const Vec2 low = box.center().array().floor();
    if (!(low.x() >= 0 && low.x() < PackOptions::kTilesInRow && low.y() >= 0 && low.y() < options_.tiles)) return -1;
    if (!Eigen::AlignedBox2d(low, low + Vec2::Ones()).contains(box)) return -1;
    const int tile = static_cast<int>(low.x()) + PackOptions::kTilesInRow * static_cast<int>(low.y());
    return tile < options_.tiles ? tile : -1;
  }

  void FindTiles() {
    std::vector<Eigen::AlignedBox2d> boxes(check_.charts.size());
    std::set<std::int32_t> used;
    for (std::int64_t f = 0; f < num_faces(); ++f) {
      Eigen::AlignedBox2d box;
      for (const Vec2& p : InMap(f)) box.extend(p);
      boxes[topology_.chart_of_face[f]].extend(box);
      const std::int32_t tile = TileOf(box);
      if (tile < 0) check_.faults[f] |= kOutsideFace, ++check_.outside;
      if (tile >= 0) used.insert(tile);
    }
    for (std::size_t c = 0; c < boxes.size(); ++c) check_.charts[c].tile = TileOf(boxes[c]);
    check_.tiles_used = std::max(1, static_cast<int>(used.size()));
    check_.packing_efficiency = check_.uv_area / check_.tiles_used;
  }

  // Finds the half-edges that the map joins. Faces with fewer than three different places join nothing.
  void JoinEdges() {
    const std::vector<std::int32_t>& place = topology_.place_of_corner;
    is_joined_.assign(place.size(), 0);
    is_on_seam_.assign(place.size(), 1);
    opposite_.assign(place.size(), -1);
    std::vector<std::int32_t> at;
    for (std::int32_t e = 0; e < topology_.edges.count(); ++e) {
      at.clear();
      for (const std::int32_t c : topology_.edges[e]) {
        if (HasThreeCorners({place[c / 3 * 3], place[c / 3 * 3 + 1], place[c / 3 * 3 + 2]})) at.push_back(c);
      }
      for (std::size_t i = 1; i < at.size(); i += 2) {
        is_joined_[at[i - 1]] = is_joined_[at[i]] = 1;
        if (OnOneEdge(at[i - 1], at[i])) is_on_seam_[at[i - 1]] = is_on_seam_[at[i]] = 0;
      }
      if (at.size() != 2 || place[FlatLinks::Next(at[0])] != place[FlatLinks::Prev(at[1])]) continue;
      opposite_[at[0]] = at[1];
      opposite_[at[1]] = at[0];
    }
  }

  void FindOverlapping() {
    // A map without faults needs no test of pairs; a mirrored chart does.
    OrientationFaults orientation;
    orientation.flipped = check_.flipped + check_.mirrored_triangles;
    orientation.degenerate = check_.degenerate;
    constexpr std::int64_t kTestsPerFace = 30;  // beyond that, testing pairs is as fast
    const std::vector<char>& ignored = is_without_area_;
    const std::int64_t tests = kTestsPerFace * num_faces();
    if (OutlinesProveNoOverlap(opposite_, uv_, orientation, tests, execution_, ignored)) return;
    check_.overlaps = FindOverlaps(uv_, kMaxOverlapTests, &check_.overlapping_pairs, execution_, ignored);
    if (check_.overlaps.limited && check_.overlaps.pairs == 0) {  // a large fan
      check_.overlaps = FindOneOverlap(uv_, execution_, ignored);
      check_.overlapping_pairs = check_.overlaps.faces;
    }
    for (const std::int32_t f : check_.overlapping_pairs) {
      check_.overlapping += (check_.faults[f] & kOverlappingFace) == 0;
      check_.faults[f] |= kOverlappingFace;
    }
  }

  // The square root of area in the map over area on the surface, of everything.
  double Scale() const { return check_.surface_area > 0 ? std::sqrt(check_.uv_area / check_.surface_area) : 0; }

  void MeasureStretch() {
    check_.face_stretch.assign(mesh_.faces.size(), std::numeric_limits<float>::infinity());
    std::vector<MapSums> of_chart(check_.charts.size());
    MapSums all;
    const double scale = Scale();
    for (std::int64_t f = 0; f < num_faces(); ++f) {
      if (!sizes_[f].HasStretch()) continue;
      MapSums own;
      own.Add(InMap(f).data(), OnSurface(f).data());
      all.Add(own);
      of_chart[topology_.chart_of_face[f]].Add(own);
      // The singular values of the inverse map, from the mean of their squares and from their product.
      const double mean = own.stretch / own.surface_area, product = own.surface_area / own.uv_area;
      const double larger = std::sqrt(mean + std::sqrt(std::max(0.0, (mean - product) * (mean + product))));
      const double smaller = product / larger;
      check_.face_stretch[f] = static_cast<float>(std::max(std::log2(larger * scale), -std::log2(smaller * scale)));
    }
    if (all.surface_area > 0) check_.stretch_l2 = std::sqrt(all.stretch / all.surface_area) * scale;
    for (std::size_t c = 0; c < of_chart.size(); ++c) check_.charts[c].stretch_l2 = of_chart[c].StretchL2();
  }

  void MeasureAngleErrors() {
    check_.face_angle_error.assign(mesh_.faces.size(), 0);
    std::vector<AngleErrors> of_chart(check_.charts.size());
    AngleErrors all;
    for (std::int64_t f = 0; f < num_faces(); ++f) {
      if (sizes_[f].orientation == 0 || !(sizes_[f].surface_area > 0)) continue;
      double in_map[3], on_surface[3];
      TriangleAngles(InMap(f).data(), in_map);
      TriangleAngles(OnSurface(f).data(), on_surface);
      double worst = 0, total = 0;
      for (int k = 0; k < 3; ++k) {
        const double error = std::abs(in_map[k] - on_surface[k]) * kDegreesPerRadian;
        worst = std::max(worst, error);
        total += error;
      }
      check_.face_angle_error[f] = static_cast<float>(worst);
      check_.angle_error_max_deg = std::max(check_.angle_error_max_deg, worst);
      all.Add(total);
      of_chart[topology_.chart_of_face[f]].Add(total);
    }
    check_.angle_error_mean_deg = all.Mean();
    for (std::size_t c = 0; c < of_chart.size(); ++c) check_.charts[c].angle_error_mean_deg = of_chart[c].Mean();
  }

  void MeasureDensities() {
    using Share = std::pair<double, double>;  // density, area on the surface
    const std::vector<std::int32_t>& materials = options_.material_of_face;
    std::vector<std::vector<Share>> shares(static_cast<std::size_t>(options_.num_materials) + 1);
    std::vector<double> uv_area(shares.size(), 0.0);
    for (std::int64_t f = 0; f < num_faces(); ++f) {
      if (!sizes_[f].HasStretch()) continue;
      const std::size_t m = materials.empty() ? 0 : static_cast<std::size_t>(materials[f] + 1);
      const double area = std::abs(sizes_[f].uv_area);
      shares[m].emplace_back(std::sqrt(area / sizes_[f].surface_area), sizes_[f].surface_area);
      uv_area[m] += area;
    }
    for (std::size_t m = 0; m < shares.size(); ++m) {
      if (shares[m].empty()) continue;
      std::sort(shares[m].begin(), shares[m].end());
      double total = 0;
      for (const auto& [density, area] : shares[m]) total += area;
      const auto below = [&](double part) {
        double sum = 0;
        for (const auto& [density, area] : shares[m]) {
          sum += area;
          if (sum >= part * total) return density;
        }
        return shares[m].back().first;
      };
      check_.densities.push_back({static_cast<std::int32_t>(m) - 1, static_cast<std::int64_t>(shares[m].size()),
                                  std::sqrt(uv_area[m] / total) * options_.texture_size,
                                  below(0.05) * options_.texture_size, below(0.95) * options_.texture_size});
    }
    for (ChartCheck& chart : check_.charts) {
      if (chart.surface_area > 0) {
        chart.texels_per_unit = std::sqrt(chart.uv_area / chart.surface_area) * options_.texture_size;
      }
    }
  }

  static bool HasThreeCorners(const Face& f) { return f[0] != f[1] && f[1] != f[2] && f[2] != f[0]; }

  // Whether two half-edges are on one edge of the surface, to which faces without three different vertices do not
  // belong.
  bool OnOneEdge(std::int32_t c, std::int32_t d) const {
    const std::vector<Face>& faces = mesh_.faces;
    return HasThreeCorners(faces[c / 3]) && HasThreeCorners(faces[d / 3]) &&
           std::minmax({Origin(faces, c), Target(faces, c)}) == std::minmax({Origin(faces, d), Target(faces, d)});
  }

  void MeasureSeams() {
    check_.face_visibility = FaceVisibility(mesh_, execution_);
    if (!(check_.surface_area > 0)) return;
    std::vector<std::int32_t> half_edges;
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(is_on_seam_.size()); ++c) {
      if (is_on_seam_[c] != 0 && HasThreeCorners(mesh_.faces[c / 3])) half_edges.push_back(c);
    }
    const double length = SeamLength(mesh_, half_edges, [&](std::int32_t c) { return is_joined_[c] != 0; });
    check_.seam_length = length / std::sqrt(check_.surface_area);
    check_.seams = planish::MeasureSeams(mesh_, uv_, execution_);
  }

  void MeasureSpacing() {
    std::vector<OutlineSegment> segments;
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(3 * mesh_.faces.size()); ++c) {
      if (topology_.is_outline[c] == 0) continue;
      const std::array<Vec2, 3> p = InMap(c / 3);
      segments.push_back({p[Next(c % 3)], p[Prev(c % 3)], topology_.chart_of_face[c / 3]});
    }
    std::vector<std::int32_t> tile;
    for (const ChartCheck& chart : check_.charts) tile.push_back(chart.tile);
    const double texel = 1.0 / options_.texture_size;
    check_.spacing = FindChartSpacing(segments, tile, std::max(kSpacingReach, options_.min_padding) * texel,
                                      options_.min_padding * texel, kMaxSpacingTests, execution_);
    check_.spacing.nearest.distance /= texel;
    for (ChartPair& pair : check_.spacing.near) pair.distance /= texel;
    // Charts that overlap have the distance 0, however far apart their outlines are.
    for (std::size_t i = 0; i + 1 < check_.overlapping_pairs.size(); i += 2) {
      const auto [a, b] = std::minmax(topology_.chart_of_face[check_.overlapping_pairs[i]],
                                      topology_.chart_of_face[check_.overlapping_pairs[i + 1]]);
      if (a == b) continue;
      check_.spacing.nearest = {a, b, 0};
      break;
    }
  }

  const Mesh& mesh_;
  const CornerUv& uv_;
  const MapTopology& topology_;
  const MapCheckOptions& options_;
  const Execution& execution_;
  std::vector<FaceSizes> sizes_;
  std::vector<char> is_without_area_;   // per face: on the surface; empty: no such face
  std::vector<char> is_joined_;         // per half-edge: the map continues across it
  std::vector<char> is_on_seam_;        // per half-edge: it is joined to none on the same edge of the surface
  std::vector<std::int32_t> opposite_;  // the joined half-edge of a single face with the same orientation; -1 elsewhere
  MapCheck check_;
};

}  // namespace

MapCheck CheckMap(const Mesh& mesh, const CornerUv& uv, const MapTopology& topology, const MapCheckOptions& options,
                  const Execution& execution) {
  return MapJudge(mesh, uv, topology, options, execution).Run();
}

}  // namespace planish
