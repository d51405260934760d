#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "planish/client.h"

// Two triangles; prints their UV.
int main(int, char** argv) {
  const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 1, 1, 0.5, 0, 1, 0};
  const std::vector<std::uint32_t> triangles = {0, 1, 2, 0, 2, 3};
  planish::PrivateServerOptions options;
  options.executable = argv[1];
  const planish::PrivateServer server(options);
  planish::Client client(server.target());
  const planish::UnwrapResult result = client.Unwrap({positions, triangles});
  for (std::size_t i = 0; i < result.uv.size(); ++i) std::printf("%g ", result.uv[i]);
  std::printf("\n");
  return result.IsUsable() ? 0 : 1;
}
