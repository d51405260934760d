// Moves the images of a glTF to its new map. Used only in client/files.
//
// Textures that materials use with the replaced UV are resampled and used with the new UV, without
// KHR_texture_transform; those used with other sets of UV stay. An image gets a new version for each way in which it is
// read (transformation, wrap modes, colour or data, atlas). Textures that read an image in the same way keep sharing
// it. New images and textures reuse the places of old ones that are not used any more. GltfMerge handles materials that
// are merged and vertex colours that are painted.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/gltf_material.h"
#include "client/files/gltf_merge.h"
#include "client/files/gltf_mesh.h"
#include "client/files/gltf_patch.h"
#include "client/files/mesh_output.h"
#include "client/files/texture_files.h"

namespace planish {

class GltfTextures {
 public:
  // Finds the affected materials. `gltf` and `options` must outlive the object.
  GltfTextures(const GltfMesh& gltf, const OutputOptions& options);

  // Whether there is nothing to do.
  bool empty() const { return groups_.empty() && merge_.empty(); }
  // Whether a material of the primitive has directions in tangent space, so that tangents must be written.
  bool NeedsTangents(std::size_t primitive) const {
    return needs_tangents_[primitive] || merge_.NeedsTangents(primitive);
  }
  // Whether the primitive's COLOR_0 is painted into an image, so that the attribute must be removed.
  bool BakesColors(std::size_t primitive) const { return merge_.BakesColors(primitive); }
  // Checks, before there is a map, that every image can be read and resampled.
  absl::Status Check() const;

  // Estimates the side of the new images as EstimateTextureSide() (mesh_output.h) does.
  absl::StatusOr<double> EstimateSide(double total_area);

  // Resamples the images and edits the document. Per corner of the triangles: `uv`, v downwards, and `tangents` of the
  // new map, empty if no primitive needs them. Appends image files and warnings to `written`.
  absl::Status Move(const std::vector<double>& uv, const std::vector<std::array<float, 4>>& tangents, GltfPatch* patch,
                    WrittenMesh* written);
  // Removes the materials' references to the images instead of resampling these.
  void Drop(GltfPatch* patch, std::vector<OutputWarning>* warnings) const;

 private:
  // Where a primitive refers to its material: directly, or in one of its variants.
  struct Place {
    std::size_t mesh = 0, primitive = 0;
    std::optional<std::size_t> mapping;
    std::optional<std::size_t> triangles;  // in GltfMesh::primitives
  };
  // A material in one atlas.
  struct Group {
    std::int64_t material = 0;
    std::int32_t atlas = 0;
    std::vector<Place> places;
    std::vector<std::size_t> primitives;
    std::vector<GltfTextureUse> uses;
  };
  // A way in which an image is read.
  struct Reading {
    std::int64_t image = 0;
    std::int32_t atlas = 0;
    std::string key;
    GltfTextureUse use;
    TextureBake bake;
    std::vector<std::size_t> primitives;
    std::int64_t slot = -1;  // in the new document's images
  };
  struct NewTexture {
    std::int64_t old = -1;
    std::vector<std::size_t> readings;  // one for each source of the old texture
    std::int64_t slot = -1;
  };

  std::map<std::int64_t, std::vector<Place>> PlacesOfMaterials() const;
  absl::StatusOr<std::string> ImageBytes(std::int64_t image) const;
  std::size_t FindReading(const Group& group, const GltfTextureUse& use, std::int64_t image);
  std::size_t FindTexture(const Group& group, const GltfTextureUse& use);
  absl::Status FillTriangles(const std::vector<double>& uv, const std::vector<std::array<float, 4>>& tangents,
                             Reading* reading) const;
  absl::Status MoveGroups(const std::vector<double>& uv, const std::vector<std::array<float, 4>>& tangents,
                          TextureFileNames* names, GltfPatch* patch, WrittenMesh* written);
  void WriteMaterials(Json* json, std::vector<OutputWarning>* warnings);
  void WriteTextures(Json* json);
  absl::Status WriteImages(const std::vector<double>& uv, const std::vector<std::array<float, 4>>& tangents,
                           TextureFileNames* names, GltfPatch* patch, WrittenMesh* written);
  void PutImage(std::size_t slot, const Reading& reading, std::string bytes, TextureFileNames* names, GltfPatch* patch,
                WrittenMesh* written) const;

  const GltfMesh& gltf_;
  const OutputOptions& options_;
  const Json& root_;
  const GltfMerge merge_;  // the primitives that it handles are not in groups_
  std::vector<Group> groups_;
  std::vector<bool> needs_tangents_;  // per primitive of triangles
  std::vector<bool> is_shared_;       // per group: whether it gets a clone of the material, which others use too
  std::vector<Reading> readings_;
  std::map<std::string, std::size_t> reading_of_key_;
  std::vector<NewTexture> textures_;
  std::map<std::string, std::size_t> texture_of_key_;
  std::vector<std::vector<std::size_t>> texture_of_use_;  // per group and use
};

// Whether a material uses an image with TEXCOORD_`texcoord`.
bool ReadsTexcoord(const GltfMesh& gltf, int texcoord);
// The names of the images that materials of triangles use.
std::vector<std::string> ImagesShown(const GltfMesh& gltf);
// The first set of UV that no primitive has; kLargestTexcoord + 1 if none up to kLargestTexcoord is free.
int FreeTexcoord(const GltfMesh& gltf);

}  // namespace planish
