// Mapped charts to the UV of every corner of the mesh.
#pragma once

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/chart_set.h"
#include "core/unwrap/unwrap.h"
#include "core/unwrap/verify.h"

namespace planish {

struct Atlas {
  CornerUv uv;
  int tiles = 1;
  double scale = 1;    // UV length per length on the surface
  double padding = 0;  // texels that are free between charts
};

// Packs the charts (core/pack/pack.h); without UnwrapOptions::pack, leaves them as they are, the lowest u and v of each
// at 0. Faces without a chart, which name a vertex twice, get the UV of an edge they lie on, or else of a vertex.
Atlas MakeAtlas(const Mesh& mesh, const ChartSet& charts, const UnwrapOptions& options, const Execution& execution);

}  // namespace planish
