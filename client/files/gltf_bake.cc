#include "client/files/gltf_bake.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "Eigen/Geometry"
#include "client/files/gltf_attribute.h"
#include "client/texture/tangents.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {

bool IsDirection(const GltfTextureUse& use) {
  return use.meaning == TextureMeaning::kNormal || use.meaning == TextureMeaning::kDirection;
}

void ForgetExtension(Json* root, const char* name) {
  const auto is_used = [name](const auto& self, const Json& value) -> bool {
    if (!value.is_structured()) return false;
    for (const auto& [key, child] : value.items()) {
      if (key == name || self(self, child)) return true;
    }
    return false;
  };
  if (is_used(is_used, *root)) return;
  for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
    const auto names = root->find(list);
    if (names == root->end() || !names->is_array()) continue;
    Json left = Json::array();
    for (const Json& each : *names) {
      if (each != name) left.push_back(each);
    }
    if (left.empty()) {
      root->erase(list);
    } else {
      *names = std::move(left);
    }
  }
}

std::vector<std::string> FilesOfGltf(const GltfMesh& gltf) {
  std::vector<std::string> files = {gltf.document.path};
  const auto images = gltf.document.json.find("images");
  if (images == gltf.document.json.end()) return files;
  for (const Json& image : *images) {
    if (!image.contains("uri") || !image["uri"].is_string()) continue;
    const absl::StatusOr<std::string> file = FileOfUri(gltf.document, "", image["uri"].get<std::string>());
    if (file.ok()) files.push_back((std::filesystem::path(gltf.document.path).parent_path() / *file).string());
  }
  return files;
}

absl::Status CheckGltfTextures(const GltfMesh& gltf, const OutputOptions& options, std::int64_t material,
                               const std::vector<GltfTextureUse>& uses, std::set<std::int64_t>* seen) {
  const Json& root = gltf.document.json;
  if (!uses.empty() && IsAnimated(root, material, "KHR_texture_transform")) {
    return MakeError(absl::StatusCode::kInvalidArgument, "TEXTURE_ANIMATED",
                     options.path + ": an animation moves the textures of material " +
                         GltfName(root["materials"][static_cast<std::size_t>(material)], "material", material) +
                         ", so they cannot become part of an atlas; --textures=keep leaves them as they are");
  }
  for (const GltfTextureUse& use : uses) {
    for (const GltfTextureSource& source : TextureSources(root, use.texture)) {
      if (!seen->insert(source.image).second) continue;
      const std::string name = GltfImageTitle(gltf.document, source.image);
      const absl::StatusOr<std::string> bytes =
          GltfImageBytes(gltf.document, source.image, options.textures.allow_outside);
      if (!bytes.ok()) return WithTextureAdvice(bytes.status());
      const absl::StatusOr<ImageHeader> header = ReadImageHeader(*bytes, name);
      if (!header.ok()) return WithTextureAdvice(header.status());
    }
  }
  return absl::OkStatus();
}

TextureBake BakeOfGltfTexture(const GltfMesh& gltf, const GltfTextureUse& use, std::int64_t image) {
  constexpr std::int64_t kNearestFilter = 9728;
  const Json& root = gltf.document.json;
  TextureBake bake;
  bake.name = GltfImageTitle(gltf.document, image);
  const auto [wrap_u, wrap_v] = TextureWraps(root, use.texture);
  bake.wrap_u = wrap_u;
  bake.wrap_v = wrap_v;
  const Json* const sampler = SamplerOfTexture(root, use.texture);
  bake.nearest = sampler != nullptr && GltfIntAt(*sampler, "magFilter", 0) == kNearestFilter;
  bake.options = {use.meaning, use.has_alpha, use.normal_scale};
  return bake;
}

absl::StatusOr<std::vector<std::array<float, 4>>> CornerTangents(const GltfMesh& gltf, const GltfPrimitive& primitive,
                                                                 const std::vector<float>& positions,
                                                                 const std::vector<float>& normals,
                                                                 bool normals_are_given, const std::vector<Vec2>& uv) {
  const auto first = static_cast<std::size_t>(3 * primitive.first_polygon);
  std::vector<float> given;
  if (normals_are_given) {
    PLANISH_ASSIGN_OR_RETURN(given, ReadVertexAttribute(gltf, primitive, "TANGENT", 4));
  }
  if (given.empty()) {
    TangentCorners corners;
    for (std::size_t c = 0; c < uv.size(); ++c) {
      const auto v = 3 * static_cast<std::size_t>(gltf.corner_vertex[first + c]);
      corners.positions.push_back({positions[v], positions[v + 1], positions[v + 2]});
      corners.normals.push_back({normals[3 * c], normals[3 * c + 1], normals[3 * c + 2]});
      corners.uv.push_back({static_cast<float>(uv[c].x()), static_cast<float>(1 - uv[c].y())});
    }
    return ComputeTangents(corners);
  }
  std::vector<std::array<float, 4>> tangents(uv.size());
  for (std::size_t c = 0; c < uv.size(); ++c) {
    const auto v = 4 * static_cast<std::size_t>(gltf.corner_vertex[first + c]);
    tangents[c] = {given[v], given[v + 1], given[v + 2], given[v + 3]};
  }
  return tangents;
}

absl::Status AddGltfTriangles(const GltfOutput& output, std::size_t p, const GltfTextureUse* use, TextureBake* bake) {
  const GltfMesh& gltf = output.gltf;
  const std::vector<double>& uv = output.uv;
  const GltfPrimitive& primitive = gltf.primitives[p];
  PLANISH_ASSIGN_OR_RETURN(const std::vector<float> positions, ReadVertexAttribute(gltf, primitive, "POSITION", 3));
  std::vector<float> old;
  if (use != nullptr && use->texcoord >= 0) {
    PLANISH_ASSIGN_OR_RETURN(old, ReadVertexAttribute(gltf, primitive, "TEXCOORD_" + std::to_string(use->texcoord), 2));
  }
  const auto first = static_cast<std::size_t>(3 * primitive.first_polygon);
  const auto count = static_cast<std::size_t>(3 * primitive.num_polygons);
  const std::array<double, 6> m = use == nullptr ? GltfTextureUse().transform : use->transform;
  Vec2 low(HUGE_VAL, HUGE_VAL), high(-HUGE_VAL, -HUGE_VAL);
  std::vector<Vec2> from(count);
  for (std::size_t c = 0; c < count; ++c) {
    const auto v = static_cast<std::size_t>(gltf.corner_vertex[first + c]);
    const Vec2 raw = old.empty() ? Vec2(0, 0) : Vec2(old[2 * v], old[2 * v + 1]);
    from[c] = Vec2(m[0] * raw.x() + m[1] * raw.y() + m[2], m[3] * raw.x() + m[4] * raw.y() + m[5]);
    const Vec2 to(uv[2 * (first + c)], uv[2 * (first + c) + 1]);
    low = low.cwiseMin(to);
    high = high.cwiseMax(to);
  }
  // The tile in which the middle of the primitive's bounding box lies.
  const Vec2 tile(std::floor(0.5 * (low.x() + high.x())), std::floor(0.5 * (low.y() + high.y())));
  if (count > 0 && ((low - tile).minCoeff() < -0.01 || (high - tile).maxCoeff() > 1.01)) {
    return MakeError(absl::StatusCode::kInvalidArgument, "OPTIONS_INVALID",
                     output.options.path + ": meshes[" + std::to_string(primitive.mesh) + "].primitives[" +
                         std::to_string(primitive.primitive) +
                         "] lies in several tiles, and a material has one image for all of it; use --tiles=1, or "
                         "--textures=keep");
  }
  for (std::size_t c = 0; c < count; c += 3) {
    TextureTriangle triangle;
    Vec3 p3[3];
    for (std::size_t k = 0; k < 3; ++k) {
      triangle.from[k] = from[c + k];
      triangle.to[k] = Vec2(uv[2 * (first + c + k)], uv[2 * (first + c + k) + 1]) - tile;
      const auto v = 3 * static_cast<std::size_t>(gltf.corner_vertex[first + c + k]);
      p3[k] = Vec3(positions[v], positions[v + 1], positions[v + 2]);
    }
    const Vec3 a = p3[1] - p3[0], b = p3[2] - p3[0];
    bake->areas.push_back(std::sqrt(std::max(0.0, a.squaredNorm() * b.squaredNorm() - a.dot(b) * a.dot(b))) / 2);
    bake->triangles.push_back(triangle);
  }
  if (use == nullptr || !IsDirection(*use) || output.tangents.empty()) return absl::OkStatus();

  bool normals_are_given = false;
  PLANISH_ASSIGN_OR_RETURN(const std::vector<float> normals, CornerNormals(gltf, primitive, &normals_are_given));
  PLANISH_ASSIGN_OR_RETURN(const auto before,
                           CornerTangents(gltf, primitive, positions, normals, normals_are_given, from));
  for (std::size_t c = 0; c < count; ++c) {
    bake->frames.push_back(
        {{normals[3 * c], normals[3 * c + 1], normals[3 * c + 2]}, before[c], output.tangents[first + c]});
  }
  return absl::OkStatus();
}

}  // namespace planish
