// Whether results depend on the CPU: the same unwraps in two processes, one of which may not use what newer CPUs have.
#pragma once

#include <functional>
#include <string>

#include "core/unwrap/unwrap.h"

namespace planish::testing {

// A hash of every bit of the UV of an unwrap, or the error.
std::string UvDigest(const Mesh& mesh, const UnwrapOptions& options);

// To be called once by a test, as all it does. Starts the test again in two processes, which make `digests`: one as it
// is, one in which the C library takes the CPU for an old one, without AVX and fused multiply-adds. Expects the same
// text of both.
void ExpectTheSameOnEveryCpu(const std::function<std::string()>& digests);

}  // namespace planish::testing
