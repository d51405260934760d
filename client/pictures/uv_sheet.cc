#include "client/pictures/uv_sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include "Eigen/Geometry"
#include "client/pictures/canvas.h"

namespace planish {
namespace {

constexpr double kSlack = 1e-5;             // length by which a chart may stick out of its tile
constexpr double kShareOffTheScale = 0.02;  // largest share of the surface that is off the scale
constexpr int kTilesInRow = 10, kMaxTile = 999;

struct Areas {
  std::vector<double> surface, map;  // per face; areas in the map are signed

  Areas(const Mesh& mesh, const std::vector<double>& uv) {
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      const Face& face = mesh.faces[f];
      const Vec3& p = mesh.positions[face[0]];
      surface.push_back((mesh.positions[face[1]] - p).cross(mesh.positions[face[2]] - p).norm() / 2);
      const double* t = uv.data() + 6 * f;
      map.push_back(((t[2] - t[0]) * (t[5] - t[1]) - (t[3] - t[1]) * (t[4] - t[0])) / 2);
    }
  }
};

std::uint8_t ScaleColour(double log_stretch, int octaves) {
  const double t = std::clamp(log_stretch / octaves, -1.0, 1.0);
  return static_cast<std::uint8_t>(std::lround((t + 1) / 2 * (kScaleColours - 1)));
}

void Colour(const Areas& areas, UvSheet* sheet) {
  const std::size_t num_faces = areas.surface.size();
  std::vector<double> signed_map(sheet->islands.count, 0.0), map(sheet->islands.count, 0.0);
  std::vector<double> surface(sheet->islands.count, 0.0);
  double whole_map = 0, whole_surface = 0;
  for (std::size_t f = 0; f < num_faces; ++f) {
    const std::int32_t i = sheet->islands.island_of_face[f];
    signed_map[i] += areas.map[f];
    map[i] += std::abs(areas.map[f]);
    surface[i] += areas.surface[f];
    whole_map += std::abs(areas.map[f]);
    whole_surface += areas.surface[f];
  }
  sheet->order.resize(sheet->islands.count);
  std::iota(sheet->order.begin(), sheet->order.end(), 0);
  std::stable_sort(sheet->order.begin(), sheet->order.end(),
                   [&](std::int32_t a, std::int32_t b) { return map[a] > map[b]; });
  const double whole = whole_map / whole_surface;
  const auto stretch = [&](double in_map, double on_surface) {
    const double log = std::log2(in_map / on_surface / whole);
    return std::isnan(log) ? 0.0 : log;
  };
  sheet->octaves = 4;
  for (const int octaves : {1, 2}) {
    double off = 0;
    for (std::size_t f = 0; f < num_faces; ++f) {
      if (std::abs(stretch(std::abs(areas.map[f]), areas.surface[f])) > octaves) off += areas.surface[f];
    }
    if (off > kShareOffTheScale * whole_surface) continue;
    sheet->octaves = octaves;
    break;
  }
  for (std::size_t f = 0; f < num_faces; ++f) {
    const bool turned = areas.map[f] * signed_map[sheet->islands.island_of_face[f]] < 0;
    sheet->turned_over += turned;
    sheet->colour_of_face.push_back(
        turned ? kTurnedOver : ScaleColour(stretch(std::abs(areas.map[f]), areas.surface[f]), sheet->octaves));
  }
  for (std::int32_t i = 0; i < sheet->islands.count; ++i) {
    sheet->colour_of_island.push_back(ScaleColour(stretch(map[i], surface[i]), sheet->octaves));
  }
}

// The tile that holds the box; -1: none does.
std::int32_t TileOf(const Eigen::AlignedBox2d& box) {
  const Vec2 corner = box.center().array().floor();
  if (corner.minCoeff() < 0 || corner.x() >= kTilesInRow || corner.y() > kMaxTile / kTilesInRow) return -1;
  const Eigen::AlignedBox2d tile(corner.array() - kSlack, corner.array() + 1 + kSlack);
  return tile.contains(box) ? static_cast<std::int32_t>(corner.x() + kTilesInRow * corner.y()) : -1;
}

void Frame(const Mesh& mesh, const std::vector<double>& uv, bool fit, UvSheet* sheet) {
  std::vector<Eigen::AlignedBox2d> boxes(sheet->islands.count);
  Eigen::AlignedBox2d all;
  for (std::size_t c = 0; c < 3 * mesh.faces.size(); ++c) {
    const Vec2 p(uv[2 * c], uv[2 * c + 1]);
    boxes[sheet->islands.island_of_face[c / 3]].extend(p);
    all.extend(p);
  }
  std::vector<std::int32_t> tiles;
  for (const Eigen::AlignedBox2d& box : boxes) tiles.push_back(TileOf(box));
  const std::set<std::int32_t> used(tiles.begin(), tiles.end());
  if (fit || used.contains(-1) || used.empty()) {
    if (used.empty()) all = Eigen::AlignedBox2d(Vec2::Zero(), Vec2::Ones());
    constexpr double kRoom = 1.04;
    sheet->frame_extent = std::max(kRoom * all.sizes().maxCoeff(), std::numeric_limits<double>::min());
    sheet->frame_low = {all.center().array() - sheet->frame_extent / 2};
    sheet->tile_of_frame = {-1};
    sheet->frame_of_island.assign(boxes.size(), 0);
  } else {
    sheet->tile_of_frame.assign(used.begin(), used.end());
    for (const std::int32_t t : used) sheet->frame_low.emplace_back(t % kTilesInRow, t / kTilesInRow);
    for (const std::int32_t t : tiles) {
      sheet->frame_of_island.push_back(static_cast<std::int32_t>(std::distance(used.begin(), used.find(t))));
    }
  }
  const int frames = static_cast<int>(sheet->tile_of_frame.size());
  SheetPlan& plan = sheet->plan;
  plan.columns = frames <= 4 ? frames : static_cast<int>(std::ceil(std::sqrt(frames)));
  plan.rows = (frames + plan.columns - 1) / plan.columns;
  if (frames > 1) plan.side = std::max(160, std::min(768, 2400 / plan.columns));
}

}  // namespace

Rgb SheetColour(int colour) {
  // ColorBrewer's RdBu, which colour-blind people can read as well; its middle a little darker, to be seen on white.
  static constexpr std::array<std::array<double, 3>, 9> kStops = {{{33, 102, 172},
                                                                   {67, 147, 195},
                                                                   {146, 197, 222},
                                                                   {196, 217, 229},
                                                                   {228, 228, 226},
                                                                   {246, 211, 193},
                                                                   {244, 165, 130},
                                                                   {214, 96, 77},
                                                                   {178, 24, 43}}};
  if (colour == kTurnedOver) return {255, 214, 0};
  const double at = colour * (kStops.size() - 1.0) / (kScaleColours - 1);
  const std::size_t low = std::min(static_cast<std::size_t>(at), kStops.size() - 2);
  const double share = at - static_cast<double>(low);
  Vec3 mixed;
  for (int k = 0; k < 3; ++k) mixed[k] = (1 - share) * kStops[low][k] + share * kStops[low + 1][k];
  return ToRgb(mixed / 255);
}

UvSheet MakeUvSheet(const Mesh& mesh, const std::vector<double>& uv, const UvPreviewOptions& options) {
  UvSheet sheet;
  sheet.islands = FindUvIslands(mesh, uv);
  Colour(Areas(mesh, uv), &sheet);
  Frame(mesh, uv, options.fit, &sheet);
  return sheet;
}

}  // namespace planish
