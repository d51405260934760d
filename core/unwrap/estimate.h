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
  // CPU seconds of one thread, to decode and unwrap, on a machine like that of memory.md; servers multiply them by what
  // jobs took lately over their estimates. With kAuto and kNone within a factor of 3 for 19 meshes of 20: one flat
  // chart may take a tenth. With kNeeded only within a factor of 10 for 9 of 10, and up to 25 times: the counts do not
  // tell a disc, which is solved once, from a net whose maps overlap, so that it is cut and solved again and again.
  double seconds = 0;
};

// `mesh_bytes` is the size of the encoded mesh, `faces` and `vertices` are what it declares (core/draco/header.h);
// all at least 0. Valid `options` of any kind: solvers and seams that take more count for more. Monotonous in
// faces and bytes. Overflow ends at the largest number.
Estimate EstimateUnwrap(std::int64_t faces, std::int64_t vertices, std::int64_t mesh_bytes,
                        const UnwrapOptions& options);

}  // namespace planish
