// Converts polygons of another format to glTF.
#include <array>
#include <cstring>
#include <limits>
#include <map>

#include "client/files/gltf_document.h"
#include "client/files/writers.h"
#include "client/texture/image.h"
#include "core/base/corner_split.h"
#include "core/base/status_macros.h"
#include "core/mesh/local_origin.h"

namespace planish {
namespace {

void Pad(std::string* bytes) {
  bytes->resize((bytes->size() + 3) / 4 * 4, '\0');
}

void AppendFloat(double value, std::string* bytes) {
  const float rounded = static_cast<float>(value);
  char data[sizeof(float)];
  std::memcpy(data, &rounded, sizeof(float));
  bytes->append(data, sizeof(float));
}

class GltfExport {
 public:
  GltfExport(const PolygonMesh& mesh, const std::vector<double>& uv, int texcoord)
      : mesh_(mesh),
        triangles_(Triangulate(mesh)),
        origin_(LocalOrigin(triangles_.mesh.positions)),
        uv_(uv),
        texcoord_(texcoord) {
    json_["asset"] = {{"version", "2.0"}, {"generator", "planish"}};
  }

  // Makes a mesh and a node for each group, with a primitive for each material. Positions are floats, which are coarse
  // far from the origin: there they are relative to `origin_`, and the nodes move the meshes to it.
  void Build() {
    std::map<std::int32_t, std::map<std::int32_t, std::vector<std::size_t>>> faces;
    for (std::size_t f = 0; f < triangles_.mesh.faces.size(); ++f) {
      const auto polygon = static_cast<std::size_t>(triangles_.source_polygon[f]);
      const std::int32_t group = mesh_.polygon_group.empty() ? -1 : mesh_.polygon_group[polygon];
      const std::int32_t material = mesh_.polygon_material.empty() ? -1 : mesh_.polygon_material[polygon];
      faces[group][material].push_back(f);
    }
    Json nodes = Json::array();
    Json meshes = Json::array();
    Json roots = Json::array();
    for (const auto& [group, by_material] : faces) {
      Json primitives = Json::array();
      for (const auto& [material, list] : by_material) primitives.push_back(Primitive(material, list));
      Json mesh = {{"primitives", std::move(primitives)}};
      Json node = {{"mesh", meshes.size()}};
      if (group >= 0) mesh["name"] = node["name"] = mesh_.group_names[static_cast<std::size_t>(group)];
      if (!origin_.isZero(0)) node["translation"] = {origin_.x(), origin_.y(), origin_.z()};
      roots.push_back(nodes.size());
      meshes.push_back(std::move(mesh));
      nodes.push_back(std::move(node));
    }
    json_["scene"] = 0;
    json_["scenes"] = Json::array({{{"nodes", std::move(roots)}}});
    json_["nodes"] = std::move(nodes);
    json_["meshes"] = std::move(meshes);
    if (!mesh_.material_names.empty()) {
      json_["materials"] = Json::array();
      for (const std::string& name : mesh_.material_names) json_["materials"].push_back({{"name", name}});
    }
    json_["accessors"] = std::move(accessors_);
    json_["bufferViews"] = std::move(views_);
    json_["buffers"] = Json::array({{{"byteLength", buffer_.size()}}});
  }

  // Gives every primitive a material that shows the PNG.
  void ShowImage(const std::string& png, bool has_alpha) {
    Pad(&buffer_);
    json_["images"] =
        Json::array({{{"name", "colors"}, {"mimeType", "image/png"}, {"bufferView", json_["bufferViews"].size()}}});
    json_["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", buffer_.size()}, {"byteLength", png.size()}});
    buffer_ += png;
    json_["buffers"][0]["byteLength"] = buffer_.size();
    json_["textures"] = Json::array({{{"source", 0}}});
    Json& materials = json_["materials"];
    const std::size_t plain = materials.size();
    bool is_used = false;
    for (Json& mesh : json_["meshes"]) {
      for (Json& primitive : mesh["primitives"]) {
        if (primitive.contains("material")) continue;
        primitive["material"] = plain;
        is_used = true;
      }
    }
    if (is_used) materials.push_back({{"name", "colors"}});
    for (Json& material : materials) {
      Json info = {{"index", 0}};
      if (texcoord_ > 0) info["texCoord"] = texcoord_;
      material["pbrMetallicRoughness"] = {{"baseColorTexture", std::move(info)}, {"metallicFactor", 0}};
      if (has_alpha) material["alphaMode"] = "BLEND";
    }
  }

  Json& json() { return json_; }
  const std::string& buffer() const { return buffer_; }
  const std::vector<std::int64_t>& corners() const { return triangles_.corner_of_triangle; }

 private:
  Json Primitive(std::int32_t material, const std::vector<std::size_t>& faces) {
    // The vertices of these faces, in the order of the file.
    std::map<std::int32_t, std::int32_t> local;
    for (const std::size_t f : faces) {
      for (const std::int32_t vertex : triangles_.mesh.faces[f]) local.emplace(vertex, 0);
    }
    std::vector<std::int32_t> vertices;
    for (auto& [vertex, id] : local) {
      id = static_cast<std::int32_t>(vertices.size());
      vertices.push_back(vertex);
    }
    std::vector<std::int32_t> corners;
    std::vector<double> uv;
    for (const std::size_t f : faces) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto corner = static_cast<std::size_t>(triangles_.corner_of_triangle[3 * f + k]);
        corners.push_back(local[triangles_.mesh.faces[f][k]]);
        uv.insert(uv.end(), {uv_[2 * corner], uv_[2 * corner + 1]});
      }
    }
    const CornerSplit split = SplitCorners(static_cast<std::int64_t>(vertices.size()), corners, uv);
    std::string positions;
    std::array<float, 3> least, most;
    least.fill(std::numeric_limits<float>::infinity());
    most.fill(-std::numeric_limits<float>::infinity());
    for (const std::int32_t source : split.source) {
      const Vec3 p =
          triangles_.mesh.positions[static_cast<std::size_t>(vertices[static_cast<std::size_t>(source)])] - origin_;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float value = static_cast<float>(p[static_cast<int>(axis)]);
        least[axis] = std::min(least[axis], value);
        most[axis] = std::max(most[axis], value);
        AppendFloat(value, &positions);
      }
    }
    std::string texcoords;
    for (const double value : split.uv) AppendFloat(value, &texcoords);
    const bool is_small = split.num_vertices() <= 65535;
    std::string indices;
    for (const std::int32_t index : split.corner) {
      for (int i = 0; i < (is_small ? 2 : 4); ++i) indices.push_back(static_cast<char>(index >> (8 * i) & 0xFF));
    }
    Json primitive;
    primitive["attributes"]["POSITION"] = Accessor(
        positions,
        {{"componentType", 5126}, {"count", split.num_vertices()}, {"type", "VEC3"}, {"min", least}, {"max", most}},
        34962);
    for (int n = 0; n <= texcoord_; ++n) {
      // UV sets must be numbered without gaps: all sets up to the requested one refer to one accessor.
      primitive["attributes"]["TEXCOORD_" + std::to_string(n)] =
          n > 0 ? primitive["attributes"]["TEXCOORD_0"]
                : Json(Accessor(texcoords, {{"componentType", 5126}, {"count", split.num_vertices()}, {"type", "VEC2"}},
                                34962));
    }
    primitive["indices"] = Accessor(
        indices, {{"componentType", is_small ? 5123 : 5125}, {"count", split.corner.size()}, {"type", "SCALAR"}},
        34963);
    if (material >= 0) primitive["material"] = material;
    return primitive;
  }

  std::size_t Accessor(const std::string& bytes, Json shape, int target) {
    Pad(&buffer_);
    shape["bufferView"] = views_.size();
    views_.push_back({{"buffer", 0}, {"byteOffset", buffer_.size()}, {"byteLength", bytes.size()}, {"target", target}});
    buffer_ += bytes;
    accessors_.push_back(std::move(shape));
    return accessors_.size() - 1;
  }

  const PolygonMesh& mesh_;
  const Triangulation triangles_;
  const Vec3 origin_;
  const std::vector<double>& uv_;
  const int texcoord_;
  Json json_;
  Json accessors_ = Json::array();
  Json views_ = Json::array();
  std::string buffer_;
};

}  // namespace

absl::StatusOr<WrittenMesh> PlainGltf(const PolygonMesh& mesh, const std::vector<double>& corner_uv,
                                      const OutputOptions& options, const std::string& base_color) {
  const FlippedUv uv(corner_uv);
  GltfExport gltf(mesh, uv.values(), options.texcoord);
  gltf.Build();
  if (!base_color.empty()) {
    PLANISH_ASSIGN_OR_RETURN(const ImageHeader header, ReadImageHeader(base_color, options.path));
    gltf.ShowImage(base_color, header.has_alpha());
  }
  absl::StatusOr<WrittenMesh> written = GltfFiles(gltf.json(), gltf.buffer(), 2, "", false, options);
  if (written.ok()) uv.Check(gltf.corners(), &written->warnings);
  return written;
}

}  // namespace planish
