#include "client/files/gltf_textures.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include "client/files/gltf_bake.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr char kTransform[] = "KHR_texture_transform";
constexpr char kVariants[] = "KHR_materials_variants";

// An element of the root's array `key`, or null.
const Json* ElementOf(const Json& root, const char* key, std::int64_t index) {
  const auto array = root.find(key);
  if (array == root.end() || !array->is_array() || index < 0 || index >= static_cast<std::int64_t>(array->size())) {
    return nullptr;
  }
  return &(*array)[static_cast<std::size_t>(index)];
}

}  // namespace

bool ReadsTexcoord(const GltfMesh& gltf, int texcoord) {
  const std::string name = "TEXCOORD_" + std::to_string(texcoord);
  for (const GltfPrimitive& primitive : gltf.primitives) {
    const Json& json = PrimitiveJson(gltf.document.json, primitive);
    if (!json["attributes"].contains(name)) continue;
    for (const GltfTextureUse& use : TextureUses(gltf.document.json, GltfIntAt(json, "material", -1))) {
      if (use.texcoord == texcoord) return true;
    }
  }
  return false;
}

std::vector<std::string> ImagesShown(const GltfMesh& gltf) {
  std::vector<std::string> names;
  for (const GltfPrimitive& primitive : gltf.primitives) {
    const std::int64_t material = GltfIntAt(PrimitiveJson(gltf.document.json, primitive), "material", -1);
    for (const GltfTextureUse& use : TextureUses(gltf.document.json, material)) {
      if (TextureSources(gltf.document.json, use.texture).empty()) continue;
      if (std::find(names.begin(), names.end(), use.name) == names.end()) names.push_back(use.name);
    }
  }
  return names;
}

int FreeTexcoord(const GltfMesh& gltf) {
  int free = 0;
  for (; free <= kLargestTexcoord; ++free) {
    const std::string name = "TEXCOORD_" + std::to_string(free);
    const bool is_used =
        std::any_of(gltf.primitives.begin(), gltf.primitives.end(), [&](const GltfPrimitive& primitive) {
          return PrimitiveJson(gltf.document.json, primitive)["attributes"].contains(name);
        });
    if (!is_used) break;
  }
  return free;
}

GltfTextures::GltfTextures(const GltfMesh& gltf, const OutputOptions& options)
    : gltf_(gltf),
      options_(options),
      root_(gltf.document.json),
      merge_(gltf, options),
      needs_tangents_(gltf.primitives.size(), false) {
  const auto materials = root_.find("materials");
  const std::int64_t count = materials == root_.end() ? 0 : static_cast<std::int64_t>(materials->size());
  const std::string uv_name = "TEXCOORD_" + std::to_string(options.texcoord);
  const std::vector<std::int32_t>& atlas_of = options.textures.polygon_atlas;
  std::map<std::int64_t, std::vector<Place>> places_of;
  if (count > 0) places_of = PlacesOfMaterials();
  for (std::int64_t m = 0; m < count; ++m) {
    std::vector<GltfTextureUse> uses = TextureUses(root_, m);
    // Textures that use another set of UV still fit, and stay as they are.
    std::erase_if(uses, [&](const GltfTextureUse& use) {
      return use.texcoord != options.texcoord || TextureSources(root_, use.texture).empty();
    });
    if (uses.empty()) continue;
    const std::vector<Place>& places = places_of[m];
    std::map<std::int32_t, Group> by_atlas;
    bool had_uv = false;
    bool has_others = false;
    for (const Place& place : places) {
      if (place.triangles && !place.mapping && merge_.Has(*place.triangles)) continue;
      has_others |= !place.triangles;
      if (!place.triangles) continue;
      const GltfPrimitive& primitive = gltf.primitives[*place.triangles];
      had_uv |= PrimitiveJson(root_, primitive)["attributes"].contains(uv_name);
      const std::int32_t atlas = atlas_of.empty() || primitive.num_polygons == 0
                                     ? 0
                                     : atlas_of[static_cast<std::size_t>(primitive.first_polygon)];
      Group& group = by_atlas[atlas];
      group.material = m;
      group.atlas = atlas;
      group.uses = uses;
      group.places.push_back(place);
      if (std::find(group.primitives.begin(), group.primitives.end(), *place.triangles) == group.primitives.end()) {
        group.primitives.push_back(*place.triangles);
      }
    }
    if (!had_uv) continue;
    for (auto& [atlas, group] : by_atlas) {
      for (const std::size_t primitive : group.primitives) {
        needs_tangents_[primitive] = needs_tangents_[primitive] || std::any_of(uses.begin(), uses.end(), IsDirection);
      }
      is_shared_.push_back(has_others || atlas != by_atlas.begin()->first);
      groups_.push_back(std::move(group));
    }
  }
}

std::map<std::int64_t, std::vector<GltfTextures::Place>> GltfTextures::PlacesOfMaterials() const {
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> triangles;
  for (std::size_t i = 0; i < gltf_.primitives.size(); ++i) {
    triangles[{gltf_.primitives[i].mesh, gltf_.primitives[i].primitive}] = i;
  }
  std::map<std::int64_t, std::vector<Place>> places;
  const Json& meshes = root_["meshes"];
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const Json& primitives = meshes[m]["primitives"];
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      Place place = {m, p, std::nullopt, std::nullopt};
      if (const auto found = triangles.find({m, p}); found != triangles.end()) place.triangles = found->second;
      places[GltfIntAt(primitives[p], "material", -1)].push_back(place);
      const Json& mappings = VariantMappings(primitives[p]);
      for (std::size_t i = 0; i < mappings.size(); ++i) {
        if (!mappings[i].is_object()) continue;
        place.mapping = i;
        places[GltfIntAt(mappings[i], "material", -1)].push_back(place);
      }
    }
  }
  return places;
}

absl::StatusOr<std::string> GltfTextures::ImageBytes(std::int64_t image) const {
  return GltfImageBytes(gltf_.document, image, options_.textures.allow_outside);
}

absl::Status GltfTextures::Check() const {
  std::set<std::int64_t> seen;
  for (const Group& group : groups_) {
    PLANISH_RETURN_IF_ERROR(CheckGltfTextures(gltf_, options_, group.material, group.uses, &seen));
  }
  return merge_.Check();
}

std::size_t GltfTextures::FindReading(const Group& group, const GltfTextureUse& use, std::int64_t image) {
  TextureBake bake = BakeOfGltfTexture(gltf_, use, image);
  const Json key = {image,       group.atlas,  use.texcoord, use.transform,    bake.wrap_u,
                    bake.wrap_v, bake.nearest, use.meaning,  use.normal_scale, bake.options.premultiplied};
  const auto [found, is_new] = reading_of_key_.emplace(key.dump(), readings_.size());
  if (is_new) readings_.push_back({image, group.atlas, key.dump(), use, std::move(bake), {}, -1});
  Reading& reading = readings_[found->second];
  for (const std::size_t primitive : group.primitives) {
    const auto at = std::lower_bound(reading.primitives.begin(), reading.primitives.end(), primitive);
    if (at == reading.primitives.end() || *at != primitive) reading.primitives.insert(at, primitive);
  }
  return found->second;
}

std::size_t GltfTextures::FindTexture(const Group& group, const GltfTextureUse& use) {
  NewTexture texture;
  texture.old = use.texture;
  for (const GltfTextureSource& source : TextureSources(root_, use.texture)) {
    texture.readings.push_back(FindReading(group, use, source.image));
  }
  const Json key = {texture.old, texture.readings};
  const auto [found, is_new] = texture_of_key_.emplace(key.dump(), textures_.size());
  if (is_new) textures_.push_back(texture);
  return found->second;
}

absl::Status GltfTextures::FillTriangles(const std::vector<double>& uv,
                                         const std::vector<std::array<float, 4>>& tangents, Reading* reading) const {
  for (const std::size_t p : reading->primitives) {
    PLANISH_RETURN_IF_ERROR(AddGltfTriangles({gltf_, options_, uv, tangents}, p, &reading->use, &reading->bake));
  }
  return absl::OkStatus();
}

absl::StatusOr<double> GltfTextures::EstimateSide(double total_area) {
  constexpr double kFilled = 2.0 / 3;
  PLANISH_ASSIGN_OR_RETURN(double side, merge_.EstimateSide(total_area));
  for (const Group& group : groups_) {
    for (const GltfTextureUse& use : group.uses) FindTexture(group, use);
  }
  for (Reading& reading : readings_) {
    PLANISH_ASSIGN_OR_RETURN(const std::string bytes, ImageBytes(reading.image));
    PLANISH_ASSIGN_OR_RETURN(const ImageHeader header, ReadImageHeader(bytes, reading.bake.name));
    const std::vector<double> anywhere(2 * gltf_.corner_vertex.size(), 0);
    PLANISH_RETURN_IF_ERROR(FillTriangles(anywhere, {}, &reading));
    // There is no new map yet: gives each triangle its share of the area of the map.
    for (std::size_t t = 0; t < reading.bake.triangles.size(); ++t) {
      const double leg = std::sqrt(2 * kFilled * reading.bake.areas[t] / total_area);
      reading.bake.triangles[t].to = {Vec2(0, 0), Vec2(leg, 0), Vec2(0, leg)};
    }
    if (header.texels() > 1) {
      side = std::max(side, TextureSideOf(reading.bake.triangles, reading.bake.areas, header.width, header.height));
    }
    side = std::max(side, 1.0);
    reading.bake = TextureBake();
  }
  return side;
}

// Makes materials, and clones of them, refer to textures_.
void GltfTextures::WriteMaterials(Json* json, std::vector<OutputWarning>* warnings) {
  std::map<std::int64_t, int> clones;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    Group& group = groups_[g];
    std::int64_t index = group.material;
    if (is_shared_[g]) {
      const Json copy = root_["materials"][static_cast<std::size_t>(group.material)];
      index = static_cast<std::int64_t>((*json)["materials"].size());
      (*json)["materials"].push_back(copy);
      if (copy.contains("name") && copy["name"].is_string()) {
        (*json)["materials"].back()["name"] =
            copy["name"].get<std::string>() + "_" + std::to_string(2 + clones[group.material]);
      }
      ++clones[group.material];
      for (const Place& place : group.places) {
        Json& primitive = (*json)["meshes"][place.mesh]["primitives"][place.primitive];
        Json& holder = place.mapping ? primitive["extensions"][kVariants]["mappings"][*place.mapping] : primitive;
        holder["material"] = index;
      }
    }
    Json& material = (*json)["materials"][static_cast<std::size_t>(index)];
    for (std::size_t u = 0; u < group.uses.size(); ++u) {
      Json& info = material[group.uses[u].at];
      info["index"] = textures_[texture_of_use_[g][u]].slot;
      if (options_.texcoord == 0) {
        info.erase("texCoord");
      } else {
        info["texCoord"] = options_.texcoord;
      }
      if (!info.contains("extensions") || !info["extensions"].is_object()) continue;
      info["extensions"].erase(kTransform);
      if (info["extensions"].empty()) info.erase("extensions");
    }
  }
  for (const auto& [material, count] : clones) {
    warnings->push_back(
        {"MATERIAL_CLONED", "material " +
                                GltfName(root_["materials"][static_cast<std::size_t>(material)], "material", material) +
                                " is there " + std::to_string(count) + (count == 1 ? " more time" : " more times") +
                                ", as it is used in several atlases, or by lines and points"});
  }
}

void GltfTextures::WriteTextures(Json* json) {
  // Old textures and images that some material or texture still uses.
  std::vector<bool> keeps_texture(root_["textures"].size(), false), keeps_image(root_["images"].size(), false);
  std::map<std::int64_t, std::set<std::string>> moved;  // by material: the slots whose textures are moved
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if (is_shared_[g]) continue;
    for (const GltfTextureUse& use : groups_[g].uses) moved[groups_[g].material].insert(use.at.to_string());
  }
  for (std::int64_t m = 0; m < static_cast<std::int64_t>(root_["materials"].size()); ++m) {
    for (const GltfTextureUse& use : TextureUses(root_, m)) {
      const bool stays = !moved.contains(m) || !moved[m].contains(use.at.to_string());
      if (stays && use.texture >= 0 && use.texture < static_cast<std::int64_t>(keeps_texture.size())) {
        keeps_texture[static_cast<std::size_t>(use.texture)] = true;
      }
    }
  }
  std::vector<bool> is_moved(keeps_texture.size(), false);
  for (const NewTexture& texture : textures_) is_moved[static_cast<std::size_t>(texture.old)] = true;
  for (std::size_t t = 0; t < keeps_texture.size(); ++t) {
    for (const GltfTextureSource& source : TextureSources(root_, static_cast<std::int64_t>(t))) {
      if (source.image >= static_cast<std::int64_t>(keeps_image.size())) continue;
      if (keeps_texture[t] || !is_moved[t]) keeps_image[static_cast<std::size_t>(source.image)] = true;
    }
  }
  // The first new version of an image replaces it if nothing else uses the old image. Others are added at the end.
  for (Reading& reading : readings_) {
    auto place = static_cast<std::size_t>(reading.image);
    if (keeps_image[place]) {
      place = (*json)["images"].size();
      (*json)["images"].push_back(root_["images"][static_cast<std::size_t>(reading.image)]);
      keeps_image.push_back(true);
    }
    keeps_image[place] = true;
    reading.slot = static_cast<std::int64_t>(place);
  }
  for (NewTexture& texture : textures_) {
    auto place = static_cast<std::size_t>(texture.old);
    if (keeps_texture[place]) {
      place = (*json)["textures"].size();
      (*json)["textures"].push_back(root_["textures"][static_cast<std::size_t>(texture.old)]);
      keeps_texture.push_back(true);
    }
    keeps_texture[place] = true;
    texture.slot = static_cast<std::int64_t>(place);
    Json& out = (*json)["textures"][place];
    const std::vector<GltfTextureSource> sources = TextureSources(root_, texture.old);
    for (std::size_t s = 0; s < sources.size(); ++s) {
      Json& holder = sources[s].extension.empty() ? out : out["extensions"][sources[s].extension];
      holder["source"] = readings_[texture.readings[s]].slot;
    }
    // With several atlases, charts lie in other tiles than the image, so the image must repeat: removes its wrap modes.
    const Json* const sampler = SamplerOfTexture(root_, texture.old);
    const std::array<TextureWrap, 2> wraps = TextureWraps(root_, texture.old);
    const bool repeats = wraps[0] == TextureWrap::kRepeat && wraps[1] == TextureWrap::kRepeat;
    if (options_.textures.polygon_atlas.empty() || repeats) continue;
    Json copy = *sampler;
    copy.erase("wrapS");
    copy.erase("wrapT");
    out["sampler"] = (*json)["samplers"].size();
    (*json)["samplers"].push_back(std::move(copy));
  }
}

void GltfTextures::PutImage(std::size_t slot, const Reading& reading, std::string bytes, TextureFileNames* names,
                            GltfPatch* patch, WrittenMesh* written) const {
  const Json& old = root_["images"][static_cast<std::size_t>(reading.image)];
  Json& image = patch->json()["images"][slot];
  const ImageKind kind = KindOfImage(bytes).value_or(ImageKind::kPng);
  const auto uri = old.find("uri");
  const bool is_file = uri != old.end() && uri->is_string() && !IsDataUri(uri->get_ref<const std::string&>());
  if (is_file && options_.path != "-") {
    const absl::StatusOr<std::string> name = FileOfUri(gltf_.document, "", uri->get<std::string>());
    const std::string path = names->Next(name.ok() ? *name : "image", kind);
    image["uri"] = UriOfFileName(std::filesystem::path(path).filename().string());
    // The old mimeType may be wrong, as the kind was found in the bytes.
    if (image.contains("mimeType")) image["mimeType"] = MimeType(kind);
    image.erase("bufferView");
    written->files.push_back({path, std::move(bytes)});
    return;
  }
  image.erase("uri");
  image["mimeType"] = MimeType(kind);
  // The version that replaces the old image replaces its view too.
  const bool is_own_place = slot == static_cast<std::size_t>(reading.image);
  image["bufferView"] = patch->AddView(is_own_place ? GltfIntAt(old, "bufferView", -1) : -1, std::move(bytes), 0, 0);
}

absl::Status GltfTextures::WriteImages(const std::vector<double>& uv, const std::vector<std::array<float, 4>>& tangents,
                                       TextureFileNames* names, GltfPatch* patch, WrittenMesh* written) {
  for (std::size_t i = 0; i < readings_.size(); ++i) {
    Reading& reading = readings_[i];
    if (options_.textures.on_image) {
      options_.textures.on_image({GltfImageName(root_, reading.image), i + 1, readings_.size() + merge_.num_images()});
    }
    absl::StatusOr<std::string> bytes = ImageBytes(reading.image);
    if (!bytes.ok()) return WithTextureAdvice(bytes.status());
    PLANISH_RETURN_IF_ERROR(FillTriangles(uv, tangents, &reading));
    bytes = BakeImage(*std::move(bytes), reading.bake, options_.textures, &written->warnings);
    if (!bytes.ok()) return WithTextureAdvice(bytes.status());
    reading.bake = TextureBake();
    PutImage(static_cast<std::size_t>(reading.slot), reading, *std::move(bytes), names, patch, written);
  }
  return absl::OkStatus();
}

absl::Status GltfTextures::Move(const std::vector<double>& uv, const std::vector<std::array<float, 4>>& tangents,
                                GltfPatch* patch, WrittenMesh* written) {
  std::vector<std::string> taken = FilesOfGltf(gltf_);
  taken.push_back(options_.path);
  TextureFileNames names(options_.path, taken);
  if (!groups_.empty()) PLANISH_RETURN_IF_ERROR(MoveGroups(uv, tangents, &names, patch, written));
  if (!merge_.empty()) {
    PLANISH_RETURN_IF_ERROR(merge_.Write({gltf_, options_, uv, tangents}, readings_.size(), &names, patch, written));
  }
  const std::vector<OutputWarning> warnings = merge_.Warnings();
  written->warnings.insert(written->warnings.end(), warnings.begin(), warnings.end());
  ForgetExtension(&patch->json(), kTransform);
  return absl::OkStatus();
}

absl::Status GltfTextures::MoveGroups(const std::vector<double>& uv, const std::vector<std::array<float, 4>>& tangents,
                                      TextureFileNames* names, GltfPatch* patch, WrittenMesh* written) {
  for (const Group& group : groups_) {
    for (const GltfTextureUse& use : group.uses) {
      for (const GltfTextureSource& source : TextureSources(root_, use.texture)) {
        if (ElementOf(root_, "images", source.image) != nullptr) continue;
        return GltfFault(gltf_.document, "textures[" + std::to_string(use.texture) + "].source",
                         "there is no such image");
      }
    }
    std::vector<std::size_t>& textures = texture_of_use_.emplace_back();
    for (const GltfTextureUse& use : group.uses) textures.push_back(FindTexture(group, use));
  }
  WriteTextures(&patch->json());
  WriteMaterials(&patch->json(), &written->warnings);
  return WriteImages(uv, tangents, names, patch, written);
}

void GltfTextures::Drop(GltfPatch* patch, std::vector<OutputWarning>* warnings) const {
  std::set<std::int64_t> done, textures;
  for (const Group& group : groups_) {
    if (!done.insert(group.material).second) continue;
    Json& material = patch->json()["materials"][static_cast<std::size_t>(group.material)];
    std::string names;
    for (const GltfTextureUse& use : group.uses) {
      material[use.at.parent_pointer()].erase(use.at.back());
      textures.insert(use.texture);
      names += (names.empty() ? "" : ", ") + use.slot + " (" + use.name + ")";
    }
    warnings->push_back({"TEXTURE_DROPPED", "material " + GltfName(material, "material", group.material) +
                                                " no longer has " + names +
                                                ", which it read with the UV that were replaced"});
  }
  RemoveUnreadTextures(textures, patch);
  for (const char* name : {kTransform, "EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds"}) {
    ForgetExtension(&patch->json(), name);
  }
}

}  // namespace planish
