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

// The ids of vertices, edges or faces in a value, in order; whatever is no digit is passed over.
std::vector<std::int64_t> IdsIn(const std::string& text);

// New id of an old one. An empty function keeps ids; a negative answer keeps that id.
using IdMap = std::function<std::int64_t(std::int64_t)>;

// From one numbering, such as that of the mesh as sent, to another.
struct Renumbering {
  IdMap vertex;
  IdMap face;
};

// Values under "vertex", "vertices", "edge", "edges", "face" and "faces" are renumbered; others stay.
std::map<std::string, std::string> RenumberMetadata(const std::map<std::string, std::string>& metadata,
                                                    const Renumbering& renumbering);

}  // namespace planish::ids
