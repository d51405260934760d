// What the examples of client/README.md take for granted.
#include <cstddef>
#include <cstdint>
#include <vector>

#include "planish/client.h"

const std::vector<float> xyz;
const std::vector<std::uint32_t> triangles, pairs;
const planish::MeshView mesh(xyz, triangles);
std::size_t f = 0, k = 0;
void Report(const planish::Error&);
inline void Report(const planish::Error&) {}
