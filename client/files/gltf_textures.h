// The images of a glTF, moved to its new map. Used inside client/files only.
//
// The textures that materials read with the UV that are replaced are drawn again and read with the new UV, without
// KHR_texture_transform; those that are read with other sets of UV stay. An image becomes a new one for each way in
// which it is read (transformation, wrap modes, colour or numbers, atlas); textures that read an image in the same way
// go on sharing it. The new images and textures take the places of the old ones that nobody reads any
// more.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/gltf_material.h"
#include "client/files/gltf_mesh.h"
#include "client/files/gltf_patch.h"
#include "client/files/mesh_output.h"
#include "client/files/texture_files.h"

namespace planish {

class GltfTextures {
 public:
  // Finds the materials that are concerned. `gltf` and `options` outlive the object.
  GltfTextures(const GltfMesh& gltf, const OutputOptions& options);

  // Whether there is anything to do.
  bool empty() const { return groups_.empty(); }
  // Whether a material of the primitive has directions that are expressed in tangents: these must be written.
  bool NeedsTangents(std::size_t primitive) const { return needs_tangents_[primitive]; }
  // That every image can be read and resampled, before there is a map. With `deep` the UV are read too.
  absl::Status Check() const;

  // EstimateTextureSide() (mesh_output.h).
  absl::StatusOr<double> EstimateSide(double total_area);

  // Draws the images and edits the document. `uv`: per corner of the triangles, v downwards; `tangents` likewise, of
  // the new map; empty if no primitive needs them. Appends image files and warnings to `written`.
  absl::Status Move(const std::vector<double>& uv, const std::vector<std::array<float, 4>>& tangents, GltfPatch* patch,
                    WrittenMesh* written);
  // Removes the references instead.
  void Drop(GltfPatch* patch, std::vector<OutputWarning>* warnings) const;

 private:
  // Where a primitive names its material: as its own, or as one of its variants.
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
    std::vector<std::size_t> readings;  // one a source of the old texture
    bool other_tile = false;
    std::int64_t slot = -1;
  };

  std::vector<Place> PlacesOf(std::int64_t material) const;
  absl::StatusOr<std::string> ImageBytes(std::int64_t image) const;
  std::size_t FindReading(const Group& group, const GltfTextureUse& use, std::int64_t image);
  std::size_t FindTexture(const Group& group, const GltfTextureUse& use);
  absl::Status FillTriangles(const std::vector<double>& uv, const std::vector<std::array<float, 4>>& tangents,
                             Reading* reading) const;
  void WriteMaterials(Json* json, std::vector<OutputWarning>* warnings);
  void WriteTextures(Json* json);
  absl::Status WriteImages(const std::vector<double>& uv, const std::vector<std::array<float, 4>>& tangents,
                           GltfPatch* patch, WrittenMesh* written);
  void PutImage(std::size_t slot, const Reading& reading, std::string bytes, TextureFileNames* names, GltfPatch* patch,
                WrittenMesh* written) const;

  const GltfMesh& gltf_;
  const OutputOptions& options_;
  const Json& root_;
  std::vector<Group> groups_;
  std::vector<bool> needs_tangents_;  // per primitive of triangles
  std::vector<bool> is_shared_;       // per group: others use the material, too
  std::vector<Reading> readings_;
  std::map<std::string, std::size_t> reading_of_key_;
  std::vector<NewTexture> textures_;
  std::map<std::string, std::size_t> texture_of_key_;
  std::vector<std::vector<std::size_t>> texture_of_use_;  // per group and use
};

// Whether a material reads an image with TEXCOORD_`texcoord`.
bool ReadsTexcoord(const GltfMesh& gltf, int texcoord);
// The first set of UV that no primitive has, at most 7.
int FreeTexcoord(const GltfMesh& gltf);

}  // namespace planish
