#include "client/cli/seams.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <numbers>
#include <numeric>
#include <optional>
#include <sstream>
#include <tuple>
#include <utility>

#include "client/files/file_io.h"
#include "client/src/errors.h"
#include "core/base/number.h"
#include "core/mesh/half_edges.h"
#include "planish/error.h"

namespace planish::cli {
namespace {

// The items between commas, including empty items.
std::vector<std::string> Items(const std::string& text) {
  std::vector<std::string> items = {""};
  for (const char c : text) {
    if (c == ',') {
      items.emplace_back();
    } else {
      items.back() += c;
    }
  }
  return items;
}

std::optional<Seams> PolicyNamed(const std::string& name) {
  for (const Seams policy : {Seams::kNone, Seams::kKeep, Seams::kNeeded, Seams::kAuto}) {
    if (name == ToString(policy)) return policy;
  }
  return std::nullopt;
}

// The text after `prefix`; nothing if `item` does not begin with it.
std::optional<std::string> After(const std::string& prefix, const std::string& item) {
  if (item.rfind(prefix, 0) != 0) return std::nullopt;
  return item.substr(prefix.size());
}

std::string ParseDegrees(const std::string& text, double* degrees) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *degrees);
  if (error == std::errc() && end == text.data() + text.size() && *degrees > 0 && *degrees <= 180) return "";
  return "hard:" + text + ": the angle must be a number of degrees above 0 and up to 180";
}

}  // namespace

std::string ParseSeamList(const std::string& text, SeamList* list) {
  *list = SeamList();
  std::optional<Seams> policy;
  bool has_source = false;
  for (const std::string& item : Items(text)) {
    if (const auto named = PolicyNamed(item)) {
      if (policy) return std::string(ToString(*policy)) + " and " + item + " exclude each other";
      policy = named;
      continue;
    }
    if (const auto file = After("uncut:", item); file && !file->empty()) {
      list->uncut_files.push_back(*file);
      continue;
    }
    has_source = true;
    if (item == "uv") {
      list->uv = true;
    } else if (item == "materials") {
      list->materials = true;
    } else if (item == "groups") {
      list->groups = true;
    } else if (item == "hard") {
      list->hard_edge_degrees = kDefaultHardEdge;
    } else if (const auto degrees = After("hard:", item)) {
      if (std::string problem = ParseDegrees(*degrees, &list->hard_edge_degrees); !problem.empty()) {
        return problem;
      }
    } else if (const auto file = After("edges:", item); file && !file->empty()) {
      list->edge_files.push_back(*file);
    } else {
      return "'" + item + "' is neither none, keep, needed or auto, nor one of uv, hard, hard:DEG, edges:FILE, " +
             "materials, groups, uncut:FILE";
    }
  }
  if (policy == Seams::kNone && (has_source || !list->uncut_files.empty())) {
    return "none means that no edge is cut, so it goes with nothing else";
  }
  list->policy = policy.value_or(has_source ? Seams::kNeeded : Seams::kAuto);
  return "";
}

namespace {

[[noreturn]] void Malformed(const std::string& path, std::int64_t line, const std::string& message) {
  throw ErrorFrom(FileMalformed(path, line, message));
}

// The words of a line, up to a '#'.
std::vector<std::string> Words(const std::string& line) {
  std::istringstream stream(line.substr(0, line.find('#')));
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

// Two corners of the file: those of c's triangle at the ends of the edge that corner c faces.
std::pair<std::int64_t, std::int64_t> EndsFacedBy(const Triangulation& triangles, std::size_t c) {
  const std::size_t first = c - c % 3;
  return {triangles.corner_of_triangle[first + (c + 1) % 3], triangles.corner_of_triangle[first + (c + 2) % 3]};
}

// Per corner of the triangulation: whether it faces a diagonal of its polygon.
std::vector<char> FacesDiagonal(const Triangulation& triangles) {
  std::vector<char> result(triangles.corner_of_triangle.size(), 0);
  const auto faces = static_cast<std::int64_t>(triangles.source_polygon.size());
  const auto polygon = [&](std::int64_t f) { return triangles.source_polygon[static_cast<std::size_t>(f)]; };
  for (std::int64_t begin = 0, end; begin < faces; begin = end) {
    for (end = begin + 1; end < faces && polygon(end) == polygon(begin);) ++end;
    for (const auto& [c, d] : Diagonals(triangles, begin, end)) result[c] = result[d] = 1;
  }
  return result;
}

}  // namespace

PolygonEdges::PolygonEdges(const MeshFile& file, const Triangulation& triangles) : file_(file), triangles_(triangles) {
  const std::size_t num_corners = triangles.corner_of_triangle.size();
  half_edges_.reserve(num_corners);
  const std::vector<char> faces_diagonal = FacesDiagonal(triangles);
  for (std::size_t c = 0; c < num_corners; ++c) {
    Face face;
    for (std::size_t k = 0; k < 3; ++k) {
      face[k] = file.mesh.corner_vertex[triangles.corner_of_triangle[c - c % 3 + k]];
    }
    if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0]) continue;
    if (faces_diagonal[c]) continue;
    const auto [a, b] = EndsFacedBy(triangles, c);
    const auto [low, high] = std::minmax({file.mesh.corner_vertex[a], file.mesh.corner_vertex[b]});
    half_edges_.push_back({low, high, static_cast<std::int32_t>(c)});
  }
  std::sort(half_edges_.begin(), half_edges_.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.low, a.high, a.corner) < std::tie(b.low, b.high, b.corner);
  });
}

template <typename Visit>
void PolygonEdges::ForEachEdge(const Visit& visit) const {
  for (auto begin = half_edges_.begin(), end = begin; begin != half_edges_.end(); begin = end) {
    end = std::find_if(begin, half_edges_.end(),
                       [&](const HalfEdge& h) { return h.low != begin->low || h.high != begin->high; });
    visit(begin, end);
  }
}

template <typename Same>
std::vector<std::int32_t> PolygonEdges::Borders(const Same& same) const {
  std::vector<std::int32_t> corners;
  ForEachEdge([&](auto begin, auto end) {
    if (!std::all_of(begin, end, [&](const HalfEdge& h) { return same(*begin, h); })) corners.push_back(begin->corner);
  });
  std::sort(corners.begin(), corners.end());
  return corners;
}

std::int64_t PolygonEdges::PolygonCorner(std::int32_t corner, std::int32_t vertex) const {
  const std::int32_t first = corner - corner % 3;
  const std::int64_t candidate = triangles_.corner_of_triangle[first + Next(corner % 3)];
  return file_.mesh.corner_vertex[candidate] == vertex ? candidate
                                                       : triangles_.corner_of_triangle[first + Prev(corner % 3)];
}

bool PolygonEdges::SameUv(const HalfEdge& a, const HalfEdge& b) const {
  const auto& texcoord = file_.mesh.corner_texcoord;
  for (const std::int32_t vertex : {a.low, a.high}) {
    if (texcoord[PolygonCorner(a.corner, vertex)] != texcoord[PolygonCorner(b.corner, vertex)]) return false;
  }
  return true;
}

std::int64_t PolygonEdges::PolygonOf(const HalfEdge& half_edge) const {
  return triangles_.source_polygon[half_edge.corner / 3];
}

std::vector<std::int32_t> PolygonEdges::UvBorders() const {
  if (file_.mesh.corner_texcoord.empty()) return {};
  return Borders([this](const HalfEdge& a, const HalfEdge& b) { return SameUv(a, b); });
}

double PolygonEdges::Length(const HalfEdge& half_edge) const {
  return (file_.mesh.positions[half_edge.high] - file_.mesh.positions[half_edge.low]).norm();
}

std::vector<std::int32_t> PolygonEdges::UvFolds() const {
  constexpr double kLeastShare = 0.01;
  const PolygonMesh& mesh = file_.mesh;
  if (mesh.corner_texcoord.empty()) return {};
  const auto polygons = static_cast<std::size_t>(mesh.num_polygons());
  std::vector<double> area(polygons, 0), uv_area(polygons, 0), outline(polygons, 0);
  for (std::size_t f = 0; f < triangles_.source_polygon.size(); ++f) {
    std::array<Vec3, 3> place;
    std::array<Vec2, 3> uv;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int64_t corner = triangles_.corner_of_triangle[3 * f + k];
      const std::int32_t texcoord = mesh.corner_texcoord[corner];
      place[k] = mesh.positions[mesh.corner_vertex[corner]];
      uv[k] = texcoord < 0 ? Vec2(0, 0) : mesh.texcoords[texcoord];
    }
    const auto polygon = static_cast<std::size_t>(triangles_.source_polygon[f]);
    area[polygon] += (place[1] - place[0]).cross(place[2] - place[0]).norm() / 2;
    const Vec2 a = uv[1] - uv[0], b = uv[2] - uv[0];
    uv_area[polygon] += (a.x() * b.y() - a.y() * b.x()) / 2;
  }
  // `islands` joins polygons that share UV at an edge; `parts` joins them only if the edge is not a fold. At a fold,
  // the polygons on both sides have UV areas of opposite sign.
  UnionFind islands(polygons), parts(polygons);
  std::vector<std::pair<HalfEdge, HalfEdge>> folds;
  const auto of = [&](const HalfEdge& h) { return static_cast<std::int32_t>(PolygonOf(h)); };
  ForEachEdge([&](auto begin, auto end) {
    if (end - begin != 2 || !SameUv(begin[0], begin[1])) {
      for (auto h = begin; h != end; ++h) outline[of(*h)] += Length(*h);
      return;
    }
    const std::int32_t a = of(begin[0]), b = of(begin[1]);
    islands.Join(a, b);
    if (uv_area[a] * uv_area[b] < 0) {
      folds.emplace_back(begin[0], begin[1]);
    } else {
      parts.Join(a, b);
    }
  });
  if (folds.empty()) return {};
  std::vector<double> of_island(polygons, 0), of_part(polygons, 0), outline_of_island(polygons, 0);
  for (std::int32_t p = 0; p < static_cast<std::int32_t>(polygons); ++p) {
    of_island[islands.Find(p)] += area[p];
    of_part[parts.Find(p)] += area[p];
    outline_of_island[islands.Find(p)] += outline[p];
  }
  std::vector<std::int32_t> corners;
  for (const auto& [first, second] : folds) {
    const std::int32_t island = islands.Find(of(first));
    const double all = of_island[island], around = outline_of_island[island];
    const double smaller = std::min(of_part[parts.Find(of(first))], of_part[parts.Find(of(second))]);
    if (smaller < kLeastShare * all || around * around >= 4 * std::numbers::pi * all) continue;
    corners.push_back(first.corner);
  }
  std::sort(corners.begin(), corners.end());
  return corners;
}

std::vector<std::int32_t> PolygonEdges::MaterialBorders() const {
  const auto& material = file_.mesh.polygon_material;
  if (material.empty()) return {};
  return Borders(
      [&](const HalfEdge& a, const HalfEdge& b) { return material[PolygonOf(a)] == material[PolygonOf(b)]; });
}

std::vector<std::int32_t> PolygonEdges::GroupBorders() const {
  const auto& group = file_.mesh.polygon_group;
  if (group.empty()) return {};
  return Borders([&](const HalfEdge& a, const HalfEdge& b) { return group[PolygonOf(a)] == group[PolygonOf(b)]; });
}

std::vector<std::int32_t> PolygonEdges::ListedIn(const std::string& path) const {
  if (file_.format == MeshFormat::kStl) {
    Malformed(path, 0, "the vertices of an STL have no numbers, so their edges cannot be listed");
  }
  const absl::StatusOr<std::string> text = ReadWholeFile(path);
  if (!text.ok()) throw ErrorFrom(text.status());
  std::istringstream stream(*text);
  const std::int64_t first = file_.format == MeshFormat::kObj ? 1 : 0;
  const std::int64_t last = static_cast<std::int64_t>(file_.mesh.positions.size()) - 1 + first;
  std::vector<std::int32_t> corners;
  std::int64_t line_number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++line_number;
    const std::vector<std::string> words = Words(line);
    if (words.empty()) continue;
    if (words.size() != 2) Malformed(path, line_number, "expected the numbers of two vertices");
    std::int64_t ends[2] = {};
    for (int i = 0; i < 2; ++i) {
      if (!ParseInt(words[i], &ends[i]) || ends[i] < first || ends[i] > last) {
        Malformed(path, line_number,
                  Quoted(words[i]) + " is no vertex of " + file_.path + ", which has " + std::to_string(first) +
                      " to " + std::to_string(last));
      }
    }
    const auto [low, high] =
        std::minmax({static_cast<std::int32_t>(ends[0] - first), static_cast<std::int32_t>(ends[1] - first)});
    const auto found =
        std::lower_bound(half_edges_.begin(), half_edges_.end(), std::pair(low, high),
                         [](const HalfEdge& h, const auto& edge) { return std::pair(h.low, h.high) < edge; });
    if (found == half_edges_.end() || found->low != low || found->high != high) {
      Malformed(path, line_number,
                "no face of " + file_.path + " has an edge from vertex " + words[0] + " to vertex " + words[1]);
    }
    corners.push_back(found->corner);
  }
  std::sort(corners.begin(), corners.end());
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  return corners;
}

std::int64_t PolygonEdges::CountUvIslands() const {
  if (file_.mesh.corner_texcoord.empty()) return 0;
  std::vector<std::int64_t> parent(static_cast<std::size_t>(file_.mesh.num_polygons()));
  std::iota(parent.begin(), parent.end(), std::int64_t{0});
  const auto root = [&](std::int64_t p) {
    while (parent[p] != p) p = parent[p] = parent[parent[p]];
    return p;
  };
  std::vector<char> counts(parent.size(), 0);
  for (const HalfEdge& half_edge : half_edges_) counts[PolygonOf(half_edge)] = 1;
  std::int64_t islands = std::count(counts.begin(), counts.end(), 1);
  ForEachEdge([&](auto begin, auto end) {
    if (end - begin != 2 || !SameUv(begin[0], begin[1])) return;
    const std::int64_t a = root(PolygonOf(begin[0])), b = root(PolygonOf(begin[1]));
    if (a == b) return;
    parent[std::max(a, b)] = std::min(a, b);
    --islands;
  });
  return islands;
}

std::vector<std::int32_t> UncutCorners(const MeshFile& file, const Triangulation& triangles, const SeamList& list) {
  std::vector<std::int32_t> corners;
  if (list.uncut_files.empty()) return corners;
  const PolygonEdges edges(file, triangles);
  for (const std::string& path : list.uncut_files) {
    const std::vector<std::int32_t> listed = edges.ListedIn(path);
    corners.insert(corners.end(), listed.begin(), listed.end());
  }
  std::sort(corners.begin(), corners.end());
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  return corners;
}

std::vector<std::int32_t> SeamCorners(const MeshFile& file, const Triangulation& triangles, const SeamList& list) {
  if (!list.NeedsFile()) return {};
  const auto require = [&](bool wanted, bool present, const char* source, const char* what) {
    if (!wanted || present) return;
    throw Error(ErrorCode::kInvalidArgument, "OPTIONS_INVALID",
                std::string("--seams=") + source + ": " + file.path + " has no " + what, {{"field", "seams"}});
  };
  require(list.uv && !list.uv_is_optional, !file.mesh.corner_texcoord.empty(), "uv", "UV");
  require(list.materials, !file.mesh.polygon_material.empty(), "materials", "materials");
  require(list.groups, !file.mesh.polygon_group.empty(), "groups", "objects or groups");

  const PolygonEdges edges(file, triangles);
  std::vector<std::int32_t> corners;
  const auto add = [&](const std::vector<std::int32_t>& more) {
    corners.insert(corners.end(), more.begin(), more.end());
  };
  if (list.uv) add(edges.UvBorders()), add(edges.UvFolds());
  if (list.materials) add(edges.MaterialBorders());
  if (list.groups) add(edges.GroupBorders());
  for (const std::string& path : list.edge_files) add(edges.ListedIn(path));
  std::sort(corners.begin(), corners.end());
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  return corners;
}

}  // namespace planish::cli
