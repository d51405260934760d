// What the materials of a glTF read from its sets of UV. Used inside client/files only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/files/gltf_document.h"

namespace planish {

// A texture as a material refers to it.
struct GltfTextureUse {
  std::string slot;        // "baseColorTexture"; of extensions as well
  std::string name;        // of the image: its name, its file, or "image 3"
  int texcoord = 0;        // the set of UV that it is read with
  bool is_normal = false;  // a normal map: tangents belong to its UV
};

// The textures of materials[index], in the order of the file; empty for -1. Extensions are searched too:
// whatever ends in "Texture" and has an index is one.
std::vector<GltfTextureUse> TextureUses(const Json& root, std::int64_t index);

}  // namespace planish
