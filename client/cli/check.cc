#include "client/cli/check.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/results.h"
#include "client/cli/text.h"
#include "client/files/mesh_file.h"
#include "client/files/uv_islands.h"

namespace planish::cli {
namespace {

bool AreFinite(const Mesh& mesh, const CornerUv& uv, std::size_t t) {
  return std::all_of(uv.begin() + 6 * static_cast<std::ptrdiff_t>(t),
                     uv.begin() + 6 * static_cast<std::ptrdiff_t>(t + 1), [](double x) { return std::isfinite(x); }) &&
         std::all_of(mesh.faces[t].begin(), mesh.faces[t].end(),
                     [&](std::int32_t v) { return mesh.positions[v].allFinite(); });
}

// `has_uv(t)`: whether triangle t has UV at all.
template <typename HasUv>
CheckedMap CheckTriangles(const MeshInput& input, const CornerUv& uv, MapCheckOptions options,
                          const Execution& execution, const HasUv& has_uv) {
  CheckedMap map;
  const Mesh& all = input.mesh();
  map.triangles = all.num_faces();
  const std::vector<std::int32_t> materials = input.FaceMaterials();
  std::vector<std::int64_t> polygons;
  for (std::size_t t = 0; t < all.faces.size(); ++t) {
    const auto id = static_cast<std::int32_t>(t);
    if (!has_uv(t)) {
      map.without_uv.push_back(id);
    } else if (!AreFinite(all, uv, t)) {
      map.not_finite.push_back(id);
    } else {
      map.mesh.faces.push_back(all.faces[t]);
      map.triangle_of_face.push_back(id);
      map.uv.insert(map.uv.end(), uv.begin() + 6 * static_cast<std::ptrdiff_t>(t),
                    uv.begin() + 6 * static_cast<std::ptrdiff_t>(t + 1));
      polygons.push_back(input.PolygonOf(id));
      if (!materials.empty()) map.material_of_face.push_back(materials[t]);
    }
  }
  if (map.mesh.faces.empty()) return map;
  map.mesh.positions = all.positions;
  UvIslands islands = FindUvIslands(map.mesh, map.uv, polygons);
  map.topology = {std::move(islands.place_of_corner), islands.num_places,
                  std::move(islands.island_of_face),  islands.count,
                  std::move(islands.is_outline),      std::move(islands.edges)};
  map.first_face_of_chart.assign(static_cast<std::size_t>(map.topology.num_charts), -1);
  for (std::size_t f = 0; f < map.mesh.faces.size(); ++f) {
    std::int32_t& first = map.first_face_of_chart[static_cast<std::size_t>(map.topology.chart_of_face[f])];
    if (first < 0) first = static_cast<std::int32_t>(f);
  }
  options.material_of_face = map.material_of_face;
  options.num_materials = materials.empty() ? 0 : *std::max_element(materials.begin(), materials.end()) + 1;
  map.check = CheckMap(map.mesh, map.uv, map.topology, options, execution);
  return map;
}

}  // namespace

CheckedMap CheckMapOf(const MeshInput& input, const MapCheckOptions& options, const Execution& execution) {
  const std::vector<std::int32_t> ids = input.CornerTexcoords();
  return CheckTriangles(input, input.CornerUv(), options, execution, [&](std::size_t t) {
    return !ids.empty() && std::min({ids[3 * t], ids[3 * t + 1], ids[3 * t + 2]}) >= 0;
  });
}

CheckedMap CheckMapOf(const MeshInput& input, const CornerUv& uv, const MapCheckOptions& options,
                      const Execution& execution) {
  return CheckTriangles(input, uv, options, execution, [](std::size_t) { return true; });
}

namespace {

constexpr std::size_t kInText = 5, kInJson = 100;  // most elements that are named
// How much smaller than the required padding a distance may be, in texels, because UV are floats.
constexpr double kPaddingSlack = 0.01;

// The chart with the largest stretch; nothing without charts.
std::optional<std::size_t> MostStretched(const CheckedMap& map) {
  const std::vector<ChartCheck>& charts = map.check.charts;
  const auto worst = std::max_element(charts.begin(), charts.end(), [](const ChartCheck& a, const ChartCheck& b) {
    return a.stretch_l2 < b.stretch_l2;
  });
  if (worst == charts.end()) return std::nullopt;
  return static_cast<std::size_t>(worst - charts.begin());
}

std::string AtLeast(bool limited) {
  return limited ? "at least " : "";
}

// Converts triangles to what people and programs know them by: polygons of the file.
class FileFaces {
 public:
  FileFaces(const MeshInput& input, const CheckedMap& map) : input_(input), map_(map) {}

  std::int64_t Of(std::int32_t face) const {
    return input_.PolygonOf(map_.triangle_of_face[static_cast<std::size_t>(face)]);
  }

  // The first `most` polygons of triangles of the file, ascending, each once.
  std::vector<std::int64_t> Polygons(const std::vector<std::int32_t>& triangles, std::size_t most) const {
    std::vector<std::int64_t> polygons;
    for (const std::int32_t t : triangles) {
      if (polygons.size() == most) break;
      // The triangles of a polygon follow each other.
      const std::int64_t polygon = input_.PolygonOf(t);
      if (polygons.empty() || polygons.back() != polygon) polygons.push_back(polygon);
    }
    return polygons;
  }

  // The first `most` polygons with a triangle that has one of the bits of `faults`.
  std::vector<std::int64_t> WithFault(std::uint8_t faults, std::size_t most) const {
    return Polygons(TrianglesWithFault(faults), most);
  }

  // The triangles of the file with one of the bits of `faults`, ascending.
  std::vector<std::int32_t> TrianglesWithFault(std::uint8_t faults) const {
    std::vector<std::int32_t> triangles;
    for (std::size_t f = 0; f < map_.check.faults.size(); ++f) {
      if (map_.check.faults[f] & faults) triangles.push_back(map_.triangle_of_face[f]);
    }
    return triangles;
  }

  // The first few of these polygons with their places in the file: " (face 3 (a.obj:12), face 9 (a.obj:40))".
  std::string Named(const std::vector<std::int64_t>& polygons) const {
    if (polygons.empty()) return "";
    std::string ids;
    for (const std::int64_t polygon : polygons) ids += (ids.empty() ? "" : ", ") + std::to_string(polygon);
    return " (" + Places({{"faces", ids}}, &input_) + ")";
  }

  // The count with the first faces, "3 (face 2, ...)"; for polygons, "6 triangles of 3 faces (face 2, ...)".
  std::string Counted(const std::vector<std::int32_t>& triangles) const {
    if (triangles.empty()) return "none";
    const auto count = static_cast<std::int64_t>(triangles.size());
    const std::vector<std::int64_t> all = Polygons(triangles, triangles.size());
    const std::vector<std::int64_t> first(all.begin(), all.begin() + std::min(all.size(), kInText));
    const bool has_polygons = input_.file().mesh.num_polygons() < map_.triangles;
    return (has_polygons ? cli::Counted(count, "triangle", "triangles") + " of " +
                               cli::Counted(static_cast<std::int64_t>(all.size()), "face", "faces")
                         : WithCommas(count)) +
           Named(first);
  }
  std::string CountedWithFault(std::uint8_t fault) const { return Counted(TrianglesWithFault(fault)); }

 private:
  const MeshInput& input_;
  const CheckedMap& map_;
};

std::vector<std::int32_t> MirroredCharts(const CheckedMap& map) {
  std::vector<std::int32_t> charts;
  for (std::size_t c = 0; c < map.check.charts.size(); ++c) {
    if (map.check.charts[c].is_mirrored) charts.push_back(static_cast<std::int32_t>(c));
  }
  return charts;
}

// "chart 3 (from face 17)"; face 17 is the first face of the chart.
std::string ChartName(const FileFaces& faces, const CheckedMap& map, std::int32_t chart) {
  return "chart " + std::to_string(chart) + " (from face " +
         std::to_string(faces.Of(map.first_face_of_chart[static_cast<std::size_t>(chart)])) + ")";
}

std::string MaterialName(const MeshInput& input, std::int32_t material) {
  return material < 0 ? "" : input.MaterialNames()[static_cast<std::size_t>(material)];
}

std::string DensityText(const DensityCheck& density) {
  return Significant(density.mean, 4) + " texels per unit; " + Significant(density.low, 4) + " to " +
         Significant(density.high, 4) + " in nine tenths of the area";
}

std::string SpacingText(const FileFaces& faces, const CheckedMap& map, double reach) {
  const ChartSpacing& spacing = map.check.spacing;
  if (map.topology.num_charts < 2) return "one chart";
  if (spacing.nearest.a < 0) {
    return spacing.limited ? "not known: too many outlines lie close together"
                           : "more than " + Significant(reach, 4) + " texels";
  }
  return Significant(spacing.nearest.distance, 4) + " texels" + (spacing.limited ? " or less" : "") + ", between " +
         ChartName(faces, map, spacing.nearest.a) + " and " + ChartName(faces, map, spacing.nearest.b);
}

}  // namespace

const char* ToString(Requirement requirement) {
  switch (requirement) {
    case Requirement::kUv:
      return "uv";
    case Requirement::kNoOverlap:
      return "no-overlap";
    case Requirement::kNoFlip:
      return "no-flip";
    case Requirement::kNoMirror:
      return "no-mirror";
    case Requirement::kNoDegenerate:
      return "no-degenerate";
    case Requirement::kInTile:
      return "in-tile";
  }
  return "";
}

std::vector<RequirementResult> CheckRequirements(const Requirements& wanted, const CheckedMap& map) {
  std::vector<RequirementResult> results;
  if (!map.has_uv()) {
    results.push_back({"uv", false, "there are no UV"});
    return results;
  }
  const MapCheck& check = map.check;
  const auto require = [&](Requirement requirement, bool met, const std::string& message) {
    if (wanted.required.contains(requirement)) results.push_back({ToString(requirement), met, met ? "" : message});
  };
  const auto missing = static_cast<std::int64_t>(map.without_uv.size() + map.not_finite.size());
  require(Requirement::kUv, missing == 0,
          Counted(missing, "triangle has", "triangles have") + " no UV, or UV at NaN or infinity");
  // A search that ended early does not prove that there are no overlaps, so the requirement is not met.
  require(Requirement::kNoOverlap, check.overlaps.pairs == 0 && !check.overlaps.limited,
          check.overlaps.pairs == 0
              ? "too many triangles lie close together to look at all pairs"
              : AtLeast(check.overlaps.limited) +
                    Counted(check.overlaps.pairs, "pair of triangles overlaps", "pairs of triangles overlap"));
  require(Requirement::kNoFlip, check.flipped == 0,
          Counted(check.flipped, "triangle is flipped", "triangles are flipped"));
  require(Requirement::kNoMirror, check.mirrored_charts == 0,
          Counted(check.mirrored_charts, "chart is mirrored", "charts are mirrored"));
  require(Requirement::kNoDegenerate, check.degenerate == 0,
          Counted(check.degenerate, "triangle has no area in the map", "triangles have no area in the map"));
  require(Requirement::kInTile, check.outside == 0,
          Counted(check.outside, "triangle is not inside a tile", "triangles are not inside a tile"));
  if (wanted.max_stretch > 0) {
    const std::size_t worst = MostStretched(map).value_or(0);
    const double stretch = check.charts[worst].stretch_l2;
    const auto above = std::count_if(check.charts.begin(), check.charts.end(), [&](const ChartCheck& chart) {
      return !(chart.stretch_l2 <= wanted.max_stretch);
    });
    results.push_back({"max-stretch", above == 0,
                       above == 0 ? ""
                                  : Counted(above, "chart stretches", "charts stretch") + " by more than " +
                                        Significant(wanted.max_stretch, 4) + "; the largest is " +
                                        Significant(stretch, 5) + ", of chart " + std::to_string(worst)});
  }
  if (wanted.min_padding > 0) {
    const auto too_near = std::count_if(check.spacing.near.begin(), check.spacing.near.end(), [&](const ChartPair& p) {
      return p.distance < wanted.min_padding - kPaddingSlack;
    });
    const bool overlap = check.spacing.nearest.distance < wanted.min_padding - kPaddingSlack;
    const bool met = too_near == 0 && !overlap && !check.spacing.limited;
    std::string message = "there are too many outlines close together to look at all of them";
    if (too_near > 0 || overlap) {
      message = AtLeast(check.spacing.limited) +
                Counted(std::max<std::int64_t>(too_near, 1), "pair of charts is", "pairs of charts are") +
                " nearer than " + Significant(wanted.min_padding, 4) + " texels; the nearest are " +
                Significant(check.spacing.nearest.distance, 4) + " texels apart";
    }
    results.push_back({"min-padding", met, met ? "" : message});
  }
  return results;
}

bool AreMet(const std::vector<RequirementResult>& results) {
  return std::all_of(results.begin(), results.end(), [](const RequirementResult& result) { return result.met; });
}

std::string MapName(const std::string& path, int uv_set) {
  return uv_set == 0 ? path : path + " TEXCOORD_" + std::to_string(uv_set);
}

std::vector<std::pair<std::string, std::string>> CheckLines(const MeshInput& input, const MapCheckOptions& options,
                                                            const CheckedMap& map) {
  std::vector<std::pair<std::string, std::string>> all;
  if (!map.has_uv()) return all;
  const FileFaces faces(input, map);
  const MapCheck& check = map.check;
  const auto add = [&](const std::string& name, const std::string& value) { all.emplace_back(name, value); };
  const auto count = [&](const std::string& name, std::int64_t number, const std::string& more) {
    add(name, number == 0 ? "none" : WithCommas(number) + more);
  };
  std::vector<std::int32_t> first_pair(check.overlaps.faces.begin(),
                                       check.overlaps.faces.begin() + (check.overlaps.faces.empty() ? 0 : 2));
  for (std::int32_t& f : first_pair) f = map.triangle_of_face[static_cast<std::size_t>(f)];
  if (check.overlaps.limited) {
    add("overlapping pairs", check.overlaps.pairs == 0 ? "not known: too many triangles lie close together"
                                                       : "at least " + WithCommas(check.overlaps.pairs));
  } else {
    count("overlapping pairs", check.overlaps.pairs, faces.Named(faces.Polygons(first_pair, kInText)));
  }
  add("flipped", faces.CountedWithFault(kFlippedFace));
  const std::vector<std::int32_t> mirrored = MirroredCharts(map);
  count("mirrored charts", check.mirrored_charts,
        mirrored.empty() ? ""
                         : ", with " + Counted(check.mirrored_triangles, "triangle", "triangles") + "; first " +
                               ChartName(faces, map, mirrored.front()));
  add("degenerate", faces.CountedWithFault(kDegenerateFace));
  if (check.without_area > 0) add("no area on surface", faces.CountedWithFault(kFaceWithoutArea));
  add("outside the tiles", faces.CountedWithFault(kOutsideFace));
  add("without UV", faces.Counted(map.without_uv));
  if (!map.not_finite.empty()) add("not finite", faces.Counted(map.not_finite));
  const std::size_t worst = MostStretched(map).value_or(0);
  add("L2 stretch", Significant(check.stretch_l2, 5) + " overall; " + Significant(check.charts[worst].stretch_l2, 5) +
                        " in " + ChartName(faces, map, static_cast<std::int32_t>(worst)));
  add("angle error", Fixed(check.angle_error_mean_deg, 2) + " degrees on average, " +
                         Fixed(check.angle_error_max_deg, 1) + " at most");
  for (const DensityCheck& density : check.densities) {
    const std::string material = MaterialName(input, density.material);
    add("texel density", DensityText(density) + (material.empty() ? "" : " [" + material + "]"));
  }
  add("chart distance", SpacingText(faces, map, std::max(kSpacingReach, options.min_padding)));
  add("seam length", Significant(check.seam_length, 4) + " times the root of the surface's area, " +
                         Significant(check.seams.visible_length, 4) + " in view");
  add("seam turn", Fixed(check.seams.turn_deg, 1) + " degrees from edge to edge on average");
  add("seam symmetry", check.seams.symmetry
                           ? Fixed(100 * *check.seams.symmetry, 1) + " % of the seams have their mirror image"
                           : "no mirror plane");
  add("packing efficiency", Fixed(100 * check.packing_efficiency, 1) + " %");
  return all;
}

std::string CheckText(const MeshInput& input, int uv_set, const std::vector<int>& uv_sets,
                      const MapCheckOptions& options, const CheckedMap& map,
                      const std::vector<RequirementResult>& results) {
  const MapCheck& check = map.check;
  constexpr std::size_t kColumn = 20;  // where values begin
  std::string text = MapName(input.path(), uv_set) + ": " + Counted(map.triangles, "triangle", "triangles");
  std::string others;
  for (const int set : uv_sets) {
    if (set != uv_set) others += (others.empty() ? "TEXCOORD_" : ", TEXCOORD_") + std::to_string(set);
  }
  if (!map.has_uv()) {
    text += ", no UV\n";
  } else {
    text += ", " + Counted(map.topology.num_charts, "chart", "charts") + " in " +
            Counted(check.tiles_used, "tile", "tiles") + " of " + WithCommas(options.texture_size) + " x " +
            WithCommas(options.texture_size) + " texels\n";
    for (const auto& [name, value] : CheckLines(input, options, map)) {
      text += "  " + name + std::string(name.size() < kColumn ? kColumn - name.size() : 1, ' ') + value + "\n";
    }
  }
  if (!others.empty()) text += "  The file has " + others + " too; see --texcoord.\n";
  for (const RequirementResult& result : results) {
    if (!result.met) text += "  NOT MET: " + result.name + ": " + result.message + "\n";
  }
  return PrintableLines(text, true);
}

Json CheckJson(const MeshInput& input, int uv_set, const std::vector<int>& uv_sets, const MapCheckOptions& options,
               const CheckedMap& map, const std::vector<RequirementResult>& results) {
  const FileFaces faces(input, map);
  const MapCheck& check = map.check;
  const auto counted = [](std::int64_t count, std::vector<std::int64_t> ids) {
    return Json{{"count", count}, {"faces", std::move(ids)}};
  };
  const auto chart_ids = [&](const std::vector<std::int32_t>& charts) {
    Json ids = Json::array();
    for (const std::int32_t c : charts) {
      if (ids.size() < kInJson) {
        ids.push_back({{"chart", c}, {"first_face", faces.Of(map.first_face_of_chart[static_cast<std::size_t>(c)])}});
      }
    }
    return ids;
  };
  Json json = {{"file", input.path()}, {"uv_set", uv_set}, {"uv_sets", uv_sets}, {"triangles", map.triangles}};
  json["without_uv"] =
      counted(static_cast<std::int64_t>(map.without_uv.size()), faces.Polygons(map.without_uv, kInJson));
  json["not_finite"] =
      counted(static_cast<std::int64_t>(map.not_finite.size()), faces.Polygons(map.not_finite, kInJson));
  if (map.has_uv()) {
    json["charts"] = map.topology.num_charts;
    Json pairs = Json::array();
    for (std::size_t i = 0; i + 1 < check.overlapping_pairs.size() && pairs.size() < kInJson; i += 2) {
      pairs.push_back({faces.Of(check.overlapping_pairs[i]), faces.Of(check.overlapping_pairs[i + 1])});
    }
    json["overlapping"] = {{"pairs", check.overlaps.pairs},
                           {"limited", check.overlaps.limited},
                           {"triangles", check.overlapping},
                           {"faces", std::move(pairs)}};
    json["flipped"] = counted(check.flipped, faces.WithFault(kFlippedFace, kInJson));
    json["mirrored"] = {{"charts", check.mirrored_charts},
                        {"triangles", check.mirrored_triangles},
                        {"first", chart_ids(MirroredCharts(map))}};
    json["degenerate"] = counted(check.degenerate, faces.WithFault(kDegenerateFace, kInJson));
    json["without_area"] = counted(check.without_area, faces.WithFault(kFaceWithoutArea, kInJson));
    json["outside"] = counted(check.outside, faces.WithFault(kOutsideFace, kInJson));
    const auto worst = static_cast<std::int32_t>(MostStretched(map).value_or(0));
    json["stretch_l2"] = check.stretch_l2;
    json["stretch_l2_max"] = check.charts[static_cast<std::size_t>(worst)].stretch_l2;
    json["stretch_l2_max_chart"] = worst;
    json["angle_error_mean_deg"] = check.angle_error_mean_deg;
    json["angle_error_max_deg"] = check.angle_error_max_deg;
    json["texel_density"] = Json::array();
    for (const DensityCheck& density : check.densities) {
      Json entry = {{"material", nullptr},
                    {"triangles", density.triangles},
                    {"mean", density.mean},
                    {"low", density.low},
                    {"high", density.high}};
      if (density.material >= 0) entry["material"] = MaterialName(input, density.material);
      json["texel_density"].push_back(std::move(entry));
    }
    const ChartSpacing& spacing = check.spacing;
    json["chart_distance"] = {{"texels", nullptr}, {"charts", Json::array()}, {"limited", spacing.limited}};
    if (spacing.nearest.a >= 0) {
      json["chart_distance"]["texels"] = spacing.nearest.distance;
      json["chart_distance"]["charts"] = chart_ids({spacing.nearest.a, spacing.nearest.b});
    }
    json["near_charts"] = Json::array();
    for (const ChartPair& pair : spacing.near) {
      if (json["near_charts"].size() == kInJson) break;
      json["near_charts"].push_back({{"charts", {pair.a, pair.b}}, {"texels", pair.distance}});
    }
    json["seam_length"] = check.seam_length;
    json["visible_seam_length"] = check.seams.visible_length;
    json["seam_turn_deg"] = check.seams.turn_deg;
    json["seam_symmetry"] = check.seams.symmetry ? Json(*check.seams.symmetry) : Json();
    json["texture_size"] = options.texture_size;
    json["tiles_used"] = check.tiles_used;
    json["packing_efficiency"] = check.packing_efficiency;
  }
  json["requirements"] = Json::array();
  for (const RequirementResult& result : results) {
    Json entry = {{"name", result.name}, {"met", result.met}};
    if (!result.met) entry["message"] = result.message;
    json["requirements"].push_back(std::move(entry));
  }
  json["ok"] = AreMet(results);
  return json;
}

}  // namespace planish::cli
