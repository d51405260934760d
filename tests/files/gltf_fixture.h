// A small glTF with one of everything.
#pragma once

#include <string>

#include "nlohmann/json.hpp"

namespace planish {

struct GltfFixture {
  nlohmann::ordered_json json;
  std::string buffer;

  std::string Glb() const;
  std::string Gltf() const;  // with a data URI
};

// mesh 0, shown by two nodes, one of them skinned: two primitives with two materials that share vertices (of the 3 x 3
// grid points the middle column is there twice, with different UV), all attributes that glTF knows, one of our own, a
// sparse morph target; a strip; and a line. mesh 1: quantized, interleaved, without indices, in a node of its own.
// Further: a skin, an animation, an image in a bufferView, extras, extensions, and members that no standard knows.
GltfFixture SampleGltf();

// Its first primitive alone, with positions (rounded to 12 bits on an odd grid) and normals in
// KHR_draco_mesh_compression and the other attributes and the morph target beside it.
GltfFixture SampleDracoGltf();

}  // namespace planish
