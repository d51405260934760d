// Element ids in errors and warnings, moved from the numbering of the mesh as sent to somebody else's.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

namespace planish::ids {

// New id of an old one. An empty function keeps ids; a negative answer keeps that id.
using IdMap = std::function<std::int64_t(std::int64_t)>;

struct Renumbering {
  IdMap vertex;
  IdMap face;
};

// Metadata values under "vertex", "vertices", "edge", "edges" (as in "3-7,7-9") and "face", "faces"; others stay.
std::map<std::string, std::string> RenumberMetadata(const std::map<std::string, std::string>& metadata,
                                                    const Renumbering& renumbering);

// The ids in a message as the server words it: one after "vertex", "edge", "face"; a comma-separated list after the
// plurals.
std::string RenumberMessage(const std::string& message, const Renumbering& renumbering);

}  // namespace planish::ids
