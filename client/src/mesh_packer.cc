#include "client/src/mesh_packer.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "client/src/errors.h"
#include "core/base/sha256.h"
#include "core/draco/codec.h"
#include "planish/error.h"

namespace planish {
inline namespace abi0 {
namespace {

Error BadMesh(const std::string& reason, const std::string& message, const Error::Metadata& metadata = {}) {
  return Error(ErrorCode::kInvalidArgument, reason, message, metadata);
}

Error BadSeam(const std::string& message, const Error::Metadata& metadata) {
  return Error(ErrorCode::kInvalidArgument, "OPTIONS_INVALID", message, metadata);
}

using Edge = std::pair<std::uint32_t, std::uint32_t>;  // the smaller id first

// A corner that faces each of the edges, which `triangles` (three ids each) must have.
std::vector<std::int32_t> CornersFacing(std::span<const std::uint32_t> vertex_pairs,
                                        std::span<const std::uint32_t> triangles) {
  std::vector<Edge> edges(vertex_pairs.size() / 2);
  for (std::size_t i = 0; i < edges.size(); ++i) edges[i] = std::minmax({vertex_pairs[2 * i], vertex_pairs[2 * i + 1]});
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  std::vector<std::int32_t> corners(edges.size(), -1);
  for (std::size_t c = 0; c < triangles.size(); ++c) {
    const std::size_t first = c - c % 3;
    const Edge edge = std::minmax({triangles[first + (c + 1) % 3], triangles[first + (c + 2) % 3]});
    const auto found = std::lower_bound(edges.begin(), edges.end(), edge);
    if (found == edges.end() || *found != edge) continue;
    std::int32_t& corner = corners[static_cast<std::size_t>(found - edges.begin())];
    if (corner < 0) corner = static_cast<std::int32_t>(c);
  }
  const auto missing = std::find(corners.begin(), corners.end(), -1);
  if (missing == corners.end()) return corners;
  const Edge& edge = edges[static_cast<std::size_t>(missing - corners.begin())];
  const std::string a = std::to_string(edge.first), b = std::to_string(edge.second);
  throw BadSeam("no triangle has the edge from vertex " + a + " to vertex " + b + ", which is to be a seam",
                {{"field", "seam_corners"}, {"edges", a + "-" + b}});
}

// `corners`, all of them among 3 `triangles`.
void CheckCorners(const std::string& field, std::span<const std::int32_t> corners, std::int64_t triangles) {
  for (const std::int32_t corner : corners) {
    if (corner >= 0 && corner < 3 * triangles) continue;
    throw BadSeam(field + ": there is no corner " + std::to_string(corner) + ", the mesh has " +
                      std::to_string(triangles) + " triangles",
                  {{"field", field}, {"corner", std::to_string(corner)}});
  }
}

}  // namespace

ids::Renumbering PackedMesh::ToCaller() const {
  ids::Renumbering renumbering;
  if (source_vertex.empty()) return renumbering;
  renumbering.vertex = [this](std::int64_t v) -> std::int64_t {
    return v < static_cast<std::int64_t>(source_vertex.size()) ? source_vertex[static_cast<std::size_t>(v)] : -1;
  };
  return renumbering;
}

PackedMesh MeshPacker::Pack(const MeshView& view) {
  if (view.coordinate_count_ % 3 != 0 || view.index_count_ % 3 != 0) {
    throw BadMesh("MESH_POSITION_INVALID", "positions and triangles must come in threes; got " +
                                               std::to_string(view.coordinate_count_) + " coordinates and " +
                                               std::to_string(view.index_count_) + " indices");
  }
  if (view.index_count_ == 0) throw BadMesh("MESH_EMPTY", "the mesh has no triangles; there is nothing to flatten");
  const std::int64_t vertex_count = view.vertex_count();
  if (vertex_count > std::numeric_limits<std::int32_t>::max()) {
    throw BadMesh("MESH_TOO_LARGE", "the mesh has more than 2^31 vertices");
  }

  std::vector<std::int32_t> sent(static_cast<std::size_t>(vertex_count), -1);
  for (std::int64_t i = 0; i < view.index_count_; ++i) {
    if (view.indices_[i] >= static_cast<std::uint64_t>(vertex_count)) {
      throw BadMesh("MESH_INDEX_OUT_OF_RANGE",
                    "face " + std::to_string(i / 3) + " refers to vertex " + std::to_string(view.indices_[i]) +
                        ", but the mesh has " + std::to_string(vertex_count),
                    {{"faces", std::to_string(i / 3)}});
    }
    sent[view.indices_[i]] = 0;
  }

  PackedMesh packed;
  packed.triangles = view.triangle_count();
  Mesh mesh;
  for (std::int64_t v = 0; v < vertex_count; ++v) {
    if (sent[static_cast<std::size_t>(v)] < 0) continue;
    sent[static_cast<std::size_t>(v)] = static_cast<std::int32_t>(mesh.positions.size());
    packed.source_vertex.push_back(static_cast<std::int32_t>(v));
    if (view.floats_ != nullptr) {
      mesh.positions.emplace_back(view.floats_[3 * v], view.floats_[3 * v + 1], view.floats_[3 * v + 2]);
    } else {
      mesh.positions.emplace_back(view.doubles_[3 * v], view.doubles_[3 * v + 1], view.doubles_[3 * v + 2]);
    }
  }
  mesh.faces.resize(static_cast<std::size_t>(view.triangle_count()));
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (std::size_t k = 0; k < 3; ++k) mesh.faces[f][k] = sent[view.indices_[3 * f + k]];
  }
  if (mesh.num_vertices() == vertex_count) packed.source_vertex.clear();
  if (view.seam_vertices_.size() % 2 != 0) {
    throw BadSeam("seams are pairs of vertices; got " + std::to_string(view.seam_vertices_.size()) + " ids",
                  {{"field", "seam_corners"}});
  }
  CheckCorners("seam_corners", view.seam_corners_, view.triangle_count());
  CheckCorners("uncut_corners", view.uncut_corners_, view.triangle_count());
  packed.seam_corners =
      CornersFacing(view.seam_vertices_, {view.indices_, static_cast<std::size_t>(view.index_count_)});
  packed.seam_corners.insert(packed.seam_corners.end(), view.seam_corners_.begin(), view.seam_corners_.end());
  packed.uncut_corners.assign(view.uncut_corners_.begin(), view.uncut_corners_.end());

  absl::StatusOr<std::string> draco = EncodeDraco(mesh);
  if (!draco.ok()) throw Renumbered(ErrorFrom(draco.status()), packed.ToCaller());
  packed.draco = *std::move(draco);
  packed.sha256 = Sha256(packed.draco);
  return packed;
}

}  // namespace abi0
}  // namespace planish
