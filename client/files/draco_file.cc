// Reads and writes .drc files, which hold nothing but Draco data.
#include <cstring>

#include "client/files/draco_uv.h"
#include "client/files/file_io.h"
#include "client/files/polygon_mesh.h"
#include "client/files/readers.h"
#include "client/files/seam_copies.h"
#include "client/files/writers.h"
#include "core/base/corner_split.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/draco/codec.h"
#include "core/draco/points.h"

namespace planish {
namespace {

// The first attribute that readers take for UV, or null.
const DracoAttribute* FindUv(const DracoPoints& points) {
  for (const DracoAttribute& attribute : points.attributes) {
    if (attribute.kind == DracoKind::kTexcoord && attribute.components == 2 && attribute.component == kDracoFloat32) {
      return &attribute;
    }
  }
  return nullptr;
}

absl::Status InFile(const std::string& path, const absl::Status& status) {
  if (status.code() != absl::StatusCode::kInvalidArgument) return status;
  return FileMalformed(path, 0, std::string(status.message()));
}

std::vector<std::int32_t> CornersOf(const DracoPoints& points) {
  std::vector<std::int32_t> corners;
  for (const Face& face : points.faces) corners.insert(corners.end(), face.begin(), face.end());
  return corners;
}

}  // namespace

absl::StatusOr<PolygonMesh> ReadDracoFile(const std::string& path, std::string_view bytes) {
  if (bytes.empty()) return FileMalformed(path, 0, "the file is empty");
  const absl::StatusOr<Mesh> decoded = DecodeDraco(bytes);
  if (!decoded.ok()) return InFile(path, decoded.status());
  const absl::StatusOr<DracoPoints> points = DecodeDracoPoints(std::string(bytes), false);
  if (!points.ok()) return InFile(path, points.status());
  PolygonMesh mesh;
  mesh.positions = decoded->positions;
  for (const Face& face : decoded->faces) {
    mesh.corner_vertex.insert(mesh.corner_vertex.end(), face.begin(), face.end());
    mesh.polygon_begin.push_back(static_cast<std::int64_t>(mesh.corner_vertex.size()));
  }
  const DracoAttribute* const uv = FindUv(*points);
  if (uv == nullptr) return mesh;
  TexcoordTable texcoords;
  for (const std::int32_t point : CornersOf(*points)) {
    float value[2];
    std::memcpy(value, uv->values.data() + point * uv->value_size, sizeof(value));
    mesh.corner_texcoord.push_back(texcoords.Add(value[0], value[1]));
  }
  mesh.texcoords = texcoords.TakeValues();
  // A file with UV has copies of its points at seams: joins them.
  JoinSeamVertices({}, &mesh);
  return mesh;
}

absl::StatusOr<std::string> WriteDraco(const MeshFile& file, const std::vector<double>& corner_uv) {
  PLANISH_ASSIGN_OR_RETURN(DracoPoints points, DecodeDracoPoints(file.bytes, true));
  const CornerSplit split = SplitCorners(points.num_points, CornersOf(points), corner_uv, true);
  const DracoAttribute* const old = FindUv(points);
  ReplaceDracoUv(split, split.corner, old == nullptr ? -1 : std::int64_t{old->unique_id}, &points);
  return EncodeDracoPoints(points);
}

absl::StatusOr<std::string> PlainDraco(const PolygonMesh& mesh, const std::vector<double>& corner_uv) {
  const Triangulation triangles = Triangulate(mesh);
  std::vector<double> uv;
  std::vector<std::int32_t> corners;
  DracoPoints points;
  points.faces = triangles.mesh.faces;
  points.num_points = triangles.mesh.num_vertices();
  for (const std::int64_t corner : triangles.corner_of_triangle) {
    uv.insert(uv.end(), {corner_uv[2 * corner], corner_uv[2 * corner + 1]});
  }
  DracoAttribute position;
  position.kind = DracoKind::kPosition;
  position.component = kDracoFloat32;
  position.components = 3;
  position.value_size = 3 * sizeof(float);
  for (const Vec3& p : triangles.mesh.positions) {
    const Eigen::Vector3f rounded = p.cast<float>();
    position.values.append(reinterpret_cast<const char*>(rounded.data()), 3 * sizeof(float));
  }
  points.attributes.push_back(std::move(position));
  const CornerSplit split = SplitCorners(points.num_points, CornersOf(points), uv, true);
  ReplaceDracoUv(split, split.corner, -1, &points);
  return EncodeDracoPoints(points);
}

}  // namespace planish
