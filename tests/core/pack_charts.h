// Charts to pack: those of an OBJ file with UV, or made up.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/pack/pack.h"

namespace planish::testing {

// `name` is a path to an OBJ file of triangles or polygons with vt, whose islands become charts, each scaled to its
// area on the surface; or KIND-N[-SEED]: N charts of sizes that vary as those of atlases do. KIND is
//   blobs    round with bays              strips  long, straight or bent
//   corners  L, T and U shapes            rings   with a large hole, and as many small blobs
//   mixed    all of these                 rags    blobs with a ragged outline
//   equal    blobs of one size            needles 1 : 200
absl::StatusOr<std::vector<PackChart>> MakeCharts(const std::string& name);

}  // namespace planish::testing
