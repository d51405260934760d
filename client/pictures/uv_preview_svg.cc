#include <algorithm>
#include <cmath>
#include <string_view>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/pictures/uv_preview.h"
#include "client/pictures/uv_sheet.h"

namespace planish {
namespace {

constexpr int kGrid = 4096;  // units per side of a tile
constexpr std::size_t kMaxEdges = 400000;

// An edge of path number `path`, from one place (UvIslands::place_of_corner) to another.
struct PathEdge {
  std::int32_t path, from, to;
};

struct GridPoint {
  int x, y;
  bool operator==(const GridPoint&) const = default;
};

std::string Hex(const Rgb& colour) {
  return absl::StrFormat("#%02x%02x%02x", colour.r, colour.g, colour.b);
}

class Paths {
 public:
  Paths(const std::vector<double>& uv, const UvSheet& sheet) : sheet_(sheet), corner_(sheet.islands.num_places) {
    const std::vector<std::int32_t>& place = sheet.islands.place_of_corner;
    for (std::size_t c = 0; c < place.size(); ++c) corner_[place[c]] = {uv[2 * c], uv[2 * c + 1]};
  }

  // The SVG path data of the edges [begin, end), all of one path, drawn in `frame`. Edges are joined end to end.
  std::string Data(std::int32_t frame, const PathEdge* begin, const PathEdge* end) const {
    std::vector<PathEdge> edges(begin, end);
    std::sort(edges.begin(), edges.end(),
              [](const PathEdge& a, const PathEdge& b) { return std::tie(a.from, a.to) < std::tie(b.from, b.to); });
    std::vector<char> taken(edges.size(), 0);
    // Edges from one place are taken in order. At the first edge from each place: the first edge from there that may
    // not be taken yet.
    std::vector<std::size_t> next_from(edges.size());
    for (std::size_t i = 0; i < edges.size(); ++i) next_from[i] = i;
    std::string data;
    std::vector<GridPoint> line;
    for (std::size_t start = 0; start < edges.size(); ++start) {
      if (taken[start]) continue;
      line = {At(frame, edges[start].from)};
      std::int32_t place = edges[start].from;
      for (std::size_t i = start; i < edges.size();) {
        taken[i] = 1;
        place = edges[i].to;
        Extend(At(frame, place), &line);
        const auto first = static_cast<std::size_t>(
            std::lower_bound(edges.begin(), edges.end(), place,
                             [](const PathEdge& e, std::int32_t value) { return e.from < value; }) -
            edges.begin());
        if (first == edges.size() || edges[first].from != place) break;
        std::size_t& next = next_from[first];
        while (next < edges.size() && edges[next].from == place && taken[next]) ++next;
        i = next < edges.size() && edges[next].from == place ? next : edges.size();
      }
      Append(line, place == edges[start].from, &data);
    }
    return data;
  }

 private:
  GridPoint At(std::int32_t frame, std::int32_t place) const {
    const Vec2 p = kGrid * sheet_.InFrame(frame, corner_[place].x(), corner_[place].y());
    return {static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y()))};
  }

  // Appends `p` to `line`, unless it repeats the last point. Removes the last point if it lies on the way to `p`.
  static void Extend(const GridPoint& p, std::vector<GridPoint>* line) {
    if (p == line->back()) return;
    if (line->size() > 1) {
      const GridPoint &a = (*line)[line->size() - 2], &b = line->back();
      const std::int64_t x1 = b.x - a.x, y1 = b.y - a.y, x2 = p.x - b.x, y2 = p.y - b.y;
      if (x1 * y2 == x2 * y1 && x1 * x2 + y1 * y2 > 0) line->pop_back();
    }
    line->push_back(p);
  }

  static void Append(const std::vector<GridPoint>& line, bool closed, std::string* data) {
    const std::size_t size = line.size() - (closed && line.size() > 1);
    if (size < 2) return;
    absl::StrAppend(data, "M", line[0].x, line[0].y < 0 ? "" : " ", line[0].y, "l");
    for (std::size_t i = 1; i < size; ++i) {
      const int x = line[i].x - line[i - 1].x, y = line[i].y - line[i - 1].y;
      absl::StrAppend(data, i == 1 || x < 0 ? "" : " ", x, y < 0 ? "" : " ", y);
    }
    if (closed) data->push_back('z');
  }

  const UvSheet& sheet_;
  std::vector<Vec2> corner_;
};

// The edges round the areas of one colour in each island, which make one path. These are the edges of all faces, turned
// counter-clockwise, without pairs that two faces of one path pass in opposite directions.
std::vector<PathEdge> ColourBorders(const std::vector<double>& uv, const UvSheet& sheet, bool by_island) {
  const std::vector<std::int32_t>& place = sheet.islands.place_of_corner;
  std::vector<PathEdge> edges;
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(sheet.colour_of_face.size()); ++f) {
    const double* t = uv.data() + 6 * static_cast<std::size_t>(f);
    const double area = (t[2] - t[0]) * (t[5] - t[1]) - (t[3] - t[1]) * (t[4] - t[0]);
    const std::int32_t island = sheet.islands.island_of_face[f];
    const int colour = by_island ? sheet.colour_of_island[island] : sheet.colour_of_face[f];
    for (std::int32_t k = 0; k < 3; ++k) {
      std::int32_t from = place[3 * f + k], to = place[3 * f + Next(k)];
      if (area < 0) std::swap(from, to);
      if (from != to) edges.push_back({island * kSheetColours + colour, from, to});
    }
  }
  const auto key = [](const PathEdge& e) {
    return std::make_tuple(e.path, std::min(e.from, e.to), std::max(e.from, e.to));
  };
  std::sort(edges.begin(), edges.end(), [&](const PathEdge& a, const PathEdge& b) {
    return std::make_tuple(key(a), a.from) < std::make_tuple(key(b), b.from);
  });
  std::vector<PathEdge> left;
  for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    while (end < edges.size() && key(edges[end]) == key(edges[begin])) ++end;
    // Sorted by `from`: one direction first, then the other.
    const std::size_t middle =
        static_cast<std::size_t>(std::find_if(edges.begin() + begin, edges.begin() + end,
                                              [&](const PathEdge& e) { return e.from != edges[begin].from; }) -
                                 edges.begin());
    const std::size_t pairs = std::min(middle - begin, end - middle);
    left.insert(left.end(), edges.begin() + begin + pairs, edges.begin() + middle);
    left.insert(left.end(), edges.begin() + middle + pairs, edges.begin() + end);
  }
  return left;
}

// The outlines of all islands, sorted by island. The path is the number of the island.
std::vector<PathEdge> Outlines(const UvSheet& sheet) {
  const UvIslands& islands = sheet.islands;
  std::vector<PathEdge> edges;
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(islands.is_outline.size()); ++c) {
    if (!islands.is_outline[c]) continue;
    const std::int32_t f = c - c % 3;
    edges.push_back({islands.island_of_face[c / 3], islands.place_of_corner[f + Next(c % 3)],
                     islands.place_of_corner[f + Prev(c % 3)]});
  }
  std::stable_sort(edges.begin(), edges.end(), [](const PathEdge& a, const PathEdge& b) { return a.path < b.path; });
  return edges;
}

// Calls visit(path, begin, end) for the edges of each path.
template <typename Visit>
void ForEachPath(const std::vector<PathEdge>& edges, const Visit& visit) {
  for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    while (end < edges.size() && edges[end].path == edges[begin].path) ++end;
    visit(edges[begin].path, edges.data() + begin, edges.data() + end);
  }
}

std::string Rectangle(double x, double y, double width, double height, std::string_view fill) {
  return absl::StrFormat("<rect x=\"%g\" y=\"%g\" width=\"%g\" height=\"%g\" fill=\"%s\"/>\n", x, y, width, height,
                         fill);
}

std::string Text(double x, double y, std::string_view anchor, std::string_view text) {
  return absl::StrFormat("<text x=\"%g\" y=\"%g\" text-anchor=\"%s\">%s</text>\n", x, y, anchor, text);
}

// The style sheet. Fills have lines of their own colour, which close the hairlines between them. `unit`: the length of
// a pixel.
std::string Style(double unit) {
  std::string style = "<style>";
  for (int i = 0; i < kSheetColours; ++i) {
    const std::string colour = Hex(SheetColour(i));
    absl::StrAppend(&style, ".c", i, "{fill:", colour, ";stroke:", colour, ";stroke-width:", 0.5 * unit, "}");
  }
  return absl::StrCat(style, ".o{fill:none;stroke:", Hex(kInkColour), ";stroke-width:", kOutlineWidth * unit,
                      "}</style>\n");
}

std::string Legend(const UvSheet& sheet, bool by_island) {
  constexpr double kBar = SheetPlan::kBarWidth, kHeight = SheetPlan::kBarHeight, kBand = kBar / kScaleColours;
  const double left = SheetPlan::kMargin, top = sheet.plan.BarTop();
  std::string svg = absl::StrFormat("<g font-family=\"sans-serif\" font-size=\"13\" fill=\"%s\">\n", Hex(kInkColour));
  for (int i = 0; i < kScaleColours; ++i) {
    absl::StrAppend(&svg, Rectangle(left + kBand * i, top, kBand, kHeight, Hex(SheetColour(i))));
  }
  for (int octave = -sheet.octaves; octave <= sheet.octaves; ++octave) {
    const double x = left + kBar / 2 + octave * (kBar - kBand) / (2.0 * sheet.octaves);
    absl::StrAppend(&svg, Rectangle(x - 1, top + kHeight, 2, SheetPlan::kTickHeight, Hex(kInkColour)));
    const std::string factor = octave < 0 ? absl::StrCat("1/", 1 << -octave) : absl::StrCat(1 << octave);
    absl::StrAppend(&svg, Text(x, top + kHeight + 19, "middle", factor));
  }
  const double x = left + kBar + 16;
  absl::StrAppend(&svg, Text(x, top + 12, "start",
                             absl::StrCat("area in the map, relative to the whole",
                                          by_island ? ", of each chart (too many triangles to show each)" : "")));
  absl::StrAppend(
      &svg,
      Text(x, top + 31, "start",
           absl::StrCat(sheet.islands.count, sheet.islands.count == 1 ? " chart, " : " charts, ",
                        sheet.colour_of_face.size(), " triangles",
                        sheet.turned_over > 0 ? absl::StrCat(", ", sheet.turned_over, " turned over (yellow)") : "")));
  return svg + "</g>\n";
}

}  // namespace

std::string UvPreviewSvg(const Mesh& mesh, const std::vector<double>& uv, const UvPreviewOptions& options) {
  const UvSheet sheet = MakeUvSheet(mesh, uv, options);
  const SheetPlan& plan = sheet.plan;
  std::vector<PathEdge> fills = ColourBorders(uv, sheet, false);
  const bool by_island = fills.size() > kMaxEdges;
  if (by_island) fills = ColourBorders(uv, sheet, true);

  // The paths of each island: its fills, then its outline. Class c3 is colour 3, class o the outline.
  std::vector<std::string> drawing(sheet.islands.count);
  const Paths paths(uv, sheet);
  ForEachPath(fills, [&](std::int32_t path, const PathEdge* begin, const PathEdge* end) {
    const std::int32_t island = path / kSheetColours;
    const std::string data = paths.Data(sheet.frame_of_island[island], begin, end);
    if (data.empty()) return;
    absl::StrAppend(&drawing[island], "<path class=\"c", path % kSheetColours, "\" d=\"", data, "\"/>\n");
  });
  ForEachPath(Outlines(sheet), [&](std::int32_t island, const PathEdge* begin, const PathEdge* end) {
    const std::string data = paths.Data(sheet.frame_of_island[island], begin, end);
    if (!data.empty()) absl::StrAppend(&drawing[island], "<path class=\"o\" d=\"", data, "\"/>\n");
  });

  const int text_room = 18;
  std::string svg = absl::StrFormat("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\">\n", plan.Width(),
                                    plan.Height() + text_room);
  absl::StrAppend(&svg, Rectangle(0, 0, plan.Width(), plan.Height() + text_room, Hex(kPageColour)));
  absl::StrAppend(&svg, Style(1.0 * kGrid / plan.side));
  const auto frames = static_cast<std::int32_t>(sheet.tile_of_frame.size());
  for (std::int32_t frame = 0; frame < frames; ++frame) {
    const int left = plan.Left(frame), top = plan.Top(frame);
    absl::StrAppend(&svg, Rectangle(left, top, plan.side, plan.side, Hex(kTileColour)));
    if (frames > 1) {
      absl::StrAppend(&svg, "<g font-family=\"sans-serif\" font-size=\"12\" fill=\"", Hex(kInkColour), "\">",
                      Text(left, top - 5, "start", absl::StrCat("tile ", 1001 + sheet.tile_of_frame[frame])), "</g>\n");
    }
    absl::StrAppend(&svg, absl::StrFormat("<g transform=\"translate(%d %d) scale(%g)\" stroke-linejoin=\"round\">\n",
                                          left, top, 1.0 * plan.side / kGrid));
    for (const std::int32_t island : sheet.order) {
      if (sheet.frame_of_island[island] == frame) svg += drawing[island];
    }
    svg += "</g>\n";
  }
  return svg + Legend(sheet, by_island) + "</svg>\n";
}

}  // namespace planish
