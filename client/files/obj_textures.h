// Moves the images of an OBJ's material files to its new map. Used only in client/files.
//
// The new material file has all materials of the old ones. Each image gets a new version for each way in which
// materials read it (-s, -o, -clamp, colour or data, atlas); these options are applied and removed. A material that
// several atlases share is copied for each.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/mesh_output.h"
#include "client/files/obj_materials.h"
#include "client/files/texture_files.h"
#include "client/files/writers.h"

namespace planish {

class ObjTextures {
 public:
  // Reads the material files; an unreadable one counts as empty. `file` and `options` must outlive the object.
  ObjTextures(const MeshFile& file, const OutputOptions& options);

  // Whether no face has both UV and a material with images.
  bool empty() const { return groups_.empty(); }
  // Checks, before there is a map, that every image can be read; IMAGE_OUTSIDE also for material files.
  absl::Status Check() const;
  absl::StatusOr<double> EstimateSide(double total_area);

  // Resamples the images and writes the material file. `edit` is for the OBJ writer. Appends files and warnings.
  absl::Status Move(const WrittenPolygons& polygons, ObjMaterialEdit* edit, WrittenMesh* written);
  // Writes a material file without the images.
  void Drop(ObjMaterialEdit* edit, WrittenMesh* written);
  // Warns of images that no longer fit.
  void Warn(std::vector<OutputWarning>* warnings) const;
  // The paths of the images, relative to the folder of the model.
  std::vector<std::string> Files() const;

 private:
  struct Library {
    std::string folder;  // relative to the folder of the model; empty or with a slash at the end
    MtlFile mtl;
  };
  // A material in one atlas.
  struct Group {
    std::int32_t id = 0;  // in PolygonMesh::material_names
    std::int32_t atlas = 0;
    std::size_t library = 0, material = 0;
    std::string name;                   // in the new material file
    std::vector<std::size_t> readings;  // one for each map
  };
  struct Reading {
    std::string file;  // relative to the folder of the model
    MtlMap map;
    std::vector<std::size_t> groups;
    TextureBake bake;
    std::string new_file;
  };

  const MtlMaterial& MaterialOf(const Group& group) const {
    return libraries_[group.library].mtl.materials[group.material];
  }
  absl::Status FillTriangles(const WrittenPolygons& polygons, const std::vector<std::int32_t>& atlas_of_polygon,
                             Reading* reading) const;
  absl::StatusOr<std::string> ImageBytes(const Reading& reading) const;
  std::string MtlText(bool with_images) const;

  const MeshFile& file_;
  const OutputOptions& options_;
  std::vector<Library> libraries_;
  absl::Status outside_;
  std::vector<Group> groups_;
  std::map<std::pair<std::int32_t, std::int32_t>, std::size_t> group_of_;  // by material and atlas
  std::vector<Reading> readings_;
};

}  // namespace planish
