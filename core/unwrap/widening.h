// Faces that are thinner than the type of the UV can hold.
//
// A needle of 1e-10 rad is a triangle on the surface, but none once its corners are rounded to float. Its target angles
// are raised until its altitude in the map is a few units of the last place, and the chart is solved again: ABF makes
// room for the face by moving its neighbours as little as possible, so that nothing overlaps. The face is stretched
// across by that, which Quality and ChartReport::stretch_l2 count; the warning FACES_WIDENED names it. A chart that is
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

// Binary digits of a place in a map that a solve and a layout in double keep; a double has 53.
inline constexpr int kDigitsOfSolve = 44;

// The most rounds in which a chart is solved again with its faces widened further. Each round multiplies angles that
// did not suffice by at least 4.
inline constexpr int kMostWidenings = 12;

// The angles that a map of the chart is to keep: those on the surface, `measured`, the least ones of widened faces
// raised (Chart::least_angle), radians.
Eigen::VectorXd AnglesToKeep(const Chart& chart, Eigen::VectorXd measured);

// Raises Chart::least_angle of the faces that rounding to multiples of `grain` (in the units of the map) may collapse
// or turn over, wherever the map is moved or turned to, and of thin faces that are collapsed or turned as it is.
// Returns whether there were any whose shape is the reason. Faces marked in `ignored` (empty: none) stay as they are.
bool WidenInMap(const Mesh& mesh, const ChartMap& map, double grain, const std::vector<char>& ignored, Chart* chart);

// The same for the faces that are collapsed or turned in the UV of the mesh's corners as delivered, and if there are
// any for needles that just hold. `scale`: UV length per length on the surface.
bool WidenDelivered(const Mesh& mesh, const CornerUv& uv, double scale, Precision precision,
                    const std::vector<char>& ignored, Chart* chart);

// Whether a face of a chart, as the mesh numbers it, is so thin on the surface that rounding stretches it across by
// many per cent, or was drawn thicker, as faces beside widened ones are.
bool IsThin(const Mesh& mesh, const CornerUv& uv, double scale, Precision precision, const Chart& chart,
            std::int32_t f);

}  // namespace planish
