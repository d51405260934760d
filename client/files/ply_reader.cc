#include <algorithm>

#include "client/files/file_io.h"
#include "client/files/ply_format.h"
#include "client/files/polygon_mesh.h"
#include "client/files/readers.h"
#include "client/files/seam_copies.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

class PlyReader {
 public:
  PlyReader(const std::string& path, std::string_view bytes, const PlyHeader& header, const PlyLayout& layout)
      : path_(path), header_(header), layout_(layout), values_(path, bytes, header) {}

  absl::StatusOr<PolygonMesh> Read() {
    num_vertices_ = header_.elements[layout_.vertex].count;
    for (std::size_t i = 0; i < header_.elements.size(); ++i) {
      const PlyElement& element = header_.elements[i];
      // Without properties there is no data, and the count has no effect.
      if (element.properties.empty()) continue;
      if (i == layout_.vertex) {
        PLANISH_RETURN_IF_ERROR(ReadVertices(element));
      } else if (i == layout_.face) {
        PLANISH_RETURN_IF_ERROR(ReadFaces(element));
      } else {
        PLANISH_RETURN_IF_ERROR(SkipElement(element));
      }
    }
    if (mesh_.num_polygons() == 0) return FileMalformed(path_, 0, "no faces");
    FinishTexcoords();
    return std::move(mesh_);
  }

 private:
  absl::Status ReadVertices(const PlyElement& element) {
    // Per property: 0 to 2 for x, y, z; 3 and 4 for u, v; kNoId for any other.
    std::vector<int> target_of(element.properties.size(), kNoId);
    if (layout_.vertex_uv) target_of[(*layout_.vertex_uv)[0]] = 3;
    if (layout_.vertex_uv) target_of[(*layout_.vertex_uv)[1]] = 4;
    for (int axis = 0; axis < 3; ++axis) target_of[layout_.xyz[axis]] = axis;
    mesh_.positions.reserve(element.count);
    for (std::int64_t i = 0; i < element.count; ++i) {
      const ElementName vertex = {"vertex", i};
      double values[5] = {0, 0, 0, 0, 0};
      for (std::size_t p = 0; p < target_of.size(); ++p) {
        if (target_of[p] == kNoId) {
          PLANISH_RETURN_IF_ERROR(values_.SkipProperty(vertex, element.properties[p]));
          continue;
        }
        PLANISH_RETURN_IF_ERROR(values_.ReadDouble(vertex, element.properties[p].type, &values[target_of[p]]));
        if (target_of[p] == 0 && values_.is_text()) mesh_.vertex_line.push_back(values_.line());
      }
      mesh_.positions.emplace_back(values[0], values[1], values[2]);
      if (layout_.vertex_uv) vertex_texcoord_.push_back(texcoords_.Add(values[3], values[4]));
    }
    return absl::OkStatus();
  }

  absl::Status ReadFaces(const PlyElement& element) {
    mesh_.polygon_begin.reserve(element.count + 1);
    mesh_.corner_vertex.reserve(3 * element.count);
    for (std::int64_t i = 0; i < element.count; ++i) {
      const ElementName face = {"face", i};
      face_texcoord_.clear();
      for (std::size_t p = 0; p < element.properties.size(); ++p) {
        if (p == layout_.indices) {
          PLANISH_RETURN_IF_ERROR(ReadPolygon(face, element.properties[p]));
        } else if (p == layout_.face_uv) {
          PLANISH_RETURN_IF_ERROR(ReadFaceTexcoords(face, element.properties[p]));
        } else {
          PLANISH_RETURN_IF_ERROR(values_.SkipProperty(face, element.properties[p]));
        }
      }
      if (!layout_.face_uv) continue;
      // Faces without a texture have an empty list, so their corners have no UV.
      face_texcoord_.resize(mesh_.polygon_begin[i + 1] - mesh_.polygon_begin[i], kNoId);
      mesh_.corner_texcoord.insert(mesh_.corner_texcoord.end(), face_texcoord_.begin(), face_texcoord_.end());
    }
    return absl::OkStatus();
  }

  absl::Status ReadFaceTexcoords(const ElementName& face, const PlyProperty& property) {
    std::int64_t length = 0;
    PLANISH_RETURN_IF_ERROR(values_.ReadInt(face, property.count_type, &length));
    if (length < 0) return values_.Fault("face " + std::to_string(face.index) + ": a texcoord list of negative length");
    for (std::int64_t i = 0; i < length; i += 2) {
      double uv[2] = {0, 0};
      for (std::int64_t k = 0; k < std::min<std::int64_t>(2, length - i); ++k) {
        PLANISH_RETURN_IF_ERROR(values_.ReadDouble(face, property.type, &uv[k]));
      }
      face_texcoord_.push_back(texcoords_.Add(uv[0], uv[1]));
    }
    return absl::OkStatus();
  }

  absl::Status ReadPolygon(const ElementName& face, const PlyProperty& property) {
    std::int64_t corners = 0;
    PLANISH_RETURN_IF_ERROR(values_.ReadInt(face, property.count_type, &corners));
    if (corners < 3) {
      return values_.Fault("face " + std::to_string(face.index) + " has " + std::to_string(corners) +
                           " corners, a face needs at least three");
    }
    if (values_.is_text()) mesh_.polygon_line.push_back(values_.line());
    for (std::int64_t corner = 0; corner < corners; ++corner) {
      std::int64_t vertex = 0;
      PLANISH_RETURN_IF_ERROR(values_.ReadInt(face, property.type, &vertex));
      if (vertex < 0 || vertex >= num_vertices_) {
        return values_.Fault("face " + std::to_string(face.index) + " refers to vertex " + std::to_string(vertex) +
                             ", but the file has " + std::to_string(num_vertices_) + ", numbered from 0");
      }
      mesh_.corner_vertex.push_back(static_cast<std::int32_t>(vertex));
    }
    mesh_.polygon_begin.push_back(static_cast<std::int64_t>(mesh_.corner_vertex.size()));
    return absl::OkStatus();
  }

  absl::Status SkipElement(const PlyElement& element) {
    for (std::int64_t i = 0; i < element.count; ++i) {
      for (const PlyProperty& property : element.properties) {
        PLANISH_RETURN_IF_ERROR(values_.SkipProperty({element.name.c_str(), i}, property));
      }
    }
    return absl::OkStatus();
  }

  // UV of corners take precedence over those of vertices, as they are more precise.
  void FinishTexcoords() {
    const auto& corners = mesh_.corner_texcoord;
    if (std::any_of(corners.begin(), corners.end(), [](std::int32_t id) { return id != kNoId; })) {
      mesh_.texcoords = texcoords_.TakeValues();
      return;
    }
    mesh_.corner_texcoord.clear();
    if (!layout_.vertex_uv) return;
    for (const std::int32_t vertex : mesh_.corner_vertex) mesh_.corner_texcoord.push_back(vertex_texcoord_[vertex]);
    mesh_.texcoords = texcoords_.TakeValues();
    // If faces have UV, the writer splits no vertices, so there are none to join.
    if (!layout_.face_uv) JoinSeamVertices(header_.seam_marks, &mesh_);
  }

  const std::string& path_;
  const PlyHeader& header_;
  const PlyLayout& layout_;
  PlyValues values_;
  std::int64_t num_vertices_ = 0;
  TexcoordTable texcoords_;
  std::vector<std::int32_t> vertex_texcoord_;
  std::vector<std::int32_t> face_texcoord_;  // of the current face
  PolygonMesh mesh_;
};

}  // namespace

absl::StatusOr<PolygonMesh> ReadPly(const std::string& path, std::string_view bytes) {
  if (bytes.empty()) return FileMalformed(path, 0, "the file is empty");
  PLANISH_ASSIGN_OR_RETURN(const PlyHeader header, ReadPlyHeader(path, bytes));
  PLANISH_ASSIGN_OR_RETURN(const PlyLayout layout, FindPlyLayout(path, header));
  return PlyReader(path, bytes, header, layout).Read();
}

}  // namespace planish
