// Element ids in the metadata of errors and warnings: "12,40", and "3-7,7-9" for edges.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace planish::ids {

// "12,40".
std::string IdList(std::span<const std::int64_t> ids);

// The ids of vertices, edges or faces in a value, in order. Everything but digits separates ids.
std::vector<std::int64_t> IdsIn(const std::string& text);

// Maps an old id to a new one. An empty function keeps all ids; a negative result keeps this id.
using IdMap = std::function<std::int64_t(std::int64_t)>;

// Maps ids of one numbering to those of another, such as that of the uploaded mesh.
struct Renumbering {
  IdMap vertex;
  IdMap face;
};

// Renumbers the values under "vertex", "vertices", "edge", "edges", "face" and "faces". Where several
// faces get the same id, such as the triangles of a polygon, the id is listed once.
std::map<std::string, std::string> RenumberMetadata(const std::map<std::string, std::string>& metadata,
                                                    const Renumbering& renumbering);

}  // namespace planish::ids
