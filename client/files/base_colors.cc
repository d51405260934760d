#include "client/files/base_colors.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <map>
#include <utility>

#include "absl/strings/match.h"
#include "client/files/gltf_accessor.h"
#include "client/files/gltf_document.h"
#include "client/files/gltf_material.h"
#include "client/files/gltf_mesh.h"
#include "client/files/obj_materials.h"
#include "client/files/texture_files.h"
#include "core/base/error.h"

namespace planish {

BaseColorReader::BaseColorReader(const MeshFile& file, bool allow_outside)
    : file_(file), allow_outside_(allow_outside) {
  if (file.gltf != nullptr) {
    ReadGltf();
  } else if (file.format == MeshFormat::kObj) {
    ReadObj();
  }
}

absl::StatusOr<std::string> BaseColorReader::Image(std::int64_t image) const {
  if (file_.gltf != nullptr) return GltfImageBytes(file_.gltf->document, image, allow_outside_);
  return ReadImageFile(file_.path, files_[static_cast<std::size_t>(image)], allow_outside_);
}

void BaseColorReader::ReadGltf() {
  constexpr std::int64_t kNearestFilter = 9728;
  const Json& root = file_.gltf->document.json;
  for (std::size_t m = 0; m < file_.mesh.material_names.size(); ++m) {
    BaseColor& color = of_material_.emplace_back();
    const Json& material = root["materials"][m];
    if (const Json* const surface = GltfObject(material, "pbrMetallicRoughness")) {
      const Json factor = surface->value("baseColorFactor", Json());
      for (std::size_t k = 0; k < 4 && factor.is_array() && k < factor.size(); ++k) {
        if (factor[k].is_number()) color.factor[k] = std::clamp(factor[k].get<double>(), 0.0, 1.0);
      }
    }
    if (const auto mode = material.find("alphaMode"); mode != material.end()) {
      color.alpha = *mode == "MASK" ? AlphaMode::kMask : *mode == "BLEND" ? AlphaMode::kBlend : AlphaMode::kOpaque;
    }
    if (const auto cutoff = material.find("alphaCutoff"); cutoff != material.end() && cutoff->is_number()) {
      color.cutoff = cutoff->get<double>();
    }
    for (const GltfTextureUse& use : TextureUses(root, static_cast<std::int64_t>(m))) {
      const bool is_normal = use.slot == "normalTexture";
      if (!is_normal && use.slot != "baseColorTexture") continue;
      const std::vector<GltfTextureSource> sources = TextureSources(root, use.texture);
      if (sources.empty()) continue;
      ShownImage& shown = is_normal ? color.normals : static_cast<ShownImage&>(color);
      shown.image = sources.front().image;
      shown.image_name = use.name;
      shown.texcoord = use.texcoord;
      shown.transform = use.transform;
      const auto [wrap_u, wrap_v] = TextureWraps(root, use.texture);
      shown.wrap_u = wrap_u;
      shown.wrap_v = wrap_v;
      const Json* const sampler = SamplerOfTexture(root, use.texture);
      shown.nearest = sampler != nullptr && GltfIntAt(*sampler, "magFilter", 0) == kNearestFilter;
      if (is_normal) color.normals.scale = use.normal_scale;
    }
  }
}

void BaseColorReader::ReadObj() {
  std::map<std::string, BaseColor> colors;  // by material
  for (const std::string& library : MaterialLibraries(file_.bytes)) {
    const absl::StatusOr<std::string> text = ReadImageFile(file_.path, library, allow_outside_);
    if (!text.ok()) continue;
    for (const MtlMaterial& material : ParseMtl(*text).materials) {
      for (const MtlMap& map : material.maps) {
        if (!absl::EqualsIgnoreCase(map.keyword, "map_Kd") || colors.contains(material.name)) continue;
        BaseColor& color = colors[material.name];
        color.image_name = (std::filesystem::path(library).parent_path() / map.file).generic_string();
        const auto known = std::find(files_.begin(), files_.end(), color.image_name);
        color.image = known - files_.begin();
        if (known == files_.end()) files_.push_back(color.image_name);
        // u' = scale u + offset holds for v upwards.
        color.transform = {map.scale[0], 0, map.offset[0], 0, map.scale[1], 1 - map.scale[1] - map.offset[1]};
        color.wrap_u = color.wrap_v = map.clamp ? TextureWrap::kClamp : TextureWrap::kRepeat;
      }
    }
  }
  for (const std::string& name : file_.mesh.material_names) {
    const auto found = colors.find(name);
    of_material_.push_back(found == colors.end() ? BaseColor() : found->second);
  }
}

}  // namespace planish
