// Handles faces that are thinner than the type of the UV can represent.
//
// A needle of 1e-10 rad is a triangle on the surface, but degenerate once its corners are rounded to float. Its target
// angles are raised until its altitude in the map is a few units in the last place, and the chart is solved again: ABF
// makes room for the face by moving its neighbours as little as possible, so that nothing overlaps. That stretches the
// face across, which Quality and ChartReport::stretch_l2 include; the warning FACES_WIDENED lists it. A chart that is
// too small as a whole is enlarged instead.
#pragma once

#include <cstdint>
#include <vector>

#include "Eigen/Core"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/chart.h"
#include "core/unwrap/unwrap.h"
#include "core/unwrap/verify.h"

namespace planish {

// Binary digits of a position that survive a solve and a layout in double; a double has 53.
inline constexpr int kDigitsOfSolve = 44;

// The maximal number of rounds in which a chart is solved again with its faces widened further. Each round multiplies
// insufficient angles by at least 4.
inline constexpr int kMostWidenings = 12;

// The angles that a map of the chart should keep: `measured`, those on the surface, with the least angles of widened
// faces raised (Chart::least_angle), radians.
Eigen::VectorXd AnglesToKeep(const Chart& chart, Eigen::VectorXd measured);

// Raises Chart::least_angle of the faces that rounding to multiples of `grain` (in units of the map) may collapse or
// flip after any motion of the map, and of thin faces that are collapsed or flipped already. Returns whether there were
// any whose shape is the reason. Ignores faces marked in `ignored` (empty: none).
bool WidenInMap(const Mesh& mesh, const ChartMap& map, double grain, const std::vector<char>& ignored, Chart* chart);

// Does the same as WidenInMap() for faces that are collapsed or flipped in the delivered UV of the mesh's corners and,
// if there are any, for needles that nearly are. `scale`: UV length per length on the surface.
bool WidenDelivered(const Mesh& mesh, const CornerUv& uv, double scale, Precision precision,
                    const std::vector<char>& ignored, Chart* chart);

// Whether a face (numbered as in the mesh) of a chart is thin enough on the surface for rounding to stretch it across
// by many per cent, or was drawn thicker because a neighbour was widened.
bool IsThin(const Mesh& mesh, const CornerUv& uv, double scale, Precision precision, const Chart& chart,
            std::int32_t f);

}  // namespace planish
