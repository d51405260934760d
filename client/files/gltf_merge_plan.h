// Plans the images of a material that replaces several. Used only in client/files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "client/files/gltf_document.h"
#include "client/files/gltf_material.h"
#include "client/texture/texture_baker.h"

namespace planish {

struct MergedMember {
  std::int64_t material = -1;  // -1: the default material, of primitives that name none
  Json json = Json::object();
  std::vector<std::size_t> primitives;
  std::vector<GltfTextureUse> uses;  // the textures that have an image

  const GltfTextureUse* UseAt(const Json::json_pointer& at) const;
};

// Materials that become one, in one atlas.
struct MergedGroup {
  std::vector<MergedMember> members;
  bool has_colors = false;  // vertex colours are painted into the base colours
};

// A part of a new image: what is drawn for some of the members.
struct PlannedPart {
  std::vector<std::size_t> members;
  const GltfTextureUse* use = nullptr;  // of a member; null: a constant, white with the options' factor and offset
  BakeOptions options;
};

struct PlannedImage {
  std::string name;
  std::vector<Json::json_pointer> slots;  // where the new material refers to the image
  std::vector<PlannedPart> parts;
  bool may_have_alpha = false;
  bool has_colors = false;
};

struct MergePlan {
  Json material = Json::object();  // its textureInfos have no index yet
  std::vector<PlannedImage> images;
};

// Plans the material of a group. A factor that is equal in all members stays a factor; others are painted into images.
// Occlusion, roughness and metalness share an image where they can.
MergePlan PlanMerge(const MergedGroup& group);

// "wood+steel+2 more": at most `most` names.
std::string NamesOf(const MergedGroup& group, std::size_t most);

}  // namespace planish
