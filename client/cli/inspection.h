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
  std::string name;  // as in the JSON: that of the list in core/mesh/diagnosis.h
  std::string text;  // "3 triangles have no area"
  std::int64_t count = 0;
  std::vector<std::int64_t> faces;
  std::vector<std::int64_t> vertices;
  std::vector<std::array<std::int64_t, 2>> edges;
  std::string places;  // "face 12 (in.obj:345), ..."
};

struct Inspection {
  // Of the file's triangles with the positions that travel, which are floats; vertices numbered as in the file, faces
  // as the triangles of its triangulation.
  Diagnosis diagnosis;
  std::int64_t polygons = 0;
  std::int64_t uv_islands = 0;
  std::int64_t uv_seams = 0;  // edges between UV islands, and within one
  std::vector<std::string> materials;
  std::vector<std::string> groups;
  std::vector<Finding> findings;  // of every kind, those with a count of 0 too
  // Why unwrap takes no such mesh, in the file's ids; nothing if it does.
  std::optional<Error> refusal;
  // What unwrap does with default options, a phrase each: "adds seams to open 1 closed component".
  std::vector<std::string> plan;
  // Why --seams=none would refuse the mesh, in the file's ids; nothing if it is a disc.
  std::optional<Error> not_a_disc;
};

// Throws planish::Error for a mesh too large to be looked at.
Inspection Inspect(const MeshInput& input);

// For people: a few dozen lines at most, whatever the mesh.
std::string InspectionText(const MeshInput& input, const Inspection& inspection);

// For programs; the fields are described in client/JSON.md.
Json InspectionJson(const MeshInput& input, const Inspection& inspection);

}  // namespace planish::cli
