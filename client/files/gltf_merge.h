// Draws several materials of a glTF, and the colours of its vertices, into one set of images. Used only in
// client/files.
//
// With TextureOptions::merge_materials, materials of one atlas become one if they differ in nothing but images, factors
// and names: they have the same alpha mode and cutoff, sides and extensions. Each image of the new material is drawn
// from the old ones and from constants. A factor that is equal in all of the materials stays a factor; other factors
// are painted into the images. Materials that are animated or belong to variants are left alone.
//
// With TextureOptions::bake_colors, COLOR_0 is painted into the base colours of its material, and removed.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/files/gltf_bake.h"
#include "client/files/gltf_merge_plan.h"
#include "client/files/gltf_mesh.h"
#include "client/files/gltf_patch.h"
#include "client/files/mesh_output.h"
#include "client/files/texture_files.h"

namespace planish {

class GltfMerge {
 public:
  // Finds the materials. `gltf` and `options` must outlive the object.
  GltfMerge(const GltfMesh& gltf, const OutputOptions& options);

  bool empty() const { return groups_.empty(); }
  // Whether the primitive (of GltfMesh::primitives) gets a merged material, or an image with its vertex colours.
  bool Has(std::size_t primitive) const { return group_of_[primitive].has_value(); }
  // Whether the primitive's COLOR_0 is painted into an image, so that the attribute must be removed.
  bool BakesColors(std::size_t primitive) const { return bakes_colors_[primitive]; }
  bool NeedsTangents(std::size_t primitive) const { return needs_tangents_[primitive]; }
  // Checks, before there is a map, that every image can be read and resampled.
  absl::Status Check() const;

  // Estimates the side of the new images as EstimateTextureSide() (mesh_output.h) does.
  absl::StatusOr<double> EstimateSide(double total_area) const;

  // The number of images that Write() draws.
  std::size_t num_images() const;
  // Draws the images and edits the document. Appends image files, and warnings of images, to `written`. `drawn`: images
  // that were drawn before, for TextureOptions::on_image.
  absl::Status Write(const GltfOutput& output, std::size_t drawn, TextureFileNames* names, GltfPatch* patch,
                     WrittenMesh* written) const;
  // Names the materials that were merged, those left alone, and why; the same for vertex colours.
  std::vector<OutputWarning> Warnings() const;

 private:
  // Maps a material to its keys, one for each atlas that it has triangles in: the atlas, and the result of KindOf().
  using Kinds = std::map<std::int64_t, std::set<Json>>;

  void FindGroups();
  void NoteNothingMerged(const Kinds& kinds);
  bool CanBakeColors(std::size_t primitive);
  absl::StatusOr<std::string> Draw(const GltfOutput& output, const MergedGroup& group, const PlannedImage& image,
                                   std::vector<OutputWarning>* warnings) const;
  absl::StatusOr<bool> NeedsAlpha(const MergedGroup& group, const PlannedImage& image) const;
  std::int64_t AddTexture(const PlannedImage& image, std::string bytes, TextureFileNames* names, GltfPatch* patch,
                          WrittenMesh* written) const;

  const GltfMesh& gltf_;
  const OutputOptions& options_;
  const Json& root_;
  std::vector<MergedGroup> groups_;
  std::vector<std::optional<std::size_t>> group_of_;  // this and the next two: per primitive of triangles
  std::vector<bool> bakes_colors_;
  std::vector<bool> needs_tangents_;
  std::set<std::int64_t> left_alone_;        // materials that are not merged
  std::string nothing_merged_because_;       // empty where materials were merged, or were not to be
  std::set<std::string> unpainted_because_;  // why colours of vertices are not painted
};

}  // namespace planish
