// What both drawings of a UV layout (uv_preview.h) show: colours of faces, and where tiles lie on the page.
#pragma once

#include <cstdint>
#include <vector>

#include "client/files/uv_islands.h"
#include "client/pictures/canvas.h"
#include "client/pictures/uv_preview.h"
#include "core/mesh/mesh.h"

namespace planish {

constexpr int kScaleColours = 17;           // from shrunk to grown
constexpr int kTurnedOver = kScaleColours;  // the colour of triangles against their chart
constexpr int kSheetColours = kScaleColours + 1;
Rgb SheetColour(int colour);
constexpr Rgb kPageColour = {236, 237, 240}, kTileColour = {255, 255, 255}, kInkColour = {38, 36, 48};
constexpr double kOutlineWidth = 1.3;  // pixels

// Where legend and tiles lie, in pixels.
struct SheetPlan {
  int columns = 1, rows = 1;
  int side = 1024;  // of a tile
  static constexpr int kMargin = 20, kBarWidth = 340, kBarHeight = 14, kTickHeight = 5;

  int Left(int frame) const { return kMargin + frame % columns * (side + kMargin); }
  int Top(int frame) const { return kMargin + frame / columns * (side + kMargin); }
  int BarTop() const { return Top(rows * columns - 1) + side + kMargin; }
  int Width() const { return kMargin + columns * (side + kMargin); }
  int Height() const { return BarTop() + kBarHeight + kTickHeight + kMargin; }
};

struct UvSheet {
  UvIslands islands;
  std::vector<std::uint8_t> colour_of_face;
  std::vector<std::uint8_t> colour_of_island;  // of its area as a whole
  std::int64_t turned_over = 0;                // faces
  int octaves = 1;                             // log2 at either end of the scale

  // Islands in the order in which they are drawn, the larger first: where they lie on each other, all are seen.
  std::vector<std::int32_t> order;
  std::vector<std::int32_t> frame_of_island;  // frames are what stands side by side
  std::vector<std::int32_t> tile_of_frame;    // number of the tile, -1: a frame round everything
  std::vector<Vec2> frame_low;                // in the map
  double frame_extent = 1;                    // of the map along a frame's side
  SheetPlan plan;

  // In [0, 1]^2 of the frame, y downwards.
  Vec2 InFrame(std::int32_t frame, double u, double v) const {
    const Vec2 p = (Vec2(u, v) - frame_low[frame]) / frame_extent;
    return {p.x(), 1 - p.y()};
  }
};

UvSheet MakeUvSheet(const Mesh& mesh, const std::vector<double>& uv, const UvPreviewOptions& options);

}  // namespace planish
