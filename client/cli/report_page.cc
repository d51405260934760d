#include "client/cli/report_page.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <functional>
#include <limits>
#include <set>
#include <utility>

#include "Eigen/Geometry"
#include "absl/strings/escaping.h"
#include "client/cli/check.h"
#include "client/cli/text.h"
#include "client/texture/image.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/visibility.h"

// PLANISH_REPORT is the directory of the files, which CMake passes: the assembler copies the bytes, so that no compiler
// has to parse them.
#define PLANISH_INCLUDE(symbol, file)                    \
  asm(".pushsection .rodata\n" symbol                    \
      ":\n"                                              \
      ".incbin \"" PLANISH_REPORT "/" file "\"\n" symbol \
      "_end:\n"                                          \
      ".byte 0\n"                                        \
      ".popsection\n")
PLANISH_INCLUDE("planish_report_template", "template.html");
PLANISH_INCLUDE("planish_sheet_template", "sheet_template.html");

extern "C" {
extern const char planish_report_template[];
extern const char planish_report_template_end[];
extern const char planish_sheet_template[];
extern const char planish_sheet_template_end[];
}

namespace planish::cli {
namespace {

constexpr double kSteps = 65535;                                // of positions and UV along their extent
constexpr double kMostUvOfTwoBytes = 1.5;                       // widths of an image
constexpr double kStretchOctaves = 4;                           // that the page tells apart (client/report/src/data.ts)
constexpr int kTopByte = 254, kNoStretch = 255, kNoSeam = 255;  // of a byte
constexpr std::uint8_t kMirroredFace = 16;
constexpr std::size_t kMaxFindingFaces = 2000, kMaxNamedPairs = 20;
constexpr std::size_t kMostResiduals = 10000;  // of steps of charts: 100 KB
constexpr std::string_view kCardBegin = "<script type=\"application/json\" id=\"planish-card\">";
constexpr int kZlibLevel = 3;  // level 6 makes a page of a million triangles 5 % smaller, and takes longer
constexpr std::size_t kMostBytesBeforeCardEnds = std::size_t{1} << 20;

void AppendVarint(std::uint64_t value, std::string* bytes) {
  for (; value >= 128; value >>= 7) bytes->push_back(static_cast<char>(value | 128));
  bytes->push_back(static_cast<char>(value));
}

// Encodes differences of successive numbers; small differences take a byte.
class Differences {
 public:
  void Add(std::int64_t value) {
    const std::int64_t difference = value - last_;
    last_ = value;
    AppendVarint(difference < 0 ? 2 * static_cast<std::uint64_t>(-(difference + 1)) + 1
                                : 2 * static_cast<std::uint64_t>(difference),
                 &bytes_);
  }
  std::string Take() { return std::move(bytes_); }

 private:
  std::int64_t last_ = 0;
  std::string bytes_;
};

// Encodes each component of `count` values: first the low bytes of all differences, then the high bytes.
std::string Planes(std::size_t count, int components, const std::function<double(std::size_t, int)>& at) {
  std::string bytes(2 * count * static_cast<std::size_t>(components), '\0');
  for (int k = 0; k < components; ++k) {
    char* const low = bytes.data() + 2 * static_cast<std::size_t>(k) * count;
    std::uint16_t last = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const auto value = static_cast<std::uint16_t>(std::lround(kSteps * std::clamp(at(i, k), 0.0, 1.0)));
      const auto difference = static_cast<std::int16_t>(static_cast<std::uint16_t>(value - last));
      last = value;
      const auto code = static_cast<std::uint16_t>((difference << 1) ^ (difference >> 15));
      low[i] = static_cast<char>(code & 255);
      low[count + i] = static_cast<char>(code >> 8);
    }
  }
  return bytes;
}

Json Rounded(double value, int digits) {
  return std::isfinite(value) ? Json::parse(Significant(value, digits)) : Json();
}

std::string Deflated(const std::string& bytes) {
  uLongf size = compressBound(bytes.size());
  std::string result(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(result.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                bytes.size(), kZlibLevel) != Z_OK) {
    throw Error(ErrorCode::kInternal, "OUT_OF_MEMORY", "the report's data cannot be compressed");
  }
  result.resize(size);
  return result;
}

// Writes one map as binary sections and a JSON that describes them.
class MapWriter {
 public:
  explicit MapWriter(const ReportedMap& reported)
      : reported_(reported), map_(reported.map), check_(reported.map.check) {}

  // Appends the bytes of all sections to `bytes`.
  Json Write(std::string* bytes) {
    AddGeometry();
    AddFaces();
    sections_.emplace_back("charts", ToLine(Charts()));
    Json json = {{"name", reported_.name},
                 {"triangles", map_.mesh.num_faces()},
                 {"places", corner_of_place_.size()},
                 {"textureSize", reported_.options.texture_size},
                 {"padding", reported_.padding},
                 {"tiles", Tiles()},
                 {"low", {low_.x(), low_.y(), low_.z()}},
                 {"size", size_},
                 {"uvLow", {uv_low_.x(), uv_low_.y()}},
                 {"uvSize", uv_size_},
                 {"materials", Materials()},
                 {"numbers", CheckLines(reported_.input, reported_.options, map_)},
                 {"findings", Findings()},
                 {"sections", Json::object()}};
    if (!reported_.textures.empty()) AddTextures(&json);
    for (const auto& [name, section] : sections_) {
      json["sections"][name] = section.size();
      *bytes += section;
    }
    return json;
  }

 private:
  std::size_t num_faces() const { return map_.mesh.faces.size(); }
  std::int64_t PolygonOf(std::size_t face) const { return reported_.input.PolygonOf(map_.triangle_of_face[face]); }

  // Numbers places in the order of their first use by faces, so that most indices need not be stored.
  void AddGeometry() {
    std::vector<std::int32_t> number(static_cast<std::size_t>(map_.topology.num_places), -1);
    std::string indices;
    Eigen::AlignedBox3d box;
    Eigen::AlignedBox2d uv_box;
    for (std::size_t c = 0; c < 3 * num_faces(); ++c) {
      std::int32_t& n = number[static_cast<std::size_t>(map_.topology.place_of_corner[c])];
      const auto next = static_cast<std::int32_t>(corner_of_place_.size());
      AppendVarint(static_cast<std::uint64_t>(n < 0 ? 0 : next - n), &indices);
      if (n >= 0) continue;
      n = next;
      corner_of_place_.push_back(c);
      box.extend(PositionOf(c));
      uv_box.extend(UvAt(c));
    }
    low_ = box.min();
    size_ = std::max(box.sizes().maxCoeff(), std::numeric_limits<double>::min());
    uv_low_ = uv_box.min();
    uv_size_ = std::max(uv_box.sizes().maxCoeff(), std::numeric_limits<double>::min());
    sections_.emplace_back("indices", std::move(indices));
    sections_.emplace_back("positions", Planes(corner_of_place_.size(), 3, [&](std::size_t i, int k) {
                             return (PositionOf(corner_of_place_[i])[k] - low_[k]) / size_;
                           }));
    sections_.emplace_back("uv", Planes(corner_of_place_.size(), 2, [&](std::size_t i, int k) {
                             return (UvAt(corner_of_place_[i])[k] - uv_low_[k]) / uv_size_;
                           }));
  }

  void AddFaces() {
    Differences charts, polygons, materials, outline;
    std::string stretch, angles, faults, visibility, seams;
    for (std::size_t f = 0; f < num_faces(); ++f) {
      const std::int32_t chart = map_.topology.chart_of_face[f];
      charts.Add(chart);
      polygons.Add(PolygonOf(f));
      materials.Add(map_.material_of_face.empty() ? -1 : map_.material_of_face[f]);
      const double octaves = check_.face_stretch[f];
      stretch.push_back(static_cast<char>(std::isfinite(octaves)
                                              ? std::lround(kTopByte * std::clamp(octaves / kStretchOctaves, 0.0, 1.0))
                                              : kNoStretch));
      const double error = std::clamp(check_.face_angle_error[f] / 180.0, 0.0, 1.0);
      angles.push_back(static_cast<char>(std::lround(kTopByte * std::sqrt(error))));
      const bool is_mirrored = check_.charts[static_cast<std::size_t>(chart)].is_mirrored;
      faults.push_back(static_cast<char>(check_.faults[f] | (is_mirrored ? kMirroredFace : 0)));
      visibility.push_back(ByteOfShare(check_.face_visibility[f]));
    }
    const std::vector<std::int32_t> across = FacesAcross();
    for (std::size_t c = 0; c < map_.topology.is_outline.size(); ++c) {
      if (!map_.topology.is_outline[c]) continue;
      outline.Add(static_cast<std::int64_t>(c));
      const auto face = static_cast<std::int32_t>(c / 3);
      seams.push_back(across[c] < 0 ? static_cast<char>(kNoSeam)
                                    : ByteOfShare(EdgeVisibility(check_.face_visibility, face, across[c])));
    }
    sections_.emplace_back("chart", charts.Take());
    sections_.emplace_back("stretch", std::move(stretch));
    sections_.emplace_back("angle", std::move(angles));
    sections_.emplace_back("faults", std::move(faults));
    sections_.emplace_back("polygon", polygons.Take());
    sections_.emplace_back("material", materials.Take());
    sections_.emplace_back("outline", outline.Take());
    sections_.emplace_back("visibility", std::move(visibility));
    sections_.emplace_back("seams", std::move(seams));
  }

  // What the triangles show, and UV that are precise enough for images that repeat often.
  void AddTextures(Json* json) {
    Differences textures;
    for (const std::int32_t texture : reported_.textures.of_face) textures.Add(texture);
    sections_.emplace_back("texture", textures.Take());
    if (uv_size_ > kMostUvOfTwoBytes) {
      sections_.emplace_back("uvFine", Planes(corner_of_place_.size(), 2, [&](std::size_t i, int k) {
                               const double value = kSteps * (UvAt(corner_of_place_[i])[k] - uv_low_[k]) / uv_size_;
                               return value - std::round(value) + 0.5;
                             }));
    }
    if (!reported_.textures.colors.empty()) {
      std::string colors;
      for (const std::size_t corner : corner_of_place_) {
        const CornerColor& color = reported_.textures.colors[corner];
        for (std::size_t k = 0; k < 4; ++k) {
          const double value = std::clamp<double>(color[k], 0, 1);
          colors.push_back(static_cast<char>(std::lround(255 * (k < 3 ? SrgbOfLinear(value) : value))));
        }
      }
      sections_.emplace_back("colors", std::move(colors));
    }
    (*json)["textures"] = Json::array();
    for (const BaseColor& color : reported_.textures.list) {
      const char* const alphas[] = {"opaque", "mask", "blend"};
      Json& texture = (*json)["textures"].emplace_back(JsonOf(color));
      texture["factor"] = color.factor;
      texture["alpha"] = alphas[static_cast<int>(color.alpha)];
      texture["cutoff"] = color.cutoff;
      if (color.normals.image < 0) continue;
      texture["normals"] = JsonOf(color.normals);
      texture["normals"]["scale"] = color.normals.scale;
    }
  }

  static Json JsonOf(const ShownImage& shown) {
    const char* const wraps[] = {"repeat", "mirror", "clamp"};
    return {{"image", shown.image},
            {"transform", shown.transform},
            {"wrap", {wraps[static_cast<int>(shown.wrap_u)], wraps[static_cast<int>(shown.wrap_v)]}},
            {"nearest", shown.nearest}};
  }

  static char ByteOfShare(double share) {
    return static_cast<char>(std::lround(kTopByte * std::clamp(share, 0.0, 1.0)));
  }

  // Per half-edge: the face on the other side of the edge on the surface; -1 unless there is exactly one.
  std::vector<std::int32_t> FacesAcross() const {
    std::vector<std::int32_t> across(3 * num_faces(), -1);
    const EdgeGroups edges = GroupHalfEdges(map_.mesh.faces, map_.mesh.num_vertices());
    for (std::int32_t e = 0; e < edges.count(); ++e) {
      if (edges[e].size() != 2) continue;
      const auto c = static_cast<std::size_t>(edges[e][0]), d = static_cast<std::size_t>(edges[e][1]);
      across[c] = edges[e][1] / 3;
      across[d] = edges[e][0] / 3;
    }
    return across;
  }

  const Vec3& PositionOf(std::size_t c) const {
    return map_.mesh.positions[static_cast<std::size_t>(map_.mesh.faces[c / 3][c % 3])];
  }
  Vec2 UvAt(std::size_t c) const { return {map_.uv[2 * c], map_.uv[2 * c + 1]}; }

  Json Tiles() const {
    std::set<std::int32_t> tiles;
    for (const ChartCheck& chart : check_.charts) {
      if (chart.tile >= 0) tiles.insert(chart.tile);
    }
    return tiles;
  }

  // The figures of the charts, a list for each figure.
  Json Charts() const {
    Json charts = Json::object();
    for (std::size_t c = 0; c < check_.charts.size(); ++c) {
      const ChartCheck& chart = check_.charts[c];
      charts["triangles"].push_back(chart.triangles);
      charts["stretch"].push_back(Rounded(chart.stretch_l2, 8));
      charts["angle"].push_back(Rounded(chart.angle_error_mean_deg, 4));
      charts["density"].push_back(Rounded(chart.texels_per_unit, 4));
      charts["mirrored"].push_back(chart.is_mirrored ? 1 : 0);
    }
    return charts;
  }

  Json Materials() const {
    Json materials = Json::array();
    const std::vector<std::string> names = reported_.input.MaterialNames();
    const std::vector<std::array<double, 3>> colors = reported_.input.MaterialColors();
    for (std::size_t i = 0; i < names.size(); ++i) materials.push_back({{"name", names[i]}, {"color", colors[i]}});
    return materials;
  }

  // Most serious first.
  Json Findings() const {
    Json findings = Json::array();
    const auto add = [&](std::int64_t count, const char* kind, const std::string& text, std::uint8_t fault) {
      if (count > 0) findings.push_back({{"kind", kind}, {"text", text}, {"fault", fault}});
    };
    add(check_.overlapping, "overlap",
        (check_.overlaps.limited ? "at least " : "") +
            Counted(check_.overlaps.pairs, "pair of triangles overlaps", "pairs of triangles overlap"),
        kOverlappingFace);
    add(check_.flipped, "flipped",
        Counted(check_.flipped, "triangle is turned against the rest of its chart",
                "triangles are turned against the rest of their chart"),
        kFlippedFace);
    add(check_.degenerate, "degenerate",
        Counted(check_.degenerate, "triangle has no area in the map", "triangles have no area in the map"),
        kDegenerateFace);
    add(check_.outside, "outside",
        Counted(check_.outside, "triangle is not inside a tile", "triangles are not inside a tile"), kOutsideFace);
    add(check_.mirrored_charts, "mirrored", Counted(check_.mirrored_charts, "chart is mirrored", "charts are mirrored"),
        kMirroredFace);
    std::size_t named = 0;
    for (const ChartPair& pair : check_.spacing.near) {
      // At distance 0 the outlines touch or cross. If the map has overlaps, these are reported, and not such pairs.
      if (pair.distance == 0 && check_.overlaps.pairs > 0) continue;
      if (++named > kMaxNamedPairs) break;
      findings.push_back({{"kind", "near"},
                          {"text", "charts " + std::to_string(pair.a) + " and " + std::to_string(pair.b) + " are " +
                                       Significant(pair.distance, 3) + " texels apart"},
                          {"charts", {pair.a, pair.b}}});
    }
    const auto missing = static_cast<std::int64_t>(map_.without_uv.size() + map_.not_finite.size());
    if (missing > 0) {
      findings.push_back(
          {{"kind", "missing"},
           {"text", Counted(missing, "triangle has no UV and is not shown", "triangles have no UV and are not shown")},
           {"faces", Json::array()}});
    }
    return findings;
  }

  const ReportedMap& reported_;
  const CheckedMap& map_;
  const MapCheck& check_;
  std::vector<std::size_t> corner_of_place_;  // the first that has it
  Vec3 low_ = Vec3::Zero();
  Vec2 uv_low_ = Vec2::Zero();
  double size_ = 1, uv_size_ = 1;
  std::vector<std::pair<std::string, std::string>> sections_;
};

// Parses integers from text such as "3,17".
std::set<std::int64_t> NumbersIn(const std::string& text) {
  std::set<std::int64_t> numbers;
  std::int64_t number = -1;
  for (const char c : text + ",") {
    if (c >= '0' && c <= '9') {
      number = std::max<std::int64_t>(number, 0) * 10 + (c - '0');
    } else if (number >= 0) {
      numbers.insert(std::exchange(number, -1));
    }
  }
  return numbers;
}

// The part of `unwrap` that the page shows. Residuals are kept for the charts with the most steps, as far as the limit
// allows.
Json SolveJson(const Json& unwrap) {
  Json kept = Json::object();
  for (const char* key : {"charts", "seconds", "warnings", "tolerance"}) {
    if (unwrap.contains(key)) kept[key] = unwrap.at(key);
  }
  kept["largest"] = unwrap.value("chart_totals", Json::object()).value("newton_residuals", Json::array());
  std::vector<std::pair<std::size_t, Json*>> by_steps;
  for (Json& chart : kept["charts"]) {
    Json solve = Json::object();
    for (const char* key :
         {"chart", "triangles", "method", "solver", "preconditioner", "converged", "newton_iterations", "stretch_l2"}) {
      if (chart.contains(key)) solve[key] = chart[key];
    }
    double worst = 0;
    for (const Json& residual : chart.value("residual", Json::object())) {
      worst = std::max(worst, residual.get<double>());
    }
    solve["residual"] = Rounded(worst, 4);
    solve["steps"] = chart.value("newton_residuals", Json::array());
    chart = std::move(solve);
    by_steps.emplace_back(chart["steps"].size(), &chart);
  }
  std::stable_sort(by_steps.begin(), by_steps.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::size_t numbers = 0;
  for (const auto& [size, chart] : by_steps) {
    numbers += size;
    if (numbers > kMostResiduals) chart->erase("steps");
  }
  return kept;
}

// Moves warnings of the unwrap that name faces to the findings of the map, where the page can show them. Other warnings
// stay in `unwrap`.
void ShowWarnings(const ReportedMap& reported, Json* unwrap, Json* findings) {
  Json others = Json::array();
  for (const Json& warning : unwrap->value("warnings", Json::array())) {
    const Json metadata = warning.value("metadata", Json::object());
    const std::string named = metadata.value("faces", metadata.value("face", std::string()));
    const std::set<std::int64_t> polygons = NumbersIn(named);
    Json faces = Json::array();
    for (std::size_t f = 0; f < reported.map.mesh.faces.size() && !polygons.empty(); ++f) {
      if (faces.size() < kMaxFindingFaces &&
          polygons.contains(reported.input.PolygonOf(reported.map.triangle_of_face[f]))) {
        faces.push_back(f);
      }
    }
    if (faces.empty()) {
      others.push_back(warning);
    } else {
      findings->push_back(
          {{"kind", warning.value("reason", "")}, {"text", warning.value("message", "")}, {"faces", faces}});
    }
  }
  (*unwrap)["warnings"] = others;
}

}  // namespace

std::string ForScript(const Json& json) {
  std::string text = ToLine(json);
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos; at += 6) text.replace(at, 1, "\\u003c");
  return text;
}

std::string FillTemplate(std::string_view page, const std::string& data) {
  constexpr std::string_view kPlace = "<!--PLANISH_DATA-->";
  const std::size_t place = page.find(kPlace);
  if (place == std::string_view::npos) {
    throw Error(ErrorCode::kInternal, "INTERNAL", "the report's template is damaged");
  }
  return std::string(page.substr(0, place)) + data + std::string(page.substr(place + kPlace.size()));
}

FinishedPage ReportPage(const std::vector<ReportedMap>& maps, ReportImages* images, const std::optional<Json>& unwrap,
                        const std::string& title, const std::optional<SheetMember>& member) {
  FinishedPage finished;
  Json page = {{"version", Version()}, {"maps", Json::array()}};
  if (!title.empty()) page["title"] = title;
  std::string blobs;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    std::string bytes;
    page["maps"].push_back(MapWriter(maps[i]).Write(&bytes));
    blobs += "<script type=\"text/plain\" id=\"planish-map-" + std::to_string(i) + "\">" +
             absl::Base64Escape(Deflated(bytes)) + "</script>\n";
  }
  blobs += images->Write(&page);
  std::size_t other_warnings = 0;
  if (unwrap) {
    Json kept = SolveJson(*unwrap);
    ShowWarnings(maps.back(), &kept, &page["maps"].back()["findings"]);
    other_warnings = kept["warnings"].size();
    page["unwrap"] = std::move(kept);
  }
  const CheckedMap& map = maps.back().map;
  finished.card = {{"triangles", map.triangles},
                   {"charts", map.topology.num_charts},
                   {"stretch", Rounded(map.check.stretch_l2, 5)},
                   {"efficiency", Rounded(map.check.packing_efficiency, 4)},
                   {"overlaps", map.check.overlaps.pairs},
                   {"flipped", map.check.flipped},
                   {"warnings", page["maps"].back()["findings"].size() + other_warnings}};
  std::string data;
  if (member) {
    page["sheet"] = member->sheet;
    finished.card["made"] = member->made;
    finished.card["picture"] = absl::Base64Escape(member->picture);
    data = std::string(kCardBegin) + ForScript(finished.card) + "</script>\n";
  }
  data += "<script type=\"application/json\" id=\"planish-page\">" + ForScript(page) + "</script>\n" + blobs;
  finished.html = FillTemplate(ReportTemplate(), data);
  return finished;
}

Json ReadCard(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes(kMostBytesBeforeCardEnds, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  const std::size_t begin = bytes.find(kCardBegin);
  const std::size_t end = bytes.find("</script>", begin);
  if (begin == std::string::npos || end == std::string::npos) return nullptr;
  const std::size_t first = begin + kCardBegin.size();
  const Json card = Json::parse(bytes.substr(first, end - first), nullptr, false);
  return card.is_object() ? card : Json();
}

std::string_view ReportTemplate() {
  return {planish_report_template, static_cast<std::size_t>(planish_report_template_end - planish_report_template)};
}

std::string_view SheetTemplate() {
  return {planish_sheet_template, static_cast<std::size_t>(planish_sheet_template_end - planish_sheet_template)};
}

}  // namespace planish::cli
