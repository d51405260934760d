#include "client/src/mesh_packer.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/src/errors.h"
#include "core/base/sha256.h"
#include "core/draco/codec.h"
#include "core/mesh/local_origin.h"

namespace planish::inline abi0 {
namespace {

using Edge = std::pair<std::uint32_t, std::uint32_t>;  // the smaller id first

// For each edge of `vertex_pairs`, without duplicates: a corner of `triangles` (three ids each) that faces the edge.
// `polygon`: the polygon of each triangle; empty: each triangle is one. Throws OPTIONS_INVALID for a pair that is not
// an edge, or is a diagonal, which has triangles of one polygon on both sides and cannot be a seam.
std::vector<std::int32_t> CornersFacing(std::span<const std::uint32_t> vertex_pairs,
                                        std::span<const std::uint32_t> triangles,
                                        std::span<const std::int32_t> polygon) {
  std::vector<Edge> seams;
  for (std::size_t i = 0; i + 1 < vertex_pairs.size(); i += 2) {
    seams.emplace_back(std::minmax({vertex_pairs[i], vertex_pairs[i + 1]}));
  }
  std::sort(seams.begin(), seams.end());
  seams.erase(std::unique(seams.begin(), seams.end()), seams.end());
  std::vector<std::vector<std::int32_t>> facing(seams.size());
  for (std::size_t c = 0; c < triangles.size() && !seams.empty(); ++c) {
    const std::size_t first = c - c % 3;
    const Edge edge = std::minmax({triangles[first + (c + 1) % 3], triangles[first + (c + 2) % 3]});
    const auto found = std::lower_bound(seams.begin(), seams.end(), edge);
    if (found != seams.end() && *found == edge) facing[found - seams.begin()].push_back(static_cast<std::int32_t>(c));
  }
  std::vector<std::int32_t> corners;
  for (std::size_t i = 0; i < seams.size(); ++i) {
    const auto is_own = [&](std::int32_t c) {  // whether the edge belongs to the outline of the polygon of corner c
      return polygon.empty() ||
             std::count_if(facing[i].begin(), facing[i].end(), [&](std::int32_t d) {
               return polygon[static_cast<std::size_t>(d / 3)] == polygon[static_cast<std::size_t>(c / 3)];
             }) == 1;
    };
    const auto own = std::find_if(facing[i].begin(), facing[i].end(), is_own);
    if (own == facing[i].end()) {
      throw Invalid("OPTIONS_INVALID",
                    facing[i].empty() ? "an edge that is to be a seam is no edge of any triangle"
                                      : "an edge that is to be a seam is a diagonal of a polygon",
                    {{"field", "seam_corners"}, {"edges", absl::StrCat(seams[i].first, "-", seams[i].second)}});
    }
    corners.push_back(*own);
  }
  return corners;
}

// Throws OPTIONS_INVALID unless all of `corners` are corners of a mesh with this number of triangles.
void CheckCorners(const std::string& field, std::span<const std::int32_t> corners, std::int64_t triangles) {
  for (const std::int32_t corner : corners) {
    if (corner >= 0 && corner < 3 * triangles) continue;
    throw Invalid("OPTIONS_INVALID",
                  absl::StrCat(field, ": there is no corner ", corner, ", the mesh has ", triangles, " triangles"),
                  {{"field", field}, {"corner", absl::StrCat(corner)}});
  }
}

// Appends numbers to `bytes`, in the format of planish.v1.MeshElements.
template <typename Number>
void Append(std::span<const Number> numbers, std::string* bytes) {
  static_assert(sizeof(Number) == 4);
  bytes->reserve(bytes->size() + 4 * numbers.size());
  for (const Number number : numbers) {
    const auto value = std::bit_cast<std::uint32_t>(number);
    for (int shift = 0; shift < 32; shift += 8) bytes->push_back(static_cast<char>(value >> shift));
  }
}

template <typename Number>
void AppendOfTriangles(const std::string& field, std::span<const Number> numbers, std::int64_t triangles,
                       std::string* bytes) {
  if (!numbers.empty() && static_cast<std::int64_t>(numbers.size()) != triangles) {
    throw Invalid("OPTIONS_INVALID",
                  absl::StrCat(field, ": ", numbers.size(), " numbers for a mesh of ", triangles, " triangles"),
                  {{"field", field}});
  }
  Append(numbers, bytes);
}

}  // namespace

void CheckIndices(std::span<const std::uint32_t> triangles, std::size_t vertex_count) {
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    if (triangles[i] < vertex_count) continue;
    throw Invalid("MESH_INDEX_OUT_OF_RANGE",
                  absl::StrCat("a face has the index ", triangles[i], ", but the mesh has ", vertex_count, " vertices"),
                  {{"faces", absl::StrCat(i / 3)}});
  }
}

std::int64_t PackedMesh::bytes() const {
  const std::size_t of_elements = elements.seam_corners().size() + elements.uncut_corners().size() +
                                  elements.face_polygon().size() + elements.face_atlas().size() +
                                  elements.face_weights().size();
  return static_cast<std::int64_t>(draco.size() + of_elements);
}

ids::Renumbering PackedMesh::ToCaller() const {
  const auto vertex = [this](std::int64_t v) -> std::int64_t {
    return v < static_cast<std::int64_t>(source_vertex.size()) ? source_vertex[static_cast<std::size_t>(v)] : -1;
  };
  return {vertex, {}};
}

PackedMesh PackedMesh::Of(const MeshView& view) {
  const std::size_t coordinates = std::visit([](auto numbers) { return numbers.size(); }, view.positions_);
  if (coordinates % 3 != 0 || view.indices_.size() % 3 != 0) {
    throw Invalid("MESH_POSITION_INVALID",
                  absl::StrCat("positions and triangles must come in threes; got ", coordinates, " coordinates and ",
                               view.indices_.size(), " indices"));
  }
  if (view.indices_.empty()) throw Invalid("MESH_EMPTY", "the mesh has no triangles; there is nothing to flatten");
  const std::size_t vertex_count = coordinates / 3;
  if (vertex_count > std::numeric_limits<std::int32_t>::max()) {
    throw Invalid("MESH_TOO_LARGE", "the mesh has more than 2^31 vertices");
  }
  CheckIndices(view.indices_, vertex_count);
  std::vector<std::int32_t> sent(vertex_count, -1);
  for (const std::uint32_t v : view.indices_) sent[v] = 0;

  PackedMesh packed;
  packed.triangles = view.triangle_count();
  Mesh mesh;
  for (std::size_t v = 0; v < vertex_count; ++v) {
    if (sent[v] < 0) continue;
    sent[v] = static_cast<std::int32_t>(mesh.positions.size());
    packed.source_vertex.push_back(static_cast<std::int32_t>(v));
    std::visit([&](auto p) { mesh.positions.emplace_back(p[3 * v], p[3 * v + 1], p[3 * v + 2]); }, view.positions_);
  }
  const Vec3 origin = LocalOrigin(mesh.positions);
  if (!origin.isZero(0)) {
    for (Vec3& position : mesh.positions) position -= origin;
  }
  mesh.faces.resize(view.indices_.size() / 3);
  for (std::size_t c = 0; c < view.indices_.size(); ++c) mesh.faces[c / 3][c % 3] = sent[view.indices_[c]];
  if (mesh.positions.size() == vertex_count) packed.source_vertex.clear();
  if (view.seam_vertices_.size() % 2 != 0) {
    throw Invalid("OPTIONS_INVALID",
                  absl::StrCat("seams are pairs of vertices; got ", view.seam_vertices_.size(), " ids"),
                  {{"field", "seam_corners"}});
  }
  CheckCorners("seam_corners", view.seam_corners_, view.triangle_count());
  CheckCorners("uncut_corners", view.uncut_corners_, view.triangle_count());
  // Comes first, because CornersFacing() below needs a polygon for every triangle.
  AppendOfTriangles("face_polygon", view.face_polygon_, view.triangle_count(), packed.elements.mutable_face_polygon());
  v1::MeshElements& elements = packed.elements;
  const std::vector<std::int32_t> facing = CornersFacing(view.seam_vertices_, view.indices_, view.face_polygon_);
  Append(std::span<const std::int32_t>(facing), elements.mutable_seam_corners());
  Append(view.seam_corners_, elements.mutable_seam_corners());
  Append(view.uncut_corners_, elements.mutable_uncut_corners());
  const std::int64_t triangles = view.triangle_count();
  AppendOfTriangles("face_atlas", view.face_atlas_, triangles, elements.mutable_face_atlas());
  AppendOfTriangles("face_weights", view.face_weights_, triangles, elements.mutable_face_weights());

  absl::StatusOr<std::string> draco = EncodeDraco(mesh);
  if (!draco.ok()) throw Renumbered(ErrorFrom(draco.status()), packed.ToCaller());
  packed.draco = *std::move(draco);
  packed.sha256 = Sha256(packed.draco);
  return packed;
}

}  // namespace planish::inline abi0
