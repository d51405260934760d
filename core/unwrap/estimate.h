// Estimates the memory and time of an unwrap before the mesh is decoded: for admission and retry delays.
#pragma once

#include <cstdint>

#include "core/unwrap/unwrap.h"

namespace planish {

struct Estimate {
  // Peak memory of a process beyond its idle memory, to decode, unwrap and hold the result: a typical upper bound. At
  // most 5 of 1,000 meshes of tests/bench/hunt.cc took more, and no mesh took twice as much; 95 of 100 took at least a
  // third. The estimate knows neither the number of charts nor, with kAuto, whether multigrid fails on a chart. So a
  // job may need more memory; it is then run again with twice the estimate.
  std::int64_t peak_bytes = 0;
  // CPU seconds of one thread to decode and unwrap, on the machine of memory.md. Servers multiply the estimate by the
  // recent ratio of actual to estimated times. With kAuto and kNone it is within a factor of 3 for 19 of 20 meshes; one
  // flat chart may take a tenth. With kNeeded it is within a factor of 10 for 9 of 10 meshes, and up to 25: the counts
  // do not distinguish a disc, which is solved once, from a net whose maps overlap, which is cut and solved many times.
  double seconds = 0;
};

// `mesh_bytes` is the size of the encoded mesh, `faces` and `vertices` are what it declares (core/draco/header.h); all
// at least 0. `options` must be valid; more expensive solvers and seams raise the estimate. Monotonic in faces and
// bytes. Saturates instead of overflowing.
Estimate EstimateUnwrap(std::int64_t faces, std::int64_t vertices, std::int64_t mesh_bytes,
                        const UnwrapOptions& options);

}  // namespace planish
