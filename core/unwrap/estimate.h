// What an unwrap will take, before there is a mesh: for admission and retry delays.
#pragma once

#include <cstdint>

#include "core/unwrap/unwrap.h"

namespace planish {

struct Estimate {
  // What a process holds at most beyond what it held idle, to decode, unwrap and hold the result: a typical upper
  // figure. Of 1,000 meshes of tests/bench/hunt.cc at most 5 took more, and none twice as much; 95 of 100 took at least
  // a third. The counts do not tell how many charts there will be, or with kAuto whether multigrid fails on one of
  // them. So a job may need more, and has to be run again with twice that.
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
