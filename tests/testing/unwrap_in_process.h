// The core's unwrap for tests of the client, whose types have the names of the core's.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish::testing {

struct InProcessMap {
  std::string error;        // empty: there is a map
  bool is_refused = false;  // INVALID_ARGUMENT
  std::vector<double> uv;   // 6 numbers a face
  bool is_float = true;
  std::vector<std::int32_t> torn_faces;  // of the warning POLYGON_TORN
};

// With default options, or for texture in place of seams (SeamPreference). `face_polygon` as in UnwrapOptions
// (core/unwrap/unwrap.h).
InProcessMap UnwrapInProcess(const Mesh& mesh, const std::vector<std::int32_t>& face_polygon, bool needs_float,
                             bool for_texture = false);

}  // namespace planish::testing
