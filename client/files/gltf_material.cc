#include "client/files/gltf_material.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string_view>

#include "client/files/gltf_accessor.h"
#include "client/files/mesh_file.h"
#include "client/files/texture_files.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

// Element `index` of the root's array `key`, or null.
const Json* Element(const Json& root, const char* key, std::int64_t index) {
  const auto array = root.find(key);
  if (array == root.end() || !array->is_array() || index < 0 || index >= static_cast<std::int64_t>(array->size())) {
    return nullptr;
  }
  const Json& element = (*array)[static_cast<std::size_t>(index)];
  return element.is_object() ? &element : nullptr;
}

std::array<double, 2> Pair(const Json& object, const Json::json_pointer& at, double otherwise) {
  return {GltfNumberAt(object, at / 0, otherwise), GltfNumberAt(object, at / 1, otherwise)};
}

// The matrix translation * rotation * scale, as in the GLSL of KHR_texture_transform.
std::array<double, 6> TransformOf(const Json& json) {
  const std::array<double, 2> offset = Pair(json, Json::json_pointer("/offset"), 0),
                              scale = Pair(json, Json::json_pointer("/scale"), 1);
  const double angle = GltfNumberAt(json, Json::json_pointer("/rotation"), 0), c = std::cos(angle), s = std::sin(angle);
  return {c * scale[0], s * scale[1], offset[0], -s * scale[0], c * scale[1], offset[1]};
}

TextureMeaning MeaningOf(std::string_view slot) {
  if (slot.ends_with("ormalTexture")) return TextureMeaning::kNormal;
  if (slot == "anisotropyTexture") return TextureMeaning::kDirection;
  for (const std::string_view color :
       {"baseColorTexture", "emissiveTexture", "diffuseTexture", "specularGlossinessTexture", "sheenColorTexture",
        "specularColorTexture", "diffuseTransmissionColorTexture", "multiscatterColorTexture"}) {
    if (slot == color) return TextureMeaning::kColor;
  }
  return TextureMeaning::kData;
}

std::string ImageNameOfTexture(const Json& root, std::int64_t texture_index) {
  const std::vector<GltfTextureSource> sources = TextureSources(root, texture_index);
  if (sources.empty()) return "texture " + std::to_string(texture_index);
  return GltfImageName(root, sources[0].image);
}

// Appends the textures in `object`, at `at`, and below. The recursion is bounded, as the depth of the JSON was checked.
void FindUses(const Json& root, const Json& object, const Json::json_pointer& at, bool is_opaque,
              std::vector<GltfTextureUse>* uses) {
  for (const auto& [key, value] : object.items()) {
    if (!value.is_object()) continue;
    if (!key.ends_with("Texture") || !value.contains("index")) {
      FindUses(root, value, at / key, is_opaque, uses);
      continue;
    }
    GltfTextureUse use;
    use.slot = key;
    use.at = at / key;
    use.texture = GltfIntAt(value, "index", -1);
    use.name = ImageNameOfTexture(root, use.texture);
    use.is_normal = key.ends_with("ormalTexture");
    use.meaning = MeaningOf(key);
    if (use.is_normal) use.normal_scale = GltfNumberAt(value, Json::json_pointer("/scale"), 1);
    use.has_alpha = !is_opaque && (key == "baseColorTexture" || key == "diffuseTexture");
    std::int64_t texcoord = GltfIntAt(value, "texCoord", 0);
    if (const Json* const extensions = GltfObject(value, "extensions")) {
      if (const Json* const transform = GltfObject(*extensions, "KHR_texture_transform")) {
        texcoord = GltfIntAt(*transform, "texCoord", texcoord);
        use.transform = TransformOf(*transform);
      }
    }
    use.texcoord = texcoord >= 0 && texcoord <= kLargestTexcoord ? static_cast<int>(texcoord) : -1;
    uses->push_back(std::move(use));
  }
}

}  // namespace

std::string GltfImageName(const Json& root, std::int64_t image_index) {
  const Json* const image = Element(root, "images", image_index);
  if (image == nullptr) return "image " + std::to_string(image_index);
  for (const char* key : {"name", "uri"}) {
    const auto text = image->find(key);
    if (text == image->end() || !text->is_string() || text->get_ref<const std::string&>().empty()) continue;
    if (!IsDataUri(text->get_ref<const std::string&>())) return text->get<std::string>();
  }
  return "image " + std::to_string(image_index);
}

std::string GltfImageTitle(const GltfDocument& document, std::int64_t image_index) {
  const std::string name = GltfImageName(document.json, image_index);
  const std::string title = document.path + ": " + name;
  const Json* const image = Element(document.json, "images", image_index);
  if (image == nullptr || image->contains("bufferView")) return title;
  const auto uri = image->find("uri");
  if (uri == image->end() || !uri->is_string() || IsDataUri(uri->get_ref<const std::string&>())) return title;
  const absl::StatusOr<std::string> file = FileOfUri(document, "uri", uri->get<std::string>());
  if (!file.ok()) return title;
  return name == *uri ? document.path + ": " + *file : title + " (" + *file + ")";
}

std::vector<GltfTextureSource> TextureSources(const Json& root, std::int64_t texture_index) {
  std::vector<GltfTextureSource> sources;
  const Json* const texture = Element(root, "textures", texture_index);
  if (texture == nullptr) return sources;
  if (const std::int64_t source = GltfIntAt(*texture, "source", -1); source >= 0) sources.push_back({source, ""});
  const Json* const extensions = GltfObject(*texture, "extensions");
  if (extensions == nullptr) return sources;
  for (const auto& [name, extension] : extensions->items()) {
    if (!extension.is_object()) continue;
    if (const std::int64_t source = GltfIntAt(extension, "source", -1); source >= 0) sources.push_back({source, name});
  }
  return sources;
}

std::vector<GltfTextureUse> TextureUses(const Json& root, std::int64_t index) {
  std::vector<GltfTextureUse> uses;
  if (const Json* const material = Element(root, "materials", index)) {
    const auto mode = material->find("alphaMode");
    const bool is_opaque = mode == material->end() || *mode == "OPAQUE";
    FindUses(root, *material, Json::json_pointer(), is_opaque, &uses);
  }
  return uses;
}

namespace {

std::size_t SizeOf(const Json& root, const char* key) {
  const auto array = root.find(key);
  return array == root.end() || !array->is_array() ? 0 : array->size();
}

// Whether a string in `value` begins with `begin` and has `part` in it.
bool HasPointer(const Json& value, const std::string& begin, const std::string& part) {
  if (value.is_string()) {
    const std::string& text = value.get_ref<const std::string&>();
    return text.starts_with(begin) && text.find(part) != std::string::npos;
  }
  if (!value.is_structured()) return false;
  return std::any_of(value.begin(), value.end(), [&](const Json& child) { return HasPointer(child, begin, part); });
}

// Calls action(&reference) for every reference to a material: of primitives and of their variants.
template <typename Action>
void ForEachMaterial(Json& root, const Action& action) {
  const auto visit = [&action](Json& holder) {
    const auto material = holder.find("material");
    if (material != holder.end() && material->is_number_integer()) action(&*material);
  };
  for (Json& mesh : root["meshes"]) {
    for (Json& primitive : mesh["primitives"]) {
      visit(primitive);
      if (VariantMappings(primitive).empty()) continue;
      for (Json& mapping : primitive["extensions"]["KHR_materials_variants"]["mappings"]) {
        if (mapping.is_object()) visit(mapping);
      }
    }
  }
}

}  // namespace

const Json& VariantMappings(const Json& primitive) {
  static const auto* const none = new Json(Json::array());
  const Json* const extensions = GltfObject(primitive, "extensions");
  const Json* const variants = extensions == nullptr ? nullptr : GltfObject(*extensions, "KHR_materials_variants");
  if (variants == nullptr) return *none;
  const auto mappings = variants->find("mappings");
  return mappings != variants->end() && mappings->is_array() ? *mappings : *none;
}

bool IsAnimated(const Json& root, std::int64_t material, const std::string& part) {
  const auto animations = root.find("animations");
  return animations != root.end() && HasPointer(*animations, "/materials/" + std::to_string(material) + "/", part);
}

void RemoveUnusedMaterials(const std::set<std::int64_t>& materials, GltfPatch* patch) {
  Json& root = patch->json();
  if (patch->has_unknown_indices()) return;
  if (root.contains("animations") && HasPointer(root["animations"], "/materials/", "")) return;
  std::vector<bool> gone(SizeOf(root, "materials"), false);
  for (const std::int64_t material : materials) {
    if (material >= 0 && material < std::ssize(gone)) gone[static_cast<std::size_t>(material)] = true;
  }
  ForEachMaterial(root, [&gone](const Json* reference) {
    const auto material = reference->get<std::int64_t>();
    if (material >= 0 && material < std::ssize(gone)) gone[static_cast<std::size_t>(material)] = false;
  });
  const std::vector<std::int64_t> index = TakeOutOfRoot(gone, "materials", &root);
  ForEachMaterial(root, [&index](Json* reference) {
    const auto material = reference->get<std::int64_t>();
    if (material >= 0 && material < std::ssize(index)) *reference = index[static_cast<std::size_t>(material)];
  });
}

void RemoveUnreadTextures(const std::set<std::int64_t>& textures, GltfPatch* patch) {
  Json& root = patch->json();
  const auto num_textures = static_cast<std::int64_t>(SizeOf(root, "textures"));
  const auto num_images = static_cast<std::int64_t>(SizeOf(root, "images"));
  if (patch->has_unknown_indices()) return;
  std::vector<bool> gone(static_cast<std::size_t>(num_textures), false);
  for (const std::int64_t texture : textures) {
    if (texture >= 0 && texture < num_textures) gone[static_cast<std::size_t>(texture)] = true;
  }
  const auto num_materials = static_cast<std::int64_t>(SizeOf(root, "materials"));
  std::vector<std::vector<GltfTextureUse>> uses;
  for (std::int64_t m = 0; m < num_materials; ++m) {
    uses.push_back(TextureUses(root, m));
    for (const GltfTextureUse& use : uses.back()) {
      if (use.texture >= 0 && use.texture < num_textures) gone[static_cast<std::size_t>(use.texture)] = false;
    }
  }
  // An image goes if a texture that goes reads it, and no texture that stays.
  std::vector<bool> image_gone(static_cast<std::size_t>(num_images), false);
  for (const bool is_gone : {true, false}) {
    for (std::int64_t t = 0; t < num_textures; ++t) {
      if (gone[static_cast<std::size_t>(t)] != is_gone) continue;
      for (const GltfTextureSource& source : TextureSources(root, t)) {
        if (source.image >= 0 && source.image < num_images)
          image_gone[static_cast<std::size_t>(source.image)] = is_gone;
      }
    }
  }
  for (std::size_t i = 0; i < image_gone.size(); ++i) {
    if (image_gone[i]) patch->ReleaseView(GltfIntAt(root["images"][i], "bufferView", -1));
  }
  std::vector<std::vector<GltfTextureSource>> sources;
  for (std::int64_t t = 0; t < num_textures; ++t) sources.push_back(TextureSources(root, t));
  const std::vector<std::int64_t> new_image = TakeOutOfRoot(image_gone, "images", &root);
  for (std::size_t t = 0; t < sources.size(); ++t) {
    for (const GltfTextureSource& source : sources[t]) {
      if (gone[t] || source.image < 0 || source.image >= num_images) continue;
      Json& texture = root["textures"][t];
      Json& holder = source.extension.empty() ? texture : texture["extensions"][source.extension];
      holder["source"] = new_image[static_cast<std::size_t>(source.image)];
    }
  }
  const std::vector<std::int64_t> new_texture = TakeOutOfRoot(gone, "textures", &root);
  for (std::size_t m = 0; m < uses.size(); ++m) {
    for (const GltfTextureUse& use : uses[m]) {
      if (use.texture < 0 || use.texture >= num_textures) continue;
      root["materials"][m][use.at]["index"] = new_texture[static_cast<std::size_t>(use.texture)];
    }
  }
}

const Json* SamplerOfTexture(const Json& root, std::int64_t texture_index) {
  const Json* const texture = Element(root, "textures", texture_index);
  return texture == nullptr ? nullptr : Element(root, "samplers", GltfIntAt(*texture, "sampler", -1));
}

std::array<TextureWrap, 2> TextureWraps(const Json& root, std::int64_t texture_index) {
  constexpr std::int64_t kClampToEdge = 33071, kMirroredRepeat = 33648;
  const Json* const sampler = SamplerOfTexture(root, texture_index);
  const auto wrap = [&](const char* key) {
    const std::int64_t value = sampler == nullptr ? 0 : GltfIntAt(*sampler, key, 0);
    if (value == kClampToEdge) return TextureWrap::kClamp;
    return value == kMirroredRepeat ? TextureWrap::kMirror : TextureWrap::kRepeat;
  };
  return {wrap("wrapS"), wrap("wrapT")};
}

absl::StatusOr<std::string> GltfImageBytes(const GltfDocument& document, std::int64_t image, bool allow_outside) {
  const Json* const json = Element(document.json, "images", image);
  const std::string element = "images[" + std::to_string(image) + "]";
  if (json == nullptr) return GltfFault(document, element, "there is no such image");
  if (const auto view = json->find("bufferView"); view != json->end()) {
    PLANISH_ASSIGN_OR_RETURN(const std::string_view bytes, ViewBytes(document, *view, element + ".bufferView"));
    return std::string(bytes);
  }
  const auto uri = json->find("uri");
  if (uri == json->end() || !uri->is_string()) return GltfFault(document, element, "neither uri nor bufferView");
  const std::string& text = uri->get_ref<const std::string&>();
  if (IsDataUri(text)) return LoadGltfUri(document, element, text, 0);
  PLANISH_ASSIGN_OR_RETURN(const std::string name, FileOfUri(document, element, text));
  return ReadImageFile(document.path, name, allow_outside);
}

}  // namespace planish
