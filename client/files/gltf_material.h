// The textures of glTF materials and the sets of UV that they use. Used only in client/files.
#pragma once

#include <array>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/gltf_document.h"
#include "client/files/gltf_patch.h"
#include "client/texture/texture_baker.h"

namespace planish {

// A reference to a texture in a material.
struct GltfTextureUse {
  std::string slot;        // "baseColorTexture", or one of an extension
  std::string name;        // of the image: its name, its file, or "image 3"
  int texcoord = 0;        // the set of UV used; -1: it does not exist
  bool is_normal = false;  // a normal map: tangents must match its UV
  Json::json_pointer at;   // where the textureInfo is in the material
  std::int64_t texture = -1;
  // u' = transform[0] u + transform[1] v + transform[2], and v' likewise: KHR_texture_transform.
  std::array<double, 6> transform = {1, 0, 0, 0, 1, 0};
  TextureMeaning meaning = TextureMeaning::kData;
  double normal_scale = 1;
  bool has_alpha = false;  // the image holds the material's alpha, with which colours are weighted
};

// The textures of materials[index], in the order of the file; empty for -1. Includes those of extensions: every member
// that ends in "Texture" and has an index.
std::vector<GltfTextureUse> TextureUses(const Json& root, std::int64_t index);

// The images of a texture: its source, and those of its extensions (WebP, KTX2).
struct GltfTextureSource {
  std::int64_t image = -1;
  std::string extension;  // empty: the texture's own source
};
std::vector<GltfTextureSource> TextureSources(const Json& root, std::int64_t texture);

// Removes those of `textures` that no material refers to, and the images that only these textures read, with their
// bytes. Removes nothing if an unknown extension may refer to them (GltfPatch::has_unknown_indices).
void RemoveUnreadTextures(const std::set<std::int64_t>& textures, GltfPatch* patch);

// Removes those of `materials` that no primitive and no variant refers to. Removes none if an extension that we do not
// know or an animation may refer to materials by their numbers.
void RemoveUnusedMaterials(const std::set<std::int64_t>& materials, GltfPatch* patch);

// The mappings of materials in a primitive's KHR_materials_variants; an empty array where the primitive has no
// variants.
const Json& VariantMappings(const Json& primitive);

// Whether an animation (KHR_animation_pointer) changes a property of a material whose path contains `part`.
bool IsAnimated(const Json& root, std::int64_t material, const std::string& part = "");

// The wrap modes of a texture's sampler, along u and v.
std::array<TextureWrap, 2> TextureWraps(const Json& root, std::int64_t texture);

// The sampler of a texture, or null.
const Json* SamplerOfTexture(const Json& root, std::int64_t texture);

// The bytes of images[image]: in a buffer, a data URI or a file. Errors of the document and of files; IMAGE_OUTSIDE.
absl::StatusOr<std::string> GltfImageBytes(const GltfDocument& document, std::int64_t image, bool allow_outside);

// The image's name, its file's name, or "image 3".
std::string GltfImageName(const Json& root, std::int64_t image);
// The image in an error: "model.gltf: wood (textures/wood.png)", with the file only where it has one.
std::string GltfImageTitle(const GltfDocument& document, std::int64_t image);

}  // namespace planish
