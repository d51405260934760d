// Examines a mesh file for `planish inspect`.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/mesh_input.h"
#include "client/cli/results.h"
#include "core/mesh/diagnosis.h"

namespace planish::cli {

// Unusual elements of one kind, such as triangles without area. The lists have the ids of the first few: 0-based, as
// the file counts its polygons and vertices.
struct Finding {
  std::string name;  // key in the JSON: the name of the list in core/mesh/diagnosis.h
  std::string text;  // "3 triangles have no area"
  std::int64_t count = 0;
  std::vector<std::int64_t> faces;
  std::vector<std::int64_t> vertices;
  std::vector<std::array<std::int64_t, 2>> edges;
  std::string places;  // "face 12 (in.obj:345), ..."
};

struct Inspection {
  // Diagnosis of the file's triangles with positions rounded to float, as they are sent. Vertices are numbered as in
  // the file, faces as in its triangulation.
  Diagnosis diagnosis;
  std::int64_t polygons = 0;
  std::int64_t uv_islands = 0;
  std::int64_t uv_seams = 0;  // edges whose UV differ on both sides, between two UV islands or within one
  std::vector<std::string> materials;
  std::vector<std::string> groups;
  std::vector<Finding> findings;  // one for every kind, even if its count is 0
  // Why unwrap would refuse the mesh, in the file's ids; nothing if unwrap would take it.
  std::optional<Error> refusal;
  // What unwrap would do with default options, in phrases such as "adds seams that open 1 closed component".
  std::vector<std::string> plan;
  // Why --seams=none would refuse the mesh, in the file's ids; nothing if it is a disc.
  std::optional<Error> not_a_disc;
};

// Examines `input`, one file. Throws planish::Error if the mesh is too large.
Inspection Inspect(const MeshInput& input);

// The text for people: a few dozen lines at most for any mesh.
std::string InspectionText(const MeshInput& input, const Inspection& inspection);

// For programs; the fields are described in client/JSON.md.
Json InspectionJson(const MeshInput& input, const Inspection& inspection);

}  // namespace planish::cli
