// One writer per format, for mesh_output.cc. UV are (u, v) per corner of the file's polygons, v upwards.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/gltf_mesh.h"
#include "client/files/mesh_output.h"

namespace planish {

// The polygons to write, WithTornPolygons(file.mesh, torn), with (u, v) per corner.
struct WrittenPolygons {
  const PolygonMesh& mesh;
  const std::vector<double>& corner_uv;
  std::vector<TornPolygon> torn;
};

// New material references of an OBJ.
struct ObjMaterialEdit {
  std::string library;                  // the only material file; empty: keep those of the file
  std::vector<std::string> of_polygon;  // names, per polygon of the file; empty: keep those of the file
};

// Write the UV into the file's own bytes; file.format must be that of the writer.
std::string WriteObj(const MeshFile& file, const WrittenPolygons& written, bool uv_is_float,
                     const ObjMaterialEdit& materials = {});
// `keeps_images`: keeps the comments that name images.
absl::StatusOr<std::string> WritePly(const MeshFile& file, const WrittenPolygons& written, bool uv_is_float,
                                     bool keeps_images = true);
absl::StatusOr<std::string> WriteOff(const MeshFile& file, const WrittenPolygons& written, bool uv_is_float);
absl::StatusOr<WrittenMesh> WriteGltf(const GltfMesh& gltf, const std::vector<double>& corner_uv,
                                      const OutputOptions& options);
absl::StatusOr<std::string> WriteDraco(const MeshFile& file, const std::vector<double>& corner_uv);

// Write from polygons alone.
std::string PlainObj(const PolygonMesh& mesh, const std::vector<double>& corner_uv, bool uv_is_float);
std::string PlainPly(const PolygonMesh& mesh, const std::vector<double>& corner_uv, bool uv_is_float);
std::string PlainOff(const PolygonMesh& mesh, const std::vector<double>& corner_uv, bool uv_is_float);
// `base_color`: a PNG that all materials show, in place of their own colours; empty: none.
absl::StatusOr<WrittenMesh> PlainGltf(const PolygonMesh& mesh, const std::vector<double>& corner_uv,
                                      const OutputOptions& options, const std::string& base_color = "");
absl::StatusOr<std::string> PlainDraco(const PolygonMesh& mesh, const std::vector<double>& corner_uv);

// UV of glTF, whose v points downwards: 1 - v in float. Warns if that rounding flips or flattens triangles.
class FlippedUv {
 public:
  explicit FlippedUv(const std::vector<double>& corner_uv);
  const std::vector<double>& values() const { return values_; }
  // `corners` of triangles, three each. May append to `warnings`.
  void Check(const std::vector<std::int64_t>& corners, std::vector<OutputWarning>* warnings) const;

 private:
  const std::vector<double>& original_;
  std::vector<double> values_;
};

// The file or files of a glTF document: .glb with `buffer` inside; .gltf with a data URI, or with a .bin beside it if
// `external_buffer`.
absl::StatusOr<WrittenMesh> GltfFiles(Json json, std::string buffer, int indent, const std::string& other_chunks,
                                      bool external_buffer, const OutputOptions& options);

}  // namespace planish
