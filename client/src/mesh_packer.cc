#include "client/src/mesh_packer.h"

#include <algorithm>
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

// A corner that faces each of the edges, which `triangles` (three ids each) must have.
std::vector<std::int32_t> CornersFacing(std::span<const std::uint32_t> vertex_pairs,
                                        std::span<const std::uint32_t> triangles) {
  std::vector<std::pair<Edge, std::int32_t>> seams;  // with the first corner that faces each; -1: none yet
  for (std::size_t i = 0; i + 1 < vertex_pairs.size(); i += 2) {
    seams.emplace_back(std::minmax({vertex_pairs[i], vertex_pairs[i + 1]}), -1);
  }
  std::sort(seams.begin(), seams.end());
  seams.erase(std::unique(seams.begin(), seams.end()), seams.end());
  for (std::size_t c = 0; c < triangles.size(); ++c) {
    const std::size_t first = c - c % 3;
    const Edge edge = std::minmax({triangles[first + (c + 1) % 3], triangles[first + (c + 2) % 3]});
    const auto found = std::lower_bound(seams.begin(), seams.end(), std::pair(edge, -1));
    if (found != seams.end() && *found == std::pair(edge, -1)) found->second = static_cast<std::int32_t>(c);
  }
  std::vector<std::int32_t> corners;
  for (const auto& [edge, corner] : seams) {
    if (corner < 0) {
      throw Invalid("OPTIONS_INVALID", "an edge that is to be a seam is no edge of any triangle",
                    {{"field", "seam_corners"}, {"edges", absl::StrCat(edge.first, "-", edge.second)}});
    }
    corners.push_back(corner);
  }
  return corners;
}

// `corners`, all of them among 3 `triangles`.
void CheckCorners(const std::string& field, std::span<const std::int32_t> corners, std::int64_t triangles) {
  for (const std::int32_t corner : corners) {
    if (corner >= 0 && corner < 3 * triangles) continue;
    throw Invalid("OPTIONS_INVALID",
                  absl::StrCat(field, ": there is no corner ", corner, ", the mesh has ", triangles, " triangles"),
                  {{"field", field}, {"corner", absl::StrCat(corner)}});
  }
}

template <typename Number>
std::vector<Number> OfEachTriangle(const std::string& field, std::span<const Number> numbers, std::int64_t triangles) {
  if (!numbers.empty() && static_cast<std::int64_t>(numbers.size()) != triangles) {
    throw Invalid("OPTIONS_INVALID",
                  absl::StrCat(field, ": ", numbers.size(), " numbers for a mesh of ", triangles, " triangles"),
                  {{"field", field}});
  }
  return {numbers.begin(), numbers.end()};
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
  packed.seam_corners = CornersFacing(view.seam_vertices_, view.indices_);
  packed.seam_corners.insert(packed.seam_corners.end(), view.seam_corners_.begin(), view.seam_corners_.end());
  packed.uncut_corners.assign(view.uncut_corners_.begin(), view.uncut_corners_.end());
  packed.face_atlas = OfEachTriangle("face_atlas", view.face_atlas_, view.triangle_count());
  packed.face_weights = OfEachTriangle("face_weights", view.face_weights_, view.triangle_count());

  absl::StatusOr<std::string> draco = EncodeDraco(mesh);
  if (!draco.ok()) throw Renumbered(ErrorFrom(draco.status()), packed.ToCaller());
  packed.draco = *std::move(draco);
  packed.sha256 = Sha256(packed.draco);
  return packed;
}

}  // namespace planish::inline abi0
