// Judges what a file holds after an unwrap of its polygons.
#pragma once

#include <string>
#include <vector>

#include "client/files/mesh_file.h"

namespace planish::testing {

// Unwraps an OBJ in this process with the default options (or for texture), writes it in this format, reads it again,
// and checks the bytes as `planish check` does. Each promise that does not hold is a sentence: no overlap, no flip,
// none without UV or without area in the map (but for what has none on the surface); each polygon whole, or named; in
// OBJ, PLY and OFF as many polygons as before, but for those.
std::vector<std::string> BrokenPolygonPromises(const std::string& obj, MeshFormat format, bool for_texture = false);

}  // namespace planish::testing
