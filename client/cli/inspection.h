// What `planish inspect` has to say about a mesh file.
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

// Elements of one kind that a person may want to know of. Ids are 0-based, as the file counts its polygons and
// vertices; the first few only.
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
  std::int64_t uv_seams = 0;  // edges between UV islands, and within one
  std::vector<std::string> materials;
  std::vector<std::string> groups;
  std::vector<Finding> findings;  // one for every kind, even if its count is 0
  // Why unwrap takes no such mesh, in the file's ids; nothing if it does.
  std::optional<Error> refusal;
  // What unwrap does with default options, a phrase each: "adds seams to open 1 closed component".
  std::vector<std::string> plan;
  // Why --seams=none would refuse the mesh, in the file's ids; nothing if it is a disc.
  std::optional<Error> not_a_disc;
};

// Throws planish::Error for a mesh too large to be looked at.
Inspection Inspect(const MeshInput& input);

// For people: a few dozen lines at most for any mesh.
std::string InspectionText(const MeshInput& input, const Inspection& inspection);

// For programs; the fields are described in client/JSON.md.
Json InspectionJson(const MeshInput& input, const Inspection& inspection);

}  // namespace planish::cli
