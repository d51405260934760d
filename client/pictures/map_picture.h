// A picture of a UV map: the surface with a checkerboard on it, beside the charts in the plane.
#pragma once

#include <vector>

#include "client/pictures/canvas.h"
#include "core/mesh/mesh.h"

namespace planish {

struct MapPictureOptions {
  int height = 800;        // pixels, in [16, 8192]; the picture is twice as wide
  int checks = 48;         // squares of the checkerboard along u in [0, 1]
  double azimuth = 0.6;    // of the viewer round the y axis, radians, from +z towards +x
  double elevation = 0.3;  // of the viewer above the xz plane, radians
};

// Left: `mesh` seen from afar (y up, no perspective) with the checkerboard of its UV. Right: the unit square with the
// charts and the same checkerboard. Colours tell where in the plane a place of the surface lies; edges where `uv` or
// the mesh ends are dark. `uv` has (u, v) of every corner: 6 numbers a face, in [0, 1].
Image DrawMap(const Mesh& mesh, const std::vector<double>& uv, const MapPictureOptions& options = {});

}  // namespace planish
