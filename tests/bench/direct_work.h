// The work of a job without a service around it. Apart, because the core's and the client library's types share names.
#pragma once

#include "core/mesh/mesh.h"

namespace planish::bench {

struct DirectSeconds {
  double solve = 0;  // Unwrap() with the service's default options and one thread
  double draco = 0;  // encoding and decoding the mesh
};

// Throws std::runtime_error if the mesh cannot be unwrapped.
DirectSeconds WorkDirectly(const Mesh& mesh);

}  // namespace planish::bench
