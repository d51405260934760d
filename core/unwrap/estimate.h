// What an unwrap will take, before there is a mesh: for admission and retry delays.
#pragma once

#include <cstdint>

#include "core/unwrap/unwrap.h"

namespace planish {

struct Estimate {
  // The most that a process holds at once beyond what it held idle, to decode, unwrap and hold the result. An upper
  // estimate, above what was measured for any mesh of tests/bench/hunt.cc. For a disc that is to stay whole, of 20,000
  // triangles or more, it is at most 1.6 times what was measured, and 33 MB a thread for a Cholesky factorization that
  // may have to take the place of multigrid (kMostFallbackFaces in core/abf/tuning.h). For other seam policies it is
  // what triangles on random vertices take, each a chart: about three to five times what a scan takes, since the counts
  // do not tell one from the other.
  std::int64_t peak_bytes = 0;
  // With one thread, to decode and unwrap, within a factor of about 3 for scans and models on a machine like that of
  // memory.md.
  double seconds = 0;
};

// `mesh_bytes` is the size of the encoded mesh, `faces` and `vertices` are what it declares (core/draco/header.h);
// all at least 0. Valid `options` of any kind: solvers and seams that take more count for more. Monotonous in
// faces and bytes. Overflow ends at the largest number.
Estimate EstimateUnwrap(std::int64_t faces, std::int64_t vertices, std::int64_t mesh_bytes,
                        const UnwrapOptions& options);

}  // namespace planish
