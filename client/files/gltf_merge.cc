#include "client/files/gltf_merge.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <map>
#include <utility>

#include "client/files/gltf_attribute.h"
#include "client/texture/texture_baker.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

using Pointer = Json::json_pointer;

constexpr char kColors[] = "COLOR_0";
constexpr char kVariantsOfMaterials[] = "KHR_materials_variants";
constexpr char kSpecularGlossiness[] = "KHR_materials_pbrSpecularGlossiness";
constexpr CornerColor kOnes = {1, 1, 1, 1};

// A key that is equal for materials which can become one: an array with a value for each of kPartsOfKind.
Json KindOf(const Json& material, const std::vector<GltfTextureUse>& uses) {
  Json stripped = material;
  Json directions = Json::array();
  for (const GltfTextureUse& use : uses) {
    stripped[use.at.parent_pointer()].erase(use.at.back());
    // A constant cannot replace a missing texture of directions, since it would be a direction of the old map.
    if (use.meaning == TextureMeaning::kDirection) directions.push_back(use.at.to_string());
  }
  const Json alpha_mode = stripped.value("alphaMode", Json("OPAQUE"));
  return {alpha_mode, alpha_mode == "MASK" ? stripped.value("alphaCutoff", Json(0.5)) : Json(),
          stripped.value("doubleSided", Json(false)), stripped.value("extensions", Json::object()),
          std::move(directions)};
}
constexpr const char* kPartsOfKind[] = {"alpha mode", "alpha cutoff", "sides", "extensions", "anisotropy textures"};

bool HasVariants(const Json& primitive) {
  const Json* const extensions = GltfObject(primitive, "extensions");
  return extensions != nullptr && GltfObject(*extensions, kVariantsOfMaterials) != nullptr;
}

// How often primitives and variants use each material.
std::map<std::int64_t, std::int64_t> UsesOfMaterials(const Json& root) {
  std::map<std::int64_t, std::int64_t> uses;
  for (const Json& mesh : root["meshes"]) {
    for (const Json& primitive : mesh["primitives"]) {
      ++uses[GltfIntAt(primitive, "material", -1)];
      for (const Json& mapping : VariantMappings(primitive)) {
        if (mapping.is_object()) ++uses[GltfIntAt(mapping, "material", -1)];
      }
    }
  }
  uses.erase(-1);  // the default one
  return uses;
}

std::set<std::int64_t> MaterialsOfVariants(const Json& root) {
  std::set<std::int64_t> materials;
  for (const Json& mesh : root["meshes"]) {
    for (const Json& primitive : mesh["primitives"]) {
      if (!HasVariants(primitive)) continue;
      materials.insert(GltfIntAt(primitive, "material", -1));
      for (const Json& mapping : VariantMappings(primitive)) {
        if (mapping.is_object()) materials.insert(GltfIntAt(mapping, "material", -1));
      }
    }
  }
  materials.erase(-1);
  return materials;
}

}  // namespace

GltfMerge::GltfMerge(const GltfMesh& gltf, const OutputOptions& options)
    : gltf_(gltf),
      options_(options),
      root_(gltf.document.json),
      group_of_(gltf.primitives.size()),
      bakes_colors_(gltf.primitives.size(), false),
      needs_tangents_(gltf.primitives.size(), false) {
  if (options.textures.mode == TextureMode::kTransfer) FindGroups();
}

// Whether the primitive has vertex colours that are to be painted into an image, and can be. If they cannot be, notes
// the reason in unpainted_because_.
bool GltfMerge::CanBakeColors(std::size_t p) {
  const Json& primitive = PrimitiveJson(root_, gltf_.primitives[p]);
  if (!options_.textures.bake_colors || !primitive["attributes"].contains(kColors)) return false;
  const auto refuse = [this](const char* why) {
    unpainted_because_.insert(why);
    return false;
  };
  if (HasVariants(primitive)) return refuse("belong to variants of materials");
  if (primitive["attributes"].contains("COLOR_1")) return refuse("have a second set of colours");
  for (const Json& target : primitive.value("targets", Json::array())) {
    if (target.contains(kColors)) return refuse("have colours that morph targets change");
  }
  const std::int64_t material = GltfIntAt(primitive, "material", -1);
  if (material >= 0) {
    const Json* const extensions = GltfObject(root_["materials"][static_cast<std::size_t>(material)], "extensions");
    if (extensions != nullptr && extensions->contains(kSpecularGlossiness)) {
      return refuse("have a material of KHR_materials_pbrSpecularGlossiness");
    }
  }
  return true;
}

void GltfMerge::FindGroups() {
  const bool merges = options_.textures.merge_materials;
  if (!merges && !options_.textures.bake_colors) return;
  const std::vector<std::int32_t>& atlases = options_.textures.polygon_atlas;
  const std::set<std::int64_t> varying = MaterialsOfVariants(root_);
  struct Found {
    MergedGroup group;
    std::map<std::int64_t, std::size_t> member_of_material;
  };
  std::map<std::string, Found> by_key;
  Kinds kinds;
  std::vector<std::string> key_of(gltf_.primitives.size());
  for (std::size_t p = 0; p < gltf_.primitives.size(); ++p) {
    const GltfPrimitive& primitive = gltf_.primitives[p];
    if (primitive.num_polygons == 0) continue;
    const std::int64_t material = GltfIntAt(PrimitiveJson(root_, primitive), "material", -1);
    MergedMember member;
    member.material = material;
    if (material >= 0) member.json = root_["materials"][static_cast<std::size_t>(material)];
    member.uses = TextureUses(root_, material);
    std::erase_if(member.uses, [this](const auto& use) { return TextureSources(root_, use.texture).empty(); });
    const bool is_alone = material >= 0 && (varying.contains(material) || IsAnimated(root_, material));
    if (is_alone && merges) left_alone_.insert(material);
    Json key = {atlases.empty() ? 0 : atlases[static_cast<std::size_t>(primitive.first_polygon)]};
    key.push_back(merges && !is_alone ? KindOf(member.json, member.uses) : Json(material));
    if (!is_alone) kinds[material].insert(key);
    bakes_colors_[p] = CanBakeColors(p);
    key_of[p] = key.dump(-1, ' ', false, Json::error_handler_t::replace);
    auto& [group, member_of_material] = by_key[key_of[p]];
    group.has_colors = group.has_colors || bakes_colors_[p];
    const auto [known, is_new] = member_of_material.emplace(material, group.members.size());
    if (is_new) group.members.push_back(std::move(member));
    group.members[known->second].primitives.push_back(p);
  }
  // Makes the groups in the order of the primitives.
  for (const std::string& key : key_of) {
    const auto found = by_key.find(key);
    if (found == by_key.end()) continue;
    MergedGroup group = std::move(found->second.group);
    by_key.erase(found);
    if (group.members.size() < 2 && !group.has_colors) continue;
    bool has_directions = false;
    for (const MergedMember& member : group.members) {
      has_directions = has_directions || std::any_of(member.uses.begin(), member.uses.end(), IsDirection);
    }
    for (const MergedMember& member : group.members) {
      for (const std::size_t p : member.primitives) {
        group_of_[p] = groups_.size();
        needs_tangents_[p] = has_directions;
      }
    }
    groups_.push_back(std::move(group));
  }
  const bool has_merged =
      std::any_of(groups_.begin(), groups_.end(), [](const MergedGroup& group) { return group.members.size() > 1; });
  if (merges && !has_merged) NoteNothingMerged(kinds);
}

void GltfMerge::NoteNothingMerged(const Kinds& kinds) {
  if (kinds.size() < 2) {
    // Those left alone have warnings of their own.
    if (!kinds.empty()) {
      nothing_merged_because_ =
          left_alone_.empty() ? "the triangles have one material" : "only one material is left that could be";
    }
    return;
  }
  std::set<Json> atlases;
  std::vector<std::set<Json>> parts(std::size(kPartsOfKind));
  for (const auto& [material, keys] : kinds) {
    for (const Json& key : keys) {
      atlases.insert(key[0]);
      for (std::size_t i = 0; i < parts.size(); ++i) parts[i].insert(key[1][i]);
    }
  }
  std::string differences;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (parts[i].size() > 1) differences += (differences.empty() ? "" : ", ") + std::string(kPartsOfKind[i]);
  }
  if (atlases.size() > 1) differences += std::string(differences.empty() ? "" : ", ") + "atlas";
  nothing_merged_because_ = "the " + std::to_string(kinds.size()) + " materials differ in " + differences;
}

absl::Status GltfMerge::Check() const {
  std::set<std::int64_t> seen;
  for (const MergedGroup& group : groups_) {
    for (const MergedMember& member : group.members) {
      PLANISH_RETURN_IF_ERROR(CheckGltfTextures(gltf_, options_, member.material, member.uses, &seen));
    }
  }
  return absl::OkStatus();
}

std::size_t GltfMerge::num_images() const {
  std::size_t count = 0;
  for (const MergedGroup& group : groups_) count += PlanMerge(group).images.size();
  return count;
}

// ---- Drawing the images

absl::StatusOr<double> GltfMerge::EstimateSide(double total_area) const {
  constexpr double kFilled = 2.0 / 3;
  double side = groups_.empty() ? 0 : 1;
  const std::vector<double> anywhere(2 * gltf_.corner_vertex.size(), 0);
  const std::vector<std::array<float, 4>> no_tangents;
  const GltfOutput output = {gltf_, options_, anywhere, no_tangents};
  const auto shrink = [total_area](TextureBake* bake) {
    // There is no new map yet: gives each triangle its share of the area of the map.
    for (std::size_t t = 0; t < bake->triangles.size(); ++t) {
      const double leg = std::sqrt(2 * kFilled * bake->areas[t] / total_area);
      bake->triangles[t].to = {Vec2(0, 0), Vec2(leg, 0), Vec2(0, leg)};
    }
  };
  for (const MergedGroup& group : groups_) {
    for (const PlannedImage& image : PlanMerge(group).images) {
      for (const PlannedPart& part : image.parts) {
        if (part.use == nullptr && !image.has_colors) continue;
        TextureBake bake;
        for (const std::size_t m : part.members) {
          for (const std::size_t p : group.members[m].primitives) {
            PLANISH_RETURN_IF_ERROR(AddGltfTriangles(output, p, part.use, &bake));
          }
        }
        shrink(&bake);
        if (image.has_colors) side = std::max(side, SideOfVertexColors(bake.triangles, bake.areas));
        if (part.use == nullptr) continue;
        const std::int64_t source = TextureSources(root_, part.use->texture)[0].image;
        PLANISH_ASSIGN_OR_RETURN(const std::string bytes,
                                 GltfImageBytes(gltf_.document, source, options_.textures.allow_outside));
        PLANISH_ASSIGN_OR_RETURN(const ImageHeader header,
                                 ReadImageHeader(bytes, GltfImageTitle(gltf_.document, source)));
        if (header.texels() > 1) {
          side = std::max(side, TextureSideOf(bake.triangles, bake.areas, header.width, header.height));
        }
      }
    }
  }
  return side;
}

// Whether the image needs an alpha channel: it may have one, and a factor, an old image or a vertex colour has alpha.
absl::StatusOr<bool> GltfMerge::NeedsAlpha(const MergedGroup& group, const PlannedImage& image) const {
  if (!image.may_have_alpha) return false;
  for (const PlannedPart& part : image.parts) {
    if (part.options.factor[3] < 1) return true;
    if (part.use != nullptr) {
      const std::int64_t source = TextureSources(root_, part.use->texture)[0].image;
      PLANISH_ASSIGN_OR_RETURN(const std::string bytes,
                               GltfImageBytes(gltf_.document, source, options_.textures.allow_outside));
      PLANISH_ASSIGN_OR_RETURN(const ImageHeader header,
                               ReadImageHeader(bytes, GltfImageTitle(gltf_.document, source)));
      if (header.has_alpha()) return true;
    }
    for (const std::size_t m : part.members) {
      for (const std::size_t p : group.members[m].primitives) {
        if (!image.has_colors || !bakes_colors_[p]) continue;
        PLANISH_ASSIGN_OR_RETURN(const std::vector<CornerColor> colors, CornerColors(gltf_, gltf_.primitives[p]));
        if (std::any_of(colors.begin(), colors.end(), [](const CornerColor& color) { return color[3] < 1; }))
          return true;
      }
    }
  }
  return false;
}

absl::StatusOr<std::string> GltfMerge::Draw(const GltfOutput& output, const MergedGroup& group,
                                            const PlannedImage& image, std::vector<OutputWarning>* warnings) const {
  std::vector<TexturePart> parts;
  for (const PlannedPart& planned : image.parts) {
    TexturePart& part = parts.emplace_back();
    if (planned.use != nullptr) {
      const std::int64_t source = TextureSources(root_, planned.use->texture)[0].image;
      part.bake = BakeOfGltfTexture(gltf_, *planned.use, source);
      part.read = [this, source] { return GltfImageBytes(gltf_.document, source, options_.textures.allow_outside); };
    }
    part.bake.options = planned.options;
    for (const std::size_t m : planned.members) {
      for (const std::size_t p : group.members[m].primitives) {
        PLANISH_RETURN_IF_ERROR(AddGltfTriangles(output, p, planned.use, &part.bake));
        if (!image.has_colors) continue;
        const GltfPrimitive& primitive = gltf_.primitives[p];
        PLANISH_ASSIGN_OR_RETURN(const std::vector<CornerColor> colors, CornerColors(gltf_, primitive));
        if (bakes_colors_[p] && !colors.empty()) {
          part.bake.colors.insert(part.bake.colors.end(), colors.begin(), colors.end());
        } else {
          part.bake.colors.resize(part.bake.colors.size() + 3 * static_cast<std::size_t>(primitive.num_polygons),
                                  kOnes);
        }
      }
    }
  }
  PLANISH_ASSIGN_OR_RETURN(const bool has_alpha, NeedsAlpha(group, image));
  return BakeParts(std::move(parts), gltf_.document.path + ": " + image.name, has_alpha, options_.textures, warnings);
}

// Adds an image, and a texture that shows it. Returns the texture's index.
std::int64_t GltfMerge::AddTexture(const PlannedImage& image, std::string bytes, TextureFileNames* names,
                                   GltfPatch* patch, WrittenMesh* written) const {
  Json& root = patch->json();
  const auto array = [&root](const char* key) -> Json& {
    if (!root.contains(key)) root[key] = Json::array();
    return root[key];
  };
  const ImageKind kind = KindOfImage(bytes).value_or(ImageKind::kPng);
  // The new image becomes a file if one of the old images is a file.
  bool is_file = false;
  // If all old textures have the same sampler, apart from wrap modes, the new one has it too.
  std::set<std::string> samplers;
  Json sampler = Json::object();
  for (const PlannedPart& part : image.parts) {
    if (part.use == nullptr) continue;
    const auto source = static_cast<std::size_t>(TextureSources(root_, part.use->texture)[0].image);
    const auto uri = root_["images"][source].find("uri");
    is_file = is_file || (uri != root_["images"][source].end() && uri->is_string() &&
                          !IsDataUri(uri->get_ref<const std::string&>()));
    const Json* const own = SamplerOfTexture(root_, part.use->texture);
    sampler = own == nullptr ? Json::object() : *own;
    for (const char* gone : {"wrapS", "wrapT", "name"}) sampler.erase(gone);
    samplers.insert(sampler.dump(-1, ' ', false, Json::error_handler_t::replace));
  }
  Json json = {{"name", image.name}};
  if (is_file && options_.path != "-") {
    const std::string path = names->Next(image.name, kind);
    json["uri"] = UriOfFileName(std::filesystem::path(path).filename().string());
    written->files.push_back({path, std::move(bytes)});
  } else {
    json["mimeType"] = MimeType(kind);
    json["bufferView"] = patch->AddView(-1, std::move(bytes), 0, 0);
  }
  const std::size_t index = array("images").size();
  array("images").push_back(std::move(json));
  Json texture = Json::object();
  if (samplers.size() == 1 && !sampler.empty()) {
    Json& list = array("samplers");
    const auto known = std::find(list.begin(), list.end(), sampler);
    texture["sampler"] = known - list.begin();
    if (known == list.end()) list.push_back(sampler);
  }
  if (kind == ImageKind::kWebp) {
    texture["extensions"]["EXT_texture_webp"]["source"] = index;
    Json& used = array("extensionsUsed");
    if (std::find(used.begin(), used.end(), "EXT_texture_webp") == used.end()) used.push_back("EXT_texture_webp");
  } else {
    texture["source"] = index;
  }
  array("textures").push_back(std::move(texture));
  return std::ssize(root["textures"]) - 1;
}

absl::Status GltfMerge::Write(const GltfOutput& output, std::size_t drawn, TextureFileNames* names, GltfPatch* patch,
                              WrittenMesh* written) const {
  const std::size_t total = drawn + num_images();
  std::set<std::int64_t> old_materials, old_textures;
  std::map<std::int64_t, std::int64_t> uses = UsesOfMaterials(root_);
  for (const MergedGroup& group : groups_) {
    MergePlan plan = PlanMerge(group);
    for (const PlannedImage& image : plan.images) {
      if (options_.textures.on_image) options_.textures.on_image({image.name, ++drawn, total});
      absl::StatusOr<std::string> bytes = Draw(output, group, image, &written->warnings);
      if (!bytes.ok()) return WithTextureAdvice(bytes.status());
      const std::int64_t texture = AddTexture(image, *std::move(bytes), names, patch, written);
      for (const Pointer& slot : image.slots) {
        Json& info = plan.material[slot];
        info["index"] = texture;
        info.erase("texCoord");
        if (options_.texcoord != 0) info["texCoord"] = options_.texcoord;
        if (!info.contains("extensions") || !info["extensions"].is_object()) continue;
        info["extensions"].erase("KHR_texture_transform");
        if (info["extensions"].empty()) info.erase("extensions");
      }
    }
    Json& root = patch->json();
    for (const MergedMember& member : group.members) {
      old_materials.insert(member.material);
      for (const GltfTextureUse& use : member.uses) old_textures.insert(use.texture);
    }
    // A material that only these primitives use keeps its number, because animations refer to materials by number.
    const MergedMember& first = group.members[0];
    if (group.members.size() == 1 && uses[first.material] == std::ssize(first.primitives)) {
      root["materials"][static_cast<std::size_t>(first.material)] = std::move(plan.material);
      continue;
    }
    if (!root.contains("materials")) root["materials"] = Json::array();
    for (const MergedMember& member : group.members) {
      for (const std::size_t p : member.primitives) {
        PrimitiveJson(root, gltf_.primitives[p])["material"] = root["materials"].size();
      }
    }
    root["materials"].push_back(std::move(plan.material));
  }
  RemoveUnusedMaterials(old_materials, patch);
  RemoveUnreadTextures(old_textures, patch);
  for (const char* name : {"EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds"}) {
    ForgetExtension(&patch->json(), name);
  }
  return absl::OkStatus();
}

std::vector<OutputWarning> GltfMerge::Warnings() const {
  std::vector<OutputWarning> warnings;
  for (const MergedGroup& group : groups_) {
    if (group.members.size() < 2) continue;
    warnings.push_back(
        {"MATERIALS_MERGED", std::to_string(group.members.size()) + " materials are one now: " + NamesOf(group, 8)});
  }
  for (const std::int64_t material : left_alone_) {
    warnings.push_back({"MATERIAL_NOT_MERGED",
                        "material " +
                            GltfName(root_["materials"][static_cast<std::size_t>(material)], "material", material) +
                            (IsAnimated(root_, material) ? " is animated" : " belongs to variants of the model") +
                            ", and stays a material of its own"});
  }
  if (!nothing_merged_because_.empty()) {
    warnings.push_back({"MATERIAL_NOT_MERGED", "no materials were merged: " + nothing_merged_because_});
  }
  const auto painted = std::count(bakes_colors_.begin(), bakes_colors_.end(), true);
  if (painted > 0) {
    warnings.push_back({"COLORS_BAKED", "the vertex colours of " + std::to_string(painted) +
                                            (painted == 1 ? " primitive are" : " primitives are") +
                                            " in its image of base colours now; COLOR_0 is gone, as viewers would "
                                            "multiply them with the image"});
  }
  if (options_.textures.bake_colors && painted == 0 && unpainted_because_.empty()) {
    warnings.push_back({"COLORS_NOT_BAKED", gltf_.document.path + " has no vertex colours"});
  }
  for (const std::string& why : unpainted_because_) {
    warnings.push_back({"COLORS_NOT_BAKED", "vertex colours stay where primitives " + why});
  }
  return warnings;
}

}  // namespace planish
