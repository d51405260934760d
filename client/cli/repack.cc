#include "client/cli/repack.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "Eigen/Geometry"
#include "client/cli/text.h"
#include "client/files/uv_islands.h"
#include "core/mesh/predicates.h"
#include "planish/error.h"

namespace planish::cli {
namespace {

// An island whose area in the map is below this fraction of its squared extent counts as having no area: the rest may
// be rounding error.
constexpr double kNoArea = 1e-6;
// An island whose extent in the map, times its density, is below kPoint counts as a point. It is packed as a square of
// side kSquareSide, which the packer enlarges to a texel.
constexpr double kSquareSide = 1e-6, kPoint = 1e-9;
// The size that an island gets if it is a point on the surface, as a fraction of the size of the whole surface.
constexpr double kPointSize = 1e-6;

Vec2 At(const std::vector<double>& uv, std::size_t corner) {
  return {uv[2 * corner], uv[2 * corner + 1]};
}

double SurfaceArea(const Mesh& mesh, std::size_t f) {
  const Face& face = mesh.faces[f];
  const Vec3& p = mesh.positions[face[0]];
  return (mesh.positions[face[1]] - p).cross(mesh.positions[face[2]] - p).norm() / 2;
}

// Sizes of an island on the surface and in the map.
struct Extent {
  double surface_area = 0, surface_length = 0;  // a length is the sum of the lengths of all edges of all triangles
  double map_area = 0, map_length = 0, signed_map_area = 0;
  Eigen::AlignedBox2d box;

  bool HasArea() const { return map_area > kNoArea * box.sizes().squaredNorm(); }
};

std::vector<Extent> Measure(const Mesh& mesh, const std::vector<double>& uv, const UvIslands& islands) {
  std::vector<Extent> extents(islands.count);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    Extent& extent = extents[islands.island_of_face[f]];
    const Face& face = mesh.faces[f];
    const Vec3 &p = mesh.positions[face[0]], &q = mesh.positions[face[1]], &r = mesh.positions[face[2]];
    extent.surface_area += SurfaceArea(mesh, f);
    extent.surface_length += (q - p).norm() + (r - q).norm() + (p - r).norm();
    const Vec2 a = At(uv, 3 * f), b = At(uv, 3 * f + 1), c = At(uv, 3 * f + 2);
    const double area = ((b - a).x() * (c - a).y() - (b - a).y() * (c - a).x()) / 2;
    extent.map_area += std::abs(area);
    extent.signed_map_area += area;
    extent.map_length += (b - a).norm() + (c - b).norm() + (a - c).norm();
    for (const Vec2& t : {a, b, c}) extent.box.extend(t);
  }
  return extents;
}

// Per island: length on the surface divided by length in the map.
std::vector<double> SurfaceScales(const std::vector<Extent>& extents) {
  double whole_area = 0;
  for (const Extent& extent : extents) whole_area += extent.surface_area;
  std::vector<double> scales;
  for (const Extent& extent : extents) {
    double scale = 1;
    if (extent.HasArea() && extent.surface_area > 0) {
      scale = std::sqrt(extent.surface_area / extent.map_area);
    } else if (extent.map_length > 0 && extent.surface_length > 0) {
      scale = extent.surface_length / extent.map_length;
    } else if (extent.map_length > 0 && whole_area > 0) {
      scale = kPointSize * std::sqrt(whole_area) / extent.map_length;
    }
    scales.push_back(scale);
  }
  return scales;
}

// Per island: the mean weight of its faces.
std::vector<double> MeanWeights(const Mesh& mesh, const UvIslands& islands, const std::vector<double>& face_weights) {
  struct Sums {
    double area = 0, weighted = 0, faces = 0, counted = 0;
  };
  std::vector<Sums> sums(islands.count);
  for (std::size_t f = 0; f < face_weights.size(); ++f) {
    const double area = SurfaceArea(mesh, f);
    Sums& sum = sums[islands.island_of_face[f]];
    sum.area += area;
    sum.weighted += area * face_weights[f];
    sum.faces += 1;
    sum.counted += face_weights[f];
  }
  std::vector<double> means;
  for (const Sums& sum : sums) means.push_back(sum.area > 0 ? sum.weighted / sum.area : sum.counted / sum.faces);
  return means;
}

// The islands as charts, with positions relative to the island's lower left corner; and, for each corner of the mesh,
// the index of its position in its chart.
struct Charts {
  std::vector<PackChart> charts;
  std::vector<std::int32_t> position_of_corner;
};

Charts MakeCharts(const Mesh& mesh, const std::vector<double>& uv, const UvIslands& islands,
                  const std::vector<Extent>& extents) {
  Charts result;
  result.charts.resize(islands.count);
  result.position_of_corner.resize(3 * mesh.faces.size());
  std::vector<std::vector<std::int32_t>> faces(islands.count);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    faces[islands.island_of_face[f]].push_back(static_cast<std::int32_t>(f));
  }
  // Two islands may touch at a place, so each island numbers its places separately.
  std::vector<std::int32_t> number(islands.num_places), island_of_number(islands.num_places, -1);
  for (std::int32_t i = 0; i < islands.count; ++i) {
    PackChart& chart = result.charts[i];
    for (const std::int32_t f : faces[i]) {
      Face face;
      for (std::int32_t k = 0; k < 3; ++k) {
        const std::int32_t corner = 3 * f + k, place = islands.place_of_corner[corner];
        if (island_of_number[place] != i) {
          island_of_number[place] = i;
          number[place] = static_cast<std::int32_t>(chart.positions.size());
          chart.positions.push_back(At(uv, corner) - extents[i].box.min());
        }
        face[k] = result.position_of_corner[corner] = number[place];
      }
      chart.faces.push_back(face);
    }
  }
  return result;
}

// For an island that is a point: replaces the faces of its chart by a small square around 0, so that the packer has
// something to place. The island's own positions, which are all near 0, stay the first ones, so their indices stay
// valid, and move with the square.
void MakeSquare(PackChart* chart) {
  const auto first = static_cast<std::int32_t>(chart->positions.size());
  const double half = kSquareSide / chart->density / 2;
  for (const Vec2& p : {Vec2(-half, -half), Vec2(half, -half), Vec2(half, half), Vec2(-half, half)}) {
    chart->positions.push_back(p);
  }
  chart->faces = {{first, first + 1, first + 2}, {first, first + 2, first + 3}};
}

std::int64_t CountLost(const std::vector<double>& before, const std::vector<float>& after) {
  std::int64_t lost = 0;
  const auto now = [&](std::size_t corner) -> Vec2 { return {after[2 * corner], after[2 * corner + 1]}; };
  for (std::size_t c = 0; 2 * c < after.size(); c += 3) {
    const int orientation = Orientation(At(before, c), At(before, c + 1), At(before, c + 2));
    lost += orientation != 0 && orientation != Orientation(now(c), now(c + 1), now(c + 2));
  }
  return lost;
}

double CoveredShare(const std::vector<float>& uv, int tiles) {
  constexpr int kGrid = 1024, kTilesInRow = 10;
  constexpr std::size_t kPoints = static_cast<std::size_t>(kGrid) * kGrid;
  std::vector<char> covered(kPoints * static_cast<std::size_t>(tiles), 0);
  for (std::size_t c = 0; 2 * c < uv.size(); c += 3) {
    std::array<Vec2, 3> p;
    Eigen::AlignedBox2d box;
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = kGrid * Vec2(uv[2 * (c + k)], uv[2 * (c + k) + 1]);
      box.extend(p[k]);
    }
    const int tile_x = static_cast<int>(box.center().x() / kGrid), tile_y = static_cast<int>(box.center().y() / kGrid);
    const std::size_t first = kPoints * static_cast<std::size_t>(tile_x + kTilesInRow * tile_y);
    const auto side = [&](int k, const Vec2& q) {
      const Vec2 &a = p[Next(k)], &b = p[Prev(k)];
      return (b - a).x() * (q - a).y() - (b - a).y() * (q - a).x();
    };
    for (int y = static_cast<int>(std::ceil(box.min().y() - 0.5)); y + 0.5 <= box.max().y(); ++y) {
      for (int x = static_cast<int>(std::ceil(box.min().x() - 0.5)); x + 0.5 <= box.max().x(); ++x) {
        const Vec2 q(x + 0.5, y + 0.5);
        const auto [least, most] = std::minmax({side(0, q), side(1, q), side(2, q)});
        if (least < 0 && most > 0) continue;
        covered[first + static_cast<std::size_t>(y - kGrid * tile_y) * kGrid + (x - kGrid * tile_x)] = 1;
      }
    }
  }
  return static_cast<double>(std::count(covered.begin(), covered.end(), 1)) / static_cast<double>(covered.size());
}

constexpr int kLeastTextureSize = 16, kMostTextureSize = 65536;

// The smallest power of two for the texture size with which the tiles may have room for `area` square texels; at most
// kMostTextureSize.
int LeastTextureSize(double area, const PackOptions& atlas) {
  int size = kLeastTextureSize;
  while (size < kMostTextureSize && (size <= atlas.padding + 1 || area > 1.0 * atlas.tiles * size * size)) size *= 2;
  return size;
}

Error NoRoom(double wanted, double most, const PackOptions& atlas) {
  const std::string size = std::to_string(atlas.texture_size);
  return Error(ErrorCode::kInvalidArgument, "OPTIONS_INVALID",
               "texels_per_unit: a texture of " + size + " x " + size + " texels" +
                   (atlas.tiles > 1 ? " in each tile" : "") + " has room for at most " + Significant(most, 4) +
                   " texels per unit, " + Significant(most / wanted, 3) + " of the " + Significant(wanted, 6) +
                   " asked for; ask for fewer, or allow more tiles" +
                   (atlas.texture_size < kMostTextureSize ? " or a larger texture" : ""),
               {{"field", "texels_per_unit"}, {"most", Significant(most, 6)}, {"texture_size", size}});
}

}  // namespace

Repacking Repack(const Mesh& mesh, const std::vector<double>& uv, const std::vector<std::int64_t>& polygon,
                 const RepackOptions& options, const Execution& execution) {
  Repacking result;
  const UvIslands islands = FindUvIslands(mesh, uv, polygon);
  const std::vector<Extent> extents = Measure(mesh, uv, islands);
  Charts charts = MakeCharts(mesh, uv, islands, extents);

  std::vector<double> scales(extents.size(), 1.0);
  if (!options.keep_density) scales = SurfaceScales(extents);
  if (!options.face_weights.empty()) {
    const std::vector<double> weights = MeanWeights(mesh, islands, options.face_weights);
    for (std::size_t i = 0; i < scales.size(); ++i) scales[i] *= weights[i];
  }
  // The packer needs densities only relative to each other. They are scaled so that all islands together have the area
  // of one tile.
  double whole_area = 0;
  for (std::size_t i = 0; i < extents.size(); ++i) whole_area += extents[i].map_area * scales[i] * scales[i];
  const double size = whole_area > 0 ? std::sqrt(whole_area) : 1;
  for (std::size_t i = 0; i < extents.size(); ++i) {
    PackChart& chart = charts.charts[i];
    chart.density = scales[i] / size;
    if (extents[i].box.sizes().maxCoeff() * chart.density < kPoint) MakeSquare(&chart);
  }

  const bool have_area = std::any_of(extents.begin(), extents.end(), [](const Extent& each) { return each.HasArea(); });
  const double wanted = have_area ? options.texels_per_unit : 0;
  PackOptions atlas = options.atlas;
  if (wanted > 0 && options.finds_texture_size) {
    atlas.texture_size = LeastTextureSize(whole_area * wanted * wanted, atlas);
  }
  double density = 0;
  while (true) {
    if (wanted > 0) atlas.most_scale = wanted * size / atlas.texture_size;
    result.packing = Pack(charts.charts, atlas, execution);
    if (execution.IsCancelled()) return result;
    density = result.packing.scale / size * atlas.texture_size;
    if (density >= (1 - 1e-9) * wanted) break;
    if (!options.finds_texture_size || atlas.texture_size >= kMostTextureSize) throw NoRoom(wanted, density, atlas);
    atlas.texture_size *= 2;
  }
  result.texture_size = atlas.texture_size;
  result.uv.resize(uv.size());
  for (std::size_t c = 0; 2 * c < uv.size(); ++c) {
    const std::int32_t island = islands.island_of_face[c / 3];
    const Vec2 p = result.packing.charts[island](charts.charts[island].positions[charts.position_of_corner[c]]);
    result.uv[2 * c] = static_cast<float>(p.x());
    result.uv[2 * c + 1] = static_cast<float>(p.y());
  }
  result.islands = islands.count;
  for (const Extent& extent : extents) {
    result.mirrored += extent.signed_map_area < 0;
    result.without_area += !extent.HasArea();
  }
  result.lost_to_rounding = CountLost(uv, result.uv);
  result.covered = CoveredShare(result.uv, result.packing.tiles);
  if (!options.keep_density && have_area) result.texels_per_unit = density;
  return result;
}

}  // namespace planish::cli
