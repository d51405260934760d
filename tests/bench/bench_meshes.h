// Surfaces by formula in any number of triangles, for measuring. Shapes after those of the paper, whose own meshes are
// not public; connectivity is irregular (jittered points, shorter diagonals), as on scans.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"

namespace planish::bench {

// Names that MakeMesh takes:
//   ear          a folded shell, open at its rim
//   head         four fifths of a sphere with a nose, brows and ears, open at the neck
//   twists       a ribbon with three half turns along a bent axis
//   waves        a height surface with hills, valleys and saddles, in the place of the paper's Goldfeather surface
//   foot         a closed toe, a sole and an open leg: a long tube, on which the scale of a flat map varies most
const std::vector<std::string>& MeshNames();

// A disc of exactly `triangles` faces, at least 100. The same mesh on every call. `name` must be one of MeshNames().
Mesh MakeMesh(const std::string& name, std::int64_t triangles);

// What the measuring programs take for a mesh:
//   NAME:TRIANGLES         one of the above
//   FAMILY:TRIANGLES:SEED  about so many triangles (tests/testing/families.h)
//   PATH                   a mesh file
//   PATH@LEVELS            the same after so many Loop subdivisions
absl::StatusOr<Mesh> LoadMesh(const std::string& spec);
// Its short name in tables: NAME, FAMILY_TRIANGLES_SEED, the file's name without extension, and _L1 and the like after
// subdivision.
std::string LabelOf(const std::string& spec);

// A mesh file's triangles, and the corners that face the borders of its UV islands.
struct SeamedMesh {
  Mesh mesh;
  bool has_uv = false;
  std::vector<std::int32_t> seam_corners;  // empty without UV
};
// Nothing if the file cannot be read.
std::optional<SeamedMesh> ReadWithSeams(const std::string& path);

// Loop subdivision with his rules for the boundary: four triangles for one, vertices smoothed. `mesh` must be manifold.
Mesh SubdivideLoop(const Mesh& mesh);

}  // namespace planish::bench
