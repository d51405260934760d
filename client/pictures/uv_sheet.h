// The contents of both drawings of a UV layout (uv_preview.h): colours of faces, and the places of tiles on the page.
#pragma once

#include <cstdint>
#include <vector>

#include "client/files/uv_islands.h"
#include "client/pictures/canvas.h"
#include "client/pictures/uv_preview.h"
#include "core/mesh/mesh.h"

namespace planish {

constexpr int kScaleColours = 17;           // from shrunk to grown
constexpr int kTurnedOver = kScaleColours;  // the colour of triangles that face the other way than most of their chart
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
  std::vector<std::uint8_t> colour_of_island;  // by the area of the whole island
  std::int64_t turned_over = 0;                // faces
  int octaves = 1;                             // the scale ends at factors of 2^-octaves and 2^octaves

  // Islands in the order in which they are drawn: larger ones first, so that smaller ones on top of them are seen.
  std::vector<std::int32_t> order;
  std::vector<std::int32_t> frame_of_island;  // per island: the frame, of those side by side, in which it is drawn
  std::vector<std::int32_t> tile_of_frame;    // per frame: the number of its tile; -1: a frame round everything
  std::vector<Vec2> frame_low;                // per frame: its lower left corner in the map
  double frame_extent = 1;                    // length in the map of a frame's side
  SheetPlan plan;

  // The place of (u, v) in the frame, which is [0, 1]^2 with y downwards.
  Vec2 InFrame(std::int32_t frame, double u, double v) const {
    const Vec2 p = (Vec2(u, v) - frame_low[frame]) / frame_extent;
    return {p.x(), 1 - p.y()};
  }
};

UvSheet MakeUvSheet(const Mesh& mesh, const std::vector<double>& uv, const UvPreviewOptions& options);

}  // namespace planish
