// Faces in the order of the rows round which they lie: neighbours close in memory.
#pragma once

#include <cstdint>
#include <vector>

#include "Eigen/Core"
#include "core/mesh/topology.h"

namespace planish {

struct SortedTopology {
  Topology topology;               // the same rows and vertices, other numbers for faces and corners
  std::vector<std::int32_t> face;  // the number that each of its faces has in the original

  // Three numbers per face, from the original order to this one and back.
  Eigen::VectorXd ToSorted(const Eigen::VectorXd& corners) const;
  Eigen::VectorXd ToOriginal(const Eigen::VectorXd& corners) const;
};

// O(F).
SortedTopology SortFaces(const Topology& topology);

}  // namespace planish
