#include "client/files/surface_projection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "Eigen/Geometry"
#include "client/files/base_colors.h"
#include "client/files/gltf_accessor.h"
#include "client/files/gltf_attribute.h"
#include "client/files/gltf_bake.h"
#include "client/files/gltf_material.h"
#include "client/files/gltf_mesh.h"
#include "client/files/gltf_patch.h"
#include "client/files/texture_files.h"
#include "client/files/vertex_colors.h"
#include "client/files/writers.h"
#include "client/texture/projection_baker.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

using Rgb = std::array<float, 3>;

// Per vertex the mean of the normals of its faces, weighted by the angles of the faces at the vertex.
std::vector<Vec3> SmoothNormals(const std::vector<Vec3>& positions, const std::vector<Face>& faces) {
  std::vector<Vec3> normals(positions.size(), Vec3::Zero());
  for (const Face& face : faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto vertex = static_cast<std::size_t>(face[k]);
      const Vec3 a = positions[static_cast<std::size_t>(face[(k + 1) % 3])] - positions[vertex];
      const Vec3 b = positions[static_cast<std::size_t>(face[(k + 2) % 3])] - positions[vertex];
      const Vec3 cross = a.cross(b);
      const double area = cross.norm();
      if (area > 0 && std::isfinite(area)) normals[vertex] += std::atan2(area, a.dot(b)) / area * cross;
    }
  }
  return normals;
}

Rgb ToRgb(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

// The surface that is projected: its triangles, normals, colours and images.
struct ProjectedLooks {
  Triangulation triangles;
  ProjectionSource source;
  std::vector<TextureImage> colors, normals;  // decoded; the source refers to them
};

class LooksReader {
 public:
  LooksReader(const MeshFile& file, const OutputOptions& options, ProjectedLooks* looks)
      : file_(file),
        options_(options),
        looks_(*looks),
        corners_(file.mesh.corner_vertex.size()),
        base_colors_(file, options.textures.allow_outside) {}

  absl::Status Read() {
    looks_.triangles = Triangulate(file_.mesh);
    const std::vector<Vec3> smooth = SmoothNormals(looks_.triangles.mesh.positions, looks_.triangles.mesh.faces);
    for (const Face& face : looks_.triangles.mesh.faces) {
      for (const std::int32_t v : face) looks_.source.normals.push_back(ToRgb(smooth[static_cast<std::size_t>(v)]));
    }
    switch (file_.format) {
      case MeshFormat::kGltf:
      case MeshFormat::kGlb:
        PLANISH_RETURN_IF_ERROR(ReadGltfLooks());
        break;
      case MeshFormat::kObj:
        PLANISH_RETURN_IF_ERROR(ReadVertexColors());
        PLANISH_RETURN_IF_ERROR(ReadObjLooks());
        break;
      case MeshFormat::kPly:
        PLANISH_RETURN_IF_ERROR(ReadVertexColors());
        break;
      default:
        break;
    }
    looks_.source.mesh = &looks_.triangles.mesh;
    for (FaceImages* const maps : {&looks_.source.color_maps, &looks_.source.normal_maps}) {
      std::vector<TextureImage>& images = maps == &looks_.source.color_maps ? looks_.colors : looks_.normals;
      for (std::size_t i = 0; i < images.size(); ++i) maps->images[i].image = &images[i];
    }
    return absl::OkStatus();
  }

 private:
  // Maps values per corner of the file to the corners of the triangles.
  template <typename T>
  std::vector<T> OfTriangles(const std::vector<T>& of_corner) const {
    std::vector<T> result;
    for (const std::int64_t corner : looks_.triangles.corner_of_triangle) {
      result.push_back(of_corner[static_cast<std::size_t>(corner)]);
    }
    return result;
  }
  void SetImages(const std::vector<std::int32_t>& of_polygon, const std::vector<Vec2>& of_corner, FaceImages* maps) {
    if (maps->images.empty()) return;
    const std::vector<Vec2> uv = OfTriangles(of_corner);
    for (std::size_t f = 0; f < looks_.triangles.mesh.faces.size(); ++f) {
      maps->of_face.push_back(of_polygon[static_cast<std::size_t>(looks_.triangles.source_polygon[f])]);
      maps->uv.push_back({uv[3 * f], uv[3 * f + 1], uv[3 * f + 2]});
    }
  }
  // Returns its number in `images`, which belong to `maps`.
  absl::StatusOr<std::int32_t> AddImage(const std::string& bytes, const std::string& name, TextureSource source,
                                        FaceImages* maps, std::vector<TextureImage>* images) {
    PLANISH_ASSIGN_OR_RETURN(const ImageHeader header, ReadImageHeader(bytes, name));
    // TextureLevels adds four floats per texel.
    memory_ += header.bytes() + 16 * header.texels();
    if (options_.textures.memory > 0 && memory_ > options_.textures.memory) {
      return MakeError(absl::StatusCode::kResourceExhausted, "TEXTURE_MEMORY",
                       name + ": with the images before it, it takes " + std::to_string(memory_ / 1000000) +
                           " MB of memory, and the limit is " + std::to_string(options_.textures.memory / 1000000) +
                           " MB; --memory raises it",
                       {{"image", name}, {"bytes", std::to_string(memory_)}});
    }
    PLANISH_ASSIGN_OR_RETURN(TextureImage image, DecodeImage(bytes, name));
    images->push_back(std::move(image));
    maps->images.push_back(source);
    return static_cast<std::int32_t>(images->size()) - 1;
  }

  // The index of a base colour's image in the images of the source.
  absl::StatusOr<std::int32_t> ColorImage(const BaseColor& color) {
    const std::tuple key(color.image, color.wrap_u, color.wrap_v, color.nearest);
    const auto known = color_images_.find(key);
    if (known != color_images_.end()) return known->second;
    PLANISH_ASSIGN_OR_RETURN(const std::string bytes, base_colors_.Image(color.image));
    const std::string name =
        file_.gltf ? GltfImageTitle(file_.gltf->document, color.image) : file_.path + ": " + color.image_name;
    PLANISH_ASSIGN_OR_RETURN(color_images_[key],
                             AddImage(bytes, name, {nullptr, nullptr, color.wrap_u, color.wrap_v, color.nearest},
                                      &looks_.source.color_maps, &looks_.colors));
    return color_images_[key];
  }
  const BaseColor& BaseColorOf(std::int64_t material) const {
    static const auto* const none = new BaseColor();
    const std::vector<BaseColor>& all = base_colors_.of_material();
    return material >= 0 && material < std::ssize(all) ? all[static_cast<std::size_t>(material)] : *none;
  }
  static Vec2 Transformed(const std::array<double, 6>& m, const Vec2& p) {
    return {m[0] * p.x() + m[1] * p.y() + m[2], m[3] * p.x() + m[4] * p.y() + m[5]};
  }
  // The UV at the corners of a primitive with which a texture reads its image; empty if the file lacks them.
  absl::StatusOr<std::vector<Vec2>> CornerUvOf(const GltfPrimitive& primitive, int texcoord,
                                               const std::array<double, 6>& transform) const {
    std::vector<Vec2> uv;
    if (texcoord < 0) return uv;
    PLANISH_ASSIGN_OR_RETURN(const std::vector<float> given,
                             ReadVertexAttribute(*file_.gltf, primitive, "TEXCOORD_" + std::to_string(texcoord), 2));
    if (given.empty()) return uv;
    for (auto c = 3 * primitive.first_polygon; c < 3 * (primitive.first_polygon + primitive.num_polygons); ++c) {
      const auto v = 2 * static_cast<std::size_t>(file_.gltf->corner_vertex[static_cast<std::size_t>(c)]);
      uv.push_back(Transformed(transform, Vec2(given[v], given[v + 1])));
    }
    return uv;
  }

  absl::Status ReadGltfLooks() {
    const GltfMesh& gltf = *file_.gltf;
    const Json& root = gltf.document.json;
    std::vector<Rgb> normals(corners_, Rgb{0, 0, 0}), colors(corners_, Rgb{1, 1, 1});
    std::vector<Vec2> uv(corners_, Vec2::Zero());
    std::vector<std::int32_t> image_of(static_cast<std::size_t>(file_.mesh.num_polygons()), -1);
    // The same of normal maps.
    std::vector<Vec2> normal_uv(corners_, Vec2::Zero());
    std::vector<std::array<float, 4>> tangents(corners_, std::array<float, 4>{1, 0, 0, 1});
    std::vector<std::int32_t> normal_map_of(image_of);
    std::map<std::int64_t, std::int32_t> normal_map_of_material;
    bool has_colors = false;
    for (const GltfPrimitive& primitive : gltf.primitives) {
      const auto first = static_cast<std::size_t>(3 * primitive.first_polygon);
      const auto count = static_cast<std::size_t>(3 * primitive.num_polygons);
      const auto at = [first](auto& list) { return list.begin() + static_cast<std::ptrdiff_t>(first); };
      bool are_given = false;
      PLANISH_ASSIGN_OR_RETURN(const std::vector<float> own, CornerNormals(gltf, primitive, &are_given));
      for (std::size_t c = 0; c < count; ++c) normals[first + c] = {own[3 * c], own[3 * c + 1], own[3 * c + 2]};
      has_normals_ |= are_given;
      PLANISH_ASSIGN_OR_RETURN(const std::vector<float> vertex, ReadVertexAttribute(gltf, primitive, "COLOR_0", 3));
      const std::int64_t material = GltfIntAt(PrimitiveJson(root, primitive), "material", -1);
      const BaseColor& color = BaseColorOf(material);
      has_colors |= !vertex.empty() || color.factor != BaseColor().factor;
      for (std::size_t c = 0; c < count; ++c) {
        const auto v = 3 * static_cast<std::size_t>(gltf.corner_vertex[first + c]);
        for (std::size_t k = 0; k < 3; ++k) {
          colors[first + c][k] = static_cast<float>(color.factor[k]) * (vertex.empty() ? 1.0F : vertex[v + k]);
        }
      }
      if (color.image >= 0) {
        PLANISH_ASSIGN_OR_RETURN(const std::vector<Vec2> own_uv,
                                 CornerUvOf(primitive, color.texcoord, color.transform));
        if (!own_uv.empty()) {
          PLANISH_ASSIGN_OR_RETURN(const std::int32_t image, ColorImage(color));
          std::copy(own_uv.begin(), own_uv.end(), at(uv));
          std::fill_n(image_of.begin() + primitive.first_polygon, primitive.num_polygons, image);
        }
      }
      for (const GltfTextureUse& use : TextureUses(root, material)) {
        if (use.slot != "normalTexture") continue;
        PLANISH_ASSIGN_OR_RETURN(const std::vector<Vec2> own_uv, CornerUvOf(primitive, use.texcoord, use.transform));
        const std::vector<GltfTextureSource> sources = TextureSources(root, use.texture);
        if (own_uv.empty() || sources.empty()) continue;
        if (!normal_map_of_material.contains(material)) {
          PLANISH_ASSIGN_OR_RETURN(normal_map_of_material[material], AddNormalMap(use, sources[0].image));
        }
        std::copy(own_uv.begin(), own_uv.end(), at(normal_uv));
        std::fill_n(normal_map_of.begin() + primitive.first_polygon, primitive.num_polygons,
                    normal_map_of_material[material]);
        PLANISH_ASSIGN_OR_RETURN(const std::vector<float> positions,
                                 ReadVertexAttribute(gltf, primitive, "POSITION", 3));
        PLANISH_ASSIGN_OR_RETURN(const auto frames, CornerTangents(gltf, primitive, positions, own, are_given, own_uv));
        std::copy(frames.begin(), frames.end(), at(tangents));
      }
    }
    if (has_normals_) looks_.source.normals = OfTriangles(normals);
    if (has_colors) looks_.source.colors = OfTriangles(colors);
    SetImages(image_of, uv, &looks_.source.color_maps);
    SetImages(normal_map_of, normal_uv, &looks_.source.normal_maps);
    if (!looks_.normals.empty()) {
      looks_.source.tangents = OfTriangles(tangents);
      // Normal maps bend the normals with which tangents go together.
      looks_.source.normals = OfTriangles(normals);
    }
    return absl::OkStatus();
  }

  absl::StatusOr<std::int32_t> AddNormalMap(const GltfTextureUse& use, std::int64_t image) {
    const GltfDocument& document = file_.gltf->document;
    PLANISH_ASSIGN_OR_RETURN(const std::string bytes, GltfImageBytes(document, image, options_.textures.allow_outside));
    const auto [wrap_u, wrap_v] = TextureWraps(document.json, use.texture);
    looks_.source.normal_scales.push_back(use.normal_scale);
    return AddImage(bytes, GltfImageTitle(document, image), {nullptr, nullptr, wrap_u, wrap_v},
                    &looks_.source.normal_maps, &looks_.normals);
  }

  absl::Status ReadObjLooks() {
    const PolygonMesh& mesh = file_.mesh;
    if (mesh.polygon_material.empty() || mesh.corner_texcoord.empty()) return absl::OkStatus();
    std::vector<std::int32_t> image_of;
    std::vector<Vec2> uv(corners_, Vec2::Zero());
    for (std::int64_t p = 0; p < mesh.num_polygons(); ++p) {
      const BaseColor& color = BaseColorOf(mesh.polygon_material[static_cast<std::size_t>(p)]);
      image_of.push_back(-1);
      if (color.image < 0) continue;
      PLANISH_ASSIGN_OR_RETURN(image_of.back(), ColorImage(color));
      for (auto c = static_cast<std::size_t>(mesh.polygon_begin[static_cast<std::size_t>(p)]);
           c < static_cast<std::size_t>(mesh.polygon_begin[static_cast<std::size_t>(p) + 1]); ++c) {
        const std::int32_t texcoord = mesh.corner_texcoord[c];
        if (texcoord < 0) continue;
        const Vec2& value = mesh.texcoords[static_cast<std::size_t>(texcoord)];
        uv[c] = Transformed(color.transform, Vec2(value.x(), 1 - value.y()));
      }
    }
    SetImages(image_of, uv, &looks_.source.color_maps);
    return absl::OkStatus();
  }

  // Reads the vertex colours. They are multiplied with the images, or stand alone if the file has no images.
  absl::Status ReadVertexColors() {
    PLANISH_ASSIGN_OR_RETURN(const std::vector<CornerColor> own, VertexColors(file_));
    if (own.empty()) return absl::OkStatus();
    std::vector<Rgb> colors;
    for (const CornerColor& color : own) colors.push_back({color[0], color[1], color[2]});
    looks_.source.colors = OfTriangles(colors);
    return absl::OkStatus();
  }

  const MeshFile& file_;
  const OutputOptions& options_;
  ProjectedLooks& looks_;
  const std::size_t corners_;
  const BaseColorReader base_colors_;
  std::map<std::tuple<std::int64_t, TextureWrap, TextureWrap, bool>, std::int32_t> color_images_;
  bool has_normals_ = false;
  std::int64_t memory_ = 0;
};

// The texture of the material that shows an image.
const char* SlotOf(const std::string& name) {
  return name == "colors" ? "baseColorTexture" : name == "normals" ? "normalTexture" : "occlusionTexture";
}

std::string OnePixel(const std::array<std::uint8_t, 3>& rgb) {
  TextureImage image;
  image.header = {ImageKind::kPng, 1, 1, 3, 8};
  image.texels.assign(rgb.begin(), rgb.end());
  return EncodeImage(image).value_or("");
}

std::vector<double> CornerUv(const PolygonMesh& mesh) {
  std::vector<double> uv;
  for (const std::int32_t id : mesh.corner_texcoord) {
    const Vec2 value = id < 0 ? Vec2(0, 0) : mesh.texcoords[static_cast<std::size_t>(id)];
    uv.insert(uv.end(), {value.x(), value.y()});
  }
  return uv;
}

// `to` as a GLB whose only material has images of the given names, of one texel each; with normals and tangents. One is
// "normals": writing the file with its own UV, images moving, makes tangents and splits vertices for them.
absl::StatusOr<MeshFile> WithPlaceholders(const MeshFile& to, const std::vector<std::string>& names) {
  OutputOptions options;
  options.format = MeshFormat::kGlb;
  options.path = "projected.glb";
  PLANISH_ASSIGN_OR_RETURN(WrittenMesh written, WriteMeshWithUv(to, CornerUv(to.mesh), options));
  PLANISH_ASSIGN_OR_RETURN(const MeshFile plain,
                           ReadMeshBytes(options.path, MeshFormat::kGlb, std::move(written.files.back().bytes)));
  const GltfMesh& gltf = *plain.gltf;
  GltfPatch patch(gltf.document);
  // Smooth across seams: ReadMeshBytes() has merged the vertices at the same position.
  std::vector<Face> own;
  for (std::size_t c = 0; c < plain.mesh.corner_vertex.size(); c += 3) {
    own.push_back({plain.mesh.corner_vertex[c], plain.mesh.corner_vertex[c + 1], plain.mesh.corner_vertex[c + 2]});
  }
  const std::vector<Vec3> smooth = SmoothNormals(plain.mesh.positions, own);
  std::map<std::size_t, std::int64_t> normals_of_pool;
  for (const GltfPrimitive& primitive : gltf.primitives) {
    Json& json = PrimitiveJson(patch.json(), primitive);
    json["material"] = 0;
    if (json["attributes"].contains("NORMAL")) continue;
    if (!normals_of_pool.contains(primitive.pool)) {
      std::vector<float> normals(3 * static_cast<std::size_t>(gltf.pools[primitive.pool].num_vertices), 0);
      for (const GltfPrimitive& user : gltf.primitives) {
        if (user.pool != primitive.pool) continue;
        for (auto c = 3 * user.first_polygon; c < 3 * (user.first_polygon + user.num_polygons); ++c) {
          const auto corner = static_cast<std::size_t>(c);
          Vec3 normal = smooth[static_cast<std::size_t>(plain.mesh.corner_vertex[corner])];
          normal = normal.norm() > 0 ? Vec3(normal.normalized()) : Vec3(0, 0, 1);
          for (std::size_t k = 0; k < 3; ++k) {
            normals[3 * static_cast<std::size_t>(gltf.corner_vertex[corner]) + k] =
                static_cast<float>(normal[static_cast<int>(k)]);
          }
        }
      }
      for (std::size_t v = 0; v < normals.size(); v += 3) {
        if (normals[v] == 0 && normals[v + 1] == 0 && normals[v + 2] == 0) normals[v + 2] = 1;
      }
      const Json shape = {{"componentType", 5126}, {"count", normals.size() / 3}, {"type", "VEC3"}};
      const std::string bytes(reinterpret_cast<const char*>(normals.data()), normals.size() * sizeof(float));
      normals_of_pool[primitive.pool] = patch.Replace(-1, 1, shape, bytes, 0, 34962);
    }
    PrimitiveJson(patch.json(), primitive)["attributes"]["NORMAL"] = normals_of_pool[primitive.pool];
  }
  Json& root = patch.json();
  for (const char* gone : {"textures", "images", "samplers"}) root.erase(gone);
  Json material = {{"name", "projected"}, {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0.8}}}};
  root["images"] = Json::array();
  root["textures"] = Json::array();
  for (const std::string& name : names) {
    const bool is_normal = name == "normals";
    const std::int64_t view = patch.AddView(
        -1, OnePixel(is_normal ? std::array<std::uint8_t, 3>{128, 128, 255} : std::array<std::uint8_t, 3>{}), 0, 0);
    Json& holder = name == "colors" ? material["pbrMetallicRoughness"] : material;
    holder[SlotOf(name)] = {{"index", root["textures"].size()}};
    root["textures"].push_back({{"source", root["images"].size()}});
    root["images"].push_back({{"name", name}, {"bufferView", view}, {"mimeType", "image/png"}});
  }
  root["materials"] = Json::array({std::move(material)});
  std::string buffer = patch.TakeBuffer();
  PLANISH_ASSIGN_OR_RETURN(std::string glb, GlbBytes(patch.json(), std::move(buffer), ""));
  PLANISH_ASSIGN_OR_RETURN(const MeshFile file, ReadMeshBytes(options.path, MeshFormat::kGlb, std::move(glb)));
  options.textures.mode = TextureMode::kTransfer;
  options.textures.size = 1;
  // Its polygons are triangles.
  PLANISH_ASSIGN_OR_RETURN(written, WriteMeshWithUv(file, CornerUv(file.mesh), options));
  return ReadMeshBytes(options.path, MeshFormat::kGlb, std::move(written.files.back().bytes));
}

absl::StatusOr<ProjectionTarget> TargetOf(const MeshFile& file) {
  const GltfMesh& gltf = *file.gltf;
  ProjectionTarget target;
  for (const GltfPrimitive& primitive : gltf.primitives) {
    PLANISH_ASSIGN_OR_RETURN(const std::vector<float> normals, ReadVertexAttribute(gltf, primitive, "NORMAL", 3));
    PLANISH_ASSIGN_OR_RETURN(const std::vector<float> tangents, ReadVertexAttribute(gltf, primitive, "TANGENT", 4));
    if (normals.empty() || tangents.empty()) return InternalError("a projected primitive has no tangents");
    const auto first = static_cast<std::size_t>(3 * primitive.first_polygon);
    const auto count = static_cast<std::size_t>(3 * primitive.num_polygons);
    for (std::size_t c = first; c < first + count; c += 3) {
      std::array<Vec3, 3> positions;
      std::array<Vec2, 3> uv;
      std::array<std::array<float, 3>, 3> normal;
      std::array<std::array<float, 4>, 3> tangent;
      for (std::size_t k = 0; k < 3; ++k) {
        positions[k] = file.mesh.positions[static_cast<std::size_t>(file.mesh.corner_vertex[c + k])];
        const std::int32_t id = file.mesh.corner_texcoord[c + k];
        const Vec2 value = id < 0 ? Vec2(0, 0) : file.mesh.texcoords[static_cast<std::size_t>(id)];
        uv[k] = Vec2(value.x(), 1 - value.y());
        const auto v = static_cast<std::size_t>(gltf.corner_vertex[c + k]);
        normal[k] = {normals[3 * v], normals[3 * v + 1], normals[3 * v + 2]};
        tangent[k] = {tangents[4 * v], tangents[4 * v + 1], tangents[4 * v + 2], tangents[4 * v + 3]};
      }
      target.positions.push_back(positions);
      target.uv.push_back(uv);
      target.normals.push_back(normal);
      target.tangents.push_back(tangent);
    }
  }
  return target;
}

double DiagonalOf(const std::vector<Vec3>& positions) {
  Vec3 low = Vec3::Constant(1e300), high = -low;
  for (const Vec3& p : positions) {
    if (!p.allFinite()) continue;
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return positions.empty() ? 0 : (high - low).norm();
}

}  // namespace

absl::StatusOr<ProjectedMesh> ProjectSurface(const MeshFile& from, const MeshFile& to, const OutputOptions& options,
                                             const SurfaceProjectionOptions& projection) {
  if (options.format != MeshFormat::kGlb && options.format != MeshFormat::kGltf) {
    return MakeError(absl::StatusCode::kInvalidArgument, "OUTPUT_UNSUPPORTED",
                     options.path + ": projected images go into a .glb or .gltf");
  }
  if (to.mesh.corner_texcoord.empty()) {
    return MakeError(absl::StatusCode::kInvalidArgument, "UV_MISSING",
                     to.path + ": has no UV, and they are where the images go");
  }
  if (projection.height && options.path == "-") {
    return MakeError(absl::StatusCode::kInvalidArgument, "OUTPUT_UNSUPPORTED",
                     "the heights become a file beside the output, and there is none beside stdout");
  }
  const std::int64_t texels = std::int64_t{projection.size} * projection.size;
  const std::int64_t memory = texels * (8 + (projection.height ? 6 : 0) + (projection.occlusion ? 1 : 0));
  if (options.textures.memory > 0 && memory > options.textures.memory) {
    return MakeError(absl::StatusCode::kResourceExhausted, "TEXTURE_MEMORY",
                     "images of " + std::to_string(projection.size) + " texels per side take " +
                         std::to_string(memory / 1000000) +
                         " MB of memory; --texture-size makes them smaller, --memory raises the limit");
  }
  ProjectedLooks looks;
  PLANISH_RETURN_IF_ERROR(LooksReader(from, options, &looks).Read());
  if (!projection.colors) {
    looks.source.colors.clear();
    looks.source.color_maps = FaceImages();
  }
  const bool has_colors = looks.source.has_colors();
  std::vector<std::string> names = {"normals"};
  if (has_colors) names.push_back("colors");
  if (projection.occlusion) names.push_back("occlusion");
  PLANISH_ASSIGN_OR_RETURN(const MeshFile prepared, WithPlaceholders(to, names));
  PLANISH_ASSIGN_OR_RETURN(ProjectionTarget target, TargetOf(prepared));
  if (!to.gltf) {
    // A mesh far from the origin was moved there, by its node.
    const Json& root = prepared.gltf->document.json;
    Vec3 origin = Vec3::Zero();
    for (int axis = 0; axis < 3; ++axis) {
      origin[axis] = GltfNumberAt(root, Json::json_pointer("/nodes/0/translation") / static_cast<std::size_t>(axis), 0);
    }
    for (std::array<Vec3, 3>& corners : target.positions) {
      for (Vec3& corner : corners) corner += origin;
    }
  }
  ProjectionOptions how;
  how.reach = projection.cage * DiagonalOf(prepared.mesh.positions);
  how.size = projection.size;
  how.height = projection.height;
  how.occlusion = projection.occlusion;
  how.occlusion_reach = projection.occlusion_reach;
  how.stop = options.textures.stop;
  ThreadTeam team(std::max(1, options.textures.threads));
  PLANISH_ASSIGN_OR_RETURN(Projection drawn, Project(looks.source, target, how, &team));
  ProjectedMesh result;
  result.texels = drawn.texels;
  result.missed = drawn.missed;
  GltfPatch patch(prepared.gltf->document);
  for (Json& image : patch.json()["images"]) {
    TextureImage& pixels = image["name"] == "normals"  ? drawn.normal
                           : image["name"] == "colors" ? drawn.color
                                                       : drawn.occlusion;
    PLANISH_ASSIGN_OR_RETURN(std::string png, EncodeImage(pixels));
    pixels.texels = std::vector<std::uint8_t>();
    image["bufferView"] = patch.AddView(image["bufferView"].get<std::int64_t>(), std::move(png), 0, 0);
  }
  if (!projection.normals) {
    names.erase(names.begin());
    Json& material = patch.json()["materials"][0];
    const std::int64_t texture = material["normalTexture"]["index"].get<std::int64_t>();
    material.erase("normalTexture");
    RemoveUnreadTextures({texture}, &patch);
  }
  std::string buffer = patch.TakeBuffer();
  PLANISH_ASSIGN_OR_RETURN(result.written,
                           GltfFiles(std::move(patch.json()), std::move(buffer), 2, "", false, options));
  if (projection.height) {
    names.push_back("height");
    PLANISH_ASSIGN_OR_RETURN(std::string png, EncodeImage(drawn.height));
    TextureFileNames files(options.path, {from.path, to.path, options.path});
    result.height = HeightImage{files.Next("height", ImageKind::kPng), drawn.low, drawn.high};
    result.written.files.insert(result.written.files.begin(), OutputFile{result.height->path, std::move(png)});
  }
  result.baked = std::move(names);
  return result;
}

}  // namespace planish
