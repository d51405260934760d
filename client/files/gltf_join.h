// Joins primitives of a glTF, for fewer draw calls. Used only in client/files.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "client/files/gltf_document.h"

namespace planish {

// Joins primitives of a mesh that have the same material and attributes and morph targets of the same kinds. Vertices
// keep all data. Those that Draco compresses are joined with each other, and compressed again without loss. Strips,
// fans, points, lines, and primitives with other extensions stay. Accessors and views without use go
// (GltfPatch::Compact). `buffer` holds the bytes of the only
// buffer of `json`; both are replaced. `path` is for messages.
absl::Status JoinPrimitives(const std::string& path, Json* json, std::string* buffer);

}  // namespace planish
