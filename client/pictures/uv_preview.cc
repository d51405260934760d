#include "client/pictures/uv_preview.h"

#include <array>

#include "client/pictures/canvas.h"
#include "client/pictures/uv_sheet.h"

namespace planish {
namespace {

constexpr int kSheetOversampling = 3;  // samples per pixel and direction

void Copy(const Image& from, int left, int top, Image* to) {
  for (int y = 0; y < from.height; ++y) {
    for (int x = 0; x < from.width; ++x) to->At(left + x, top + y) = from.At(x, y);
  }
}

// Draws one frame. `faces`: by island.
Image DrawFrame(const std::vector<double>& uv, const UvSheet& sheet, std::int32_t frame,
                const std::vector<std::vector<std::int32_t>>& faces) {
  const int side = sheet.plan.side;
  Canvas canvas(side, side, kSheetOversampling, kTileColour);
  const auto at = [&](std::int32_t corner) -> Vec2 {
    return side * kSheetOversampling * sheet.InFrame(frame, uv[2 * corner], uv[2 * corner + 1]);
  };
  double depth = 0;
  for (const std::int32_t island : sheet.order) {
    if (sheet.frame_of_island[island] != frame) continue;
    ++depth;
    for (const std::int32_t f : faces[island]) {
      std::array<Vec3, 3> points;
      for (std::int32_t k = 0; k < 3; ++k)
        points[k] << at(3 * f + k), depth + (sheet.colour_of_face[f] == kTurnedOver ? 0.5 : 0.0);
      const Rgb colour = SheetColour(sheet.colour_of_face[f]);
      canvas.Fill(points, [&](const Vec3&) { return colour; });
    }
    for (const std::int32_t f : faces[island]) {
      for (std::int32_t k = 0; k < 3; ++k) {
        if (!sheet.islands.is_outline[3 * f + k]) continue;
        canvas.Stroke(at(3 * f + Next(k)), at(3 * f + Prev(k)), kOutlineWidth * kSheetOversampling, kInkColour);
      }
    }
  }
  return canvas.Downsample();
}

Image DrawLegend(const UvSheet& sheet) {
  constexpr int kBar = SheetPlan::kBarWidth, kBarHeight = SheetPlan::kBarHeight;
  const double s = kSheetOversampling;
  Canvas canvas(kBar + 3 * kBarHeight, kBarHeight + SheetPlan::kTickHeight, kSheetOversampling, kPageColour);
  for (int i = 0; i < kScaleColours; ++i) {
    canvas.Box({s * kBar * i / kScaleColours, 0}, {s * kBar * (i + 1) / kScaleColours, s * kBarHeight}, SheetColour(i));
  }
  for (int tick = 0; tick <= 2 * sheet.octaves; ++tick) {
    // Each band of colour is centred on its value, so the scale ends at the middles of the outermost bands.
    const double band = 1.0 / kScaleColours, x = band / 2 + (1 - band) * tick / (2 * sheet.octaves);
    canvas.Box({s * (kBar * x - 1), s * kBarHeight}, {s * (kBar * x + 1), s * (kBarHeight + SheetPlan::kTickHeight)},
               kInkColour);
  }
  if (sheet.turned_over > 0) {
    canvas.Box({s * (kBar + kBarHeight), 0}, {s * (kBar + 2 * kBarHeight), s * kBarHeight}, SheetColour(kTurnedOver));
  }
  return canvas.Downsample();
}

}  // namespace

Image DrawUvPreview(const Mesh& mesh, const std::vector<double>& uv, const UvPreviewOptions& options) {
  const UvSheet sheet = MakeUvSheet(mesh, uv, options);
  std::vector<std::vector<std::int32_t>> faces(sheet.islands.count);
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(mesh.faces.size()); ++f) {
    faces[sheet.islands.island_of_face[f]].push_back(f);
  }
  Image image(sheet.plan.Width(), sheet.plan.Height());
  image.pixels.assign(image.pixels.size(), kPageColour);
  for (std::int32_t frame = 0; frame < static_cast<std::int32_t>(sheet.tile_of_frame.size()); ++frame) {
    Copy(DrawFrame(uv, sheet, frame, faces), sheet.plan.Left(frame), sheet.plan.Top(frame), &image);
  }
  Copy(DrawLegend(sheet), SheetPlan::kMargin, sheet.plan.BarTop(), &image);
  return image;
}

}  // namespace planish
