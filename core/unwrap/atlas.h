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
  double padding = 0;  // texels that are free between charts, PackOptions::padding unless there is no room
};

// Packs the charts (core/pack/pack.h). The one chart of SeamPolicy::kNone fills the unit square as far as it goes,
// without padding: it has no neighbours, and scales that vary over many orders of magnitude outlast rounding best next
// to 0. Without UnwrapOptions::pack leaves charts as they are, the lowest u and v of each at 0. The maps are moved in
// place. Faces without a chart (Surface::takes_part) get the UV of an edge they lie on, or else of a vertex.
Atlas MakeAtlas(const Mesh& mesh, const UnwrapOptions& options, const Execution& execution, ChartSet* charts);

}  // namespace planish
