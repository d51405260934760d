// Draco data from anybody, as a worker and the server's first look see them.
#include <cmath>
#include <cstring>
#include <string>

#include "core/base/error.h"
#include "core/draco/codec.h"
#include "core/draco/header.h"
#include "core/mesh/diagnosis.h"
#include "tests/fuzz/check.h"
#include "tests/fuzz/memory_budget.h"

namespace planish::fuzz::draco_to_mesh {
namespace {

constexpr DracoLimits kLimits = {.max_faces = 20'000, .max_vertices = 20'000};
// For Draco, which believes what it reads.
constexpr std::int64_t kMemory = std::int64_t{256} << 20;

void CheckPrefix(std::string_view bytes, const DracoCounts& counts) {
  const auto prefix = PeekDraco(bytes.substr(0, bytes.size() / 2));
  if (!prefix.ok()) return RequireReason(prefix.status(), {"MESH_DECODE_FAILED"});
  Require(prefix->geometry == counts.geometry && prefix->method == counts.method, "a prefix says no other kind");
  Require(!prefix->faces || prefix->faces == counts.faces, "a prefix declares no other faces");
  Require(!prefix->vertices || prefix->vertices == counts.vertices, "a prefix declares no other vertices");
}

void CheckMesh(const Mesh& mesh) {
  Require(mesh.num_faces() > 0 && mesh.num_faces() <= kLimits.max_faces, "faces within the limit");
  Require(mesh.num_vertices() <= kLimits.max_vertices, "vertices within the limit");
  bool finite = true;
  for (const Face& face : mesh.faces) {
    for (const std::int32_t vertex : face) {
      Require(vertex >= 0 && vertex < mesh.num_vertices(), "indices in range");
      finite = finite && mesh.positions[static_cast<std::size_t>(vertex)].allFinite();
    }
  }
  // NaN and infinity may come out of the decoder, and go no further.
  const auto diagnosis = Diagnose(mesh);
  Require(diagnosis.ok(), "every mesh has a diagnosis");
  Require((diagnosis->vertices_not_finite.count == 0) == finite, "it sees exactly the positions that are not finite");
  if (!finite) RequireReason(diagnosis->Refusal(), {"MESH_POSITION_NOT_FINITE"});
}

void CheckRoundTrip(const Mesh& mesh) {
  const auto bytes = EncodeDraco(mesh);
  if (!bytes.ok()) return RequireReason(bytes.status(), {"MESH_DECODE_FAILED", "OUT_OF_MEMORY"});
  const auto again = DecodeDraco(*bytes, kLimits);
  if (ErrorInfoOf(again.status()).reason == "OUT_OF_MEMORY") return;
  Require(again.ok(), "what was encoded here can be decoded");
  Require(again->faces == mesh.faces, "encoding keeps faces");
  Require(again->positions.size() == mesh.positions.size(), "encoding keeps vertices");
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    // NaN may change its payload on the way to double and back.
    const bool same = std::memcmp(mesh.positions[v].data(), again->positions[v].data(), sizeof(Vec3)) == 0;
    Require(same || !mesh.positions[v].allFinite(), "encoding keeps positions");
  }
}

}  // namespace

FUZZ_TARGET(draco_to_mesh, bytes) {
  const MemoryBudget budget(kMemory);
  const auto counts = PeekDraco(bytes);
  const auto mesh = DecodeDraco(bytes, kLimits);
  if (!counts.ok()) {
    RequireReason(counts.status(), {"MESH_DECODE_FAILED"});
    Require(mesh.status() == counts.status(), "what is no Draco header is no mesh, for the same reason");
    return;
  }
  Require(counts->faces.value_or(0) >= 0 && counts->vertices.value_or(0) >= 0, "counts are not negative");
  CheckPrefix(bytes, *counts);
  const bool declares_more =
      counts->geometry == DracoGeometry::kMesh &&
      (counts->faces.value_or(0) > kLimits.max_faces || counts->vertices.value_or(0) > kLimits.max_vertices);
  if (declares_more) RequireReason(mesh.status(), {"MESH_TOO_LARGE"});
  if (!mesh.ok()) {
    RequireReason(mesh.status(), {"MESH_DECODE_FAILED", "MESH_NOT_A_MESH", "MESH_EMPTY", "MESH_POSITION_INVALID",
                                  "MESH_INDEX_OUT_OF_RANGE", "MESH_TOO_LARGE", "OUT_OF_MEMORY"});
    return;
  }
  Require(counts->geometry == DracoGeometry::kMesh, "a mesh says that it is one");
  CheckMesh(*mesh);
  CheckRoundTrip(*mesh);
}

}  // namespace planish::fuzz::draco_to_mesh
