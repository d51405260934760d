#include "client/files/gltf_material.h"

namespace planish {
namespace {

std::int64_t Int(const Json& object, const char* key, std::int64_t otherwise) {
  const auto found = object.find(key);
  return found == object.end() || !found->is_number_integer() ? otherwise : found->get<std::int64_t>();
}

// Element `index` of the root's array `key`, or null.
const Json* Element(const Json& root, const char* key, std::int64_t index) {
  const auto array = root.find(key);
  if (array == root.end() || !array->is_array() || index < 0 || index >= static_cast<std::int64_t>(array->size())) {
    return nullptr;
  }
  const Json& element = (*array)[static_cast<std::size_t>(index)];
  return element.is_object() ? &element : nullptr;
}

// The image of a texture; extensions name images of other formats (KTX2, WebP). -1: none.
std::int64_t ImageOf(const Json& texture) {
  if (const std::int64_t source = Int(texture, "source", -1); source >= 0) return source;
  const Json* const extensions = GltfObject(texture, "extensions");
  if (extensions == nullptr) return -1;
  for (const Json& extension : *extensions) {
    if (!extension.is_object()) continue;
    if (const std::int64_t source = Int(extension, "source", -1); source >= 0) return source;
  }
  return -1;
}

std::string ImageName(const Json& root, std::int64_t texture_index) {
  const Json* const texture = Element(root, "textures", texture_index);
  if (texture == nullptr) return "texture " + std::to_string(texture_index);
  const std::int64_t index = ImageOf(*texture);
  const Json* const image = Element(root, "images", index);
  if (image == nullptr) return "texture " + std::to_string(texture_index);
  for (const char* key : {"name", "uri"}) {
    const auto text = image->find(key);
    if (text == image->end() || !text->is_string() || text->get_ref<const std::string&>().empty()) continue;
    if (!IsDataUri(text->get_ref<const std::string&>())) return text->get<std::string>();
  }
  return "image " + std::to_string(index);
}

// Recursion ends, as the depth of the JSON was checked.
void FindUses(const Json& root, const Json& object, std::vector<GltfTextureUse>* uses) {
  for (const auto& [key, value] : object.items()) {
    if (!value.is_object()) continue;
    if (!key.ends_with("Texture") || !value.contains("index")) {
      FindUses(root, value, uses);
      continue;
    }
    GltfTextureUse use;
    use.slot = key;
    use.name = ImageName(root, Int(value, "index", -1));
    use.is_normal = key.ends_with("ormalTexture");
    std::int64_t texcoord = Int(value, "texCoord", 0);
    if (const Json* const extensions = GltfObject(value, "extensions")) {
      if (const Json* const transform = GltfObject(*extensions, "KHR_texture_transform")) {
        texcoord = Int(*transform, "texCoord", texcoord);
      }
    }
    use.texcoord = texcoord >= 0 && texcoord <= 7 ? static_cast<int>(texcoord) : -1;
    uses->push_back(std::move(use));
  }
}

}  // namespace

std::vector<GltfTextureUse> TextureUses(const Json& root, std::int64_t index) {
  std::vector<GltfTextureUse> uses;
  if (const Json* const material = Element(root, "materials", index)) FindUses(root, *material, &uses);
  return uses;
}

}  // namespace planish
