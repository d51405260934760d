#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <map>
#include <set>

#include "client/files/draco_uv.h"
#include "client/files/gltf_attribute.h"
#include "client/files/gltf_document.h"
#include "client/files/gltf_join.h"
#include "client/files/gltf_material.h"
#include "client/files/gltf_mesh.h"
#include "client/files/gltf_patch.h"
#include "client/files/gltf_textures.h"
#include "client/files/writers.h"
#include "client/texture/tangents.h"
#include "core/base/corner_split.h"
#include "core/base/status_macros.h"
#include "core/mesh/predicates.h"

namespace planish {
namespace {

constexpr std::int64_t kArrayBuffer = 34962;
constexpr std::int64_t kElementArrayBuffer = 34963;
constexpr char kTangent[] = "TANGENT";
constexpr char kVertexColors[] = "COLOR_0";
constexpr std::int64_t kLargestUshortIndex = 65534;  // 65535 restarts strips

std::int64_t AlignedToFour(std::int64_t size) {
  return (size + 3) / 4 * 4;
}

std::string FloatBytes(const std::vector<double>& values) {
  std::string bytes(values.size() * sizeof(float), '\0');
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float value = static_cast<float>(values[i]);
    std::memcpy(bytes.data() + i * sizeof(float), &value, sizeof(float));
  }
  return bytes;
}

class GltfUvWriter {
 public:
  GltfUvWriter(const GltfMesh& gltf, const std::vector<double>& uv, const OutputOptions& options)
      : gltf_(gltf),
        uv_(uv),
        options_(options),
        uv_name_("TEXCOORD_" + std::to_string(options.texcoord)),
        textures_(gltf, options),
        patch_(gltf.document) {}

  absl::StatusOr<WrittenMesh> Write() {
    std::vector<std::vector<std::size_t>> users(gltf_.pools.size());
    for (std::size_t i = 0; i < gltf_.primitives.size(); ++i) users[gltf_.primitives[i].pool].push_back(i);
    for (std::size_t pool = 0; pool < users.size(); ++pool) {
      PLANISH_RETURN_IF_ERROR(WritePool(gltf_.pools[pool], users[pool]));
    }
    WrittenMesh moved;
    MoveImages(&patch_.json());
    if (options_.textures.mode == TextureMode::kTransfer) {
      PLANISH_RETURN_IF_ERROR(textures_.Move(uv_, tangents_, &patch_, &moved));
    } else if (options_.textures.mode == TextureMode::kDrop) {
      textures_.Drop(&patch_, &moved.warnings);
    }
    std::string buffer = patch_.TakeBuffer();
    if (options_.textures.mode == TextureMode::kTransfer && options_.textures.merge_materials) {
      PLANISH_RETURN_IF_ERROR(JoinPrimitives(gltf_.document.path, &patch_.json(), &buffer));
    }
    Json& json = patch_.json();
    const Json& buffers = GltfArray(gltf_.document, "buffers");
    const bool had_file =
        !buffers.empty() && buffers[0].contains("uri") && !IsDataUri(buffers[0]["uri"].get_ref<const std::string&>());
    PLANISH_ASSIGN_OR_RETURN(WrittenMesh written, GltfFiles(std::move(json), std::move(buffer), gltf_.document.indent,
                                                            gltf_.document.other_chunks, had_file, options_));
    written.files.insert(written.files.begin(), std::make_move_iterator(moved.files.begin()),
                         std::make_move_iterator(moved.files.end()));
    written.warnings = Warnings();
    written.warnings.insert(written.warnings.end(), moved.warnings.begin(), moved.warnings.end());
    return written;
  }

 private:
  absl::Status WritePool(const GltfPool& pool, const std::vector<std::size_t>& users) {
    std::vector<std::int32_t> corners;
    std::vector<double> uv;
    for (const std::size_t user : users) {
      const GltfPrimitive& primitive = gltf_.primitives[user];
      const std::int64_t begin = 3 * primitive.first_polygon;
      const std::int64_t end = begin + 3 * primitive.num_polygons;
      corners.insert(corners.end(), gltf_.corner_vertex.begin() + begin, gltf_.corner_vertex.begin() + end);
      uv.insert(uv.end(), uv_.begin() + 2 * begin, uv_.begin() + 2 * end);
    }
    CornerSplit split = SplitCorners(pool.num_vertices, corners, uv, pool.draco.has_value());
    const bool writes_tangents =
        options_.textures.mode == TextureMode::kTransfer &&
        std::any_of(users.begin(), users.end(), [this](std::size_t user) { return textures_.NeedsTangents(user); });
    std::vector<double> tangents;  // four for each vertex of the split
    if (writes_tangents) {
      PLANISH_ASSIGN_OR_RETURN(tangents, SplitByTangents(users, pool.draco.has_value(), &split));
    }
    const bool grows = split.has_copies;

    Json before = PrimitiveJson(gltf_.document.json, gltf_.primitives[users[0]]);
    for (const std::size_t user : users) NoteTextures(gltf_.primitives[user]);
    // Tangents belong to the UV set of the normal map, or to set 0 if there is no normal map.
    const bool drops_tangents = writes_tangents || std::any_of(users.begin(), users.end(), [this](std::size_t user) {
                                  return TangentTexcoord(gltf_.primitives[user]) == options_.texcoord;
                                });
    if (drops_tangents) {
      DropTangents(static_cast<std::int64_t>(users.size()), pool.draco.has_value(), !tangents.empty(), &before);
    }
    const Json* const draco = DracoJson(before);
    const Json* const in_draco = draco == nullptr ? nullptr : GltfObject(*draco, "attributes");
    Json attributes = before["attributes"];
    const std::int64_t old_uv = attributes.contains(uv_name_) ? attributes[uv_name_].get<std::int64_t>() : -1;
    Json uv_shape = {{"componentType", 5126}, {"count", split.num_vertices()}, {"type", "VEC2"}};
    const std::int64_t num_users = static_cast<std::int64_t>(users.size());
    const std::vector<std::string> filled = MissingTexcoords(attributes);
    if (!filled.empty()) filled_texcoords_ += num_users;
    // TEXCOORD first, so that it gets its old slot; then attributes that grow with the vertices.
    attributes[uv_name_] = pool.draco
                               ? patch_.ReplaceWithoutBytes(old_uv, num_users, uv_shape)
                               : patch_.Replace(old_uv, num_users, uv_shape, FloatBytes(split.uv), 0, kArrayBuffer);
    for (auto& [name, index] : attributes.items()) {
      if (name == uv_name_) continue;
      const bool is_in_draco = in_draco != nullptr && in_draco->contains(name);
      if (is_in_draco) {
        index = WithoutBytes(index, split.num_vertices(), num_users);
      } else if (grows) {
        PLANISH_ASSIGN_OR_RETURN(index, Grown(index, split, num_users));
      }
    }
    Json targets = before.contains("targets") ? before["targets"] : Json();
    if (grows && targets.is_array()) {
      for (Json& target : targets) {
        for (auto& [name, index] : target.items()) {
          PLANISH_ASSIGN_OR_RETURN(index, Grown(index, split, num_users));
        }
      }
    }

    if (!tangents.empty()) {
      const Json shape = {{"componentType", 5126}, {"count", split.num_vertices()}, {"type", "VEC4"}};
      attributes[kTangent] = patch_.Replace(-1, num_users, shape, FloatBytes(tangents), 0, kArrayBuffer);
    }

    if (!filled.empty()) {
      const std::int64_t uses = num_users * std::ssize(filled);
      const std::int64_t same = patch_.Replace(-1, uses, uv_shape, FloatBytes(split.uv), 0, kArrayBuffer);
      for (const std::string& name : filled) attributes[name] = same;
    }

    std::size_t corner = 0;
    for (const std::size_t user : users) {
      const GltfPrimitive& primitive = gltf_.primitives[user];
      Json& json = PrimitiveJson(patch_.json(), primitive);
      json["attributes"] = attributes;
      if (options_.textures.mode == TextureMode::kTransfer && textures_.BakesColors(user)) DropColors(&json);
      if (targets.is_array()) json["targets"] = targets;
      const std::size_t count = 3 * static_cast<std::size_t>(primitive.num_polygons);
      const std::vector<std::int32_t> indices(split.corner.begin() + static_cast<std::ptrdiff_t>(corner),
                                              split.corner.begin() + static_cast<std::ptrdiff_t>(corner + count));
      corner += count;
      if (pool.draco) {
        PLANISH_RETURN_IF_ERROR(WriteDracoPrimitive(split, indices, drops_tangents, &json));
      } else if (grows) {
        WriteIndices(indices, split.num_vertices(), &json);
      }
    }
    return absl::OkStatus();
  }

  // The sets of UV below the new one that a primitive lacks; none unless they are to be filled.
  std::vector<std::string> MissingTexcoords(const Json& attributes) const {
    std::vector<std::string> names;
    for (int n = 0; n < options_.texcoord && options_.fills_texcoords; ++n) {
      const std::string name = "TEXCOORD_" + std::to_string(n);
      if (!attributes.contains(name)) names.push_back(name);
    }
    return names;
  }

  // Computes the tangents of the users' corners for the new UV, and splits vertices with several tangents. Returns four
  // numbers per vertex; none if a user has no normals, because renderers then compute flat normals and their tangents.
  absl::StatusOr<std::vector<double>> SplitByTangents(const std::vector<std::size_t>& users, bool is_draco,
                                                      CornerSplit* split) {
    TangentCorners corners;
    bool all_have_normals = true;
    std::vector<std::size_t> numbers;  // per corner: its index among the corners of all primitives
    for (const std::size_t user : users) {
      const GltfPrimitive& primitive = gltf_.primitives[user];
      bool are_given = false;
      PLANISH_ASSIGN_OR_RETURN(const std::vector<float> normals, CornerNormals(gltf_, primitive, &are_given));
      PLANISH_ASSIGN_OR_RETURN(const std::vector<float> positions,
                               ReadVertexAttribute(gltf_, primitive, "POSITION", 3));
      all_have_normals &= are_given;
      const auto first = static_cast<std::size_t>(3 * primitive.first_polygon);
      for (std::size_t c = 0; c < normals.size() / 3; ++c) {
        const auto v = 3 * static_cast<std::size_t>(gltf_.corner_vertex[first + c]);
        corners.positions.push_back({positions[v], positions[v + 1], positions[v + 2]});
        corners.normals.push_back({normals[3 * c], normals[3 * c + 1], normals[3 * c + 2]});
        corners.uv.push_back(
            {static_cast<float>(uv_[2 * (first + c)]), static_cast<float>(1 - uv_[2 * (first + c) + 1])});
        numbers.push_back(first + c);
      }
    }
    const std::vector<std::array<float, 4>> tangents = ComputeTangents(corners);
    if (tangents_.empty()) tangents_.resize(gltf_.corner_vertex.size(), {1, 0, 0, 1});
    for (std::size_t c = 0; c < numbers.size(); ++c) tangents_[numbers[c]] = tangents[c];
    if (!all_have_normals) return std::vector<double>();
    // SplitCorners() compares UV, so the id of a corner's tangent stands in for its UV.
    std::map<std::array<float, 4>, double> ids;
    std::vector<double> id_of_corner;
    for (const std::array<float, 4>& tangent : tangents) {
      id_of_corner.insert(id_of_corner.end(), {ids.emplace(tangent, static_cast<double>(ids.size())).first->second, 0});
    }
    const CornerSplit again = SplitCorners(split->num_vertices(), split->corner, id_of_corner, is_draco);
    CornerSplit both;
    both.corner = again.corner;
    both.has_copies = split->has_copies || again.has_copies;
    for (const std::int32_t source : again.source) {
      const auto s = static_cast<std::size_t>(source);
      both.source.push_back(split->source[s]);
      both.uv.insert(both.uv.end(), {split->uv[2 * s], split->uv[2 * s + 1]});
    }
    *split = std::move(both);
    std::vector<double> of_vertex(4 * split->source.size(), 0);
    for (std::size_t v = 0; v < split->source.size(); ++v) of_vertex[4 * v] = of_vertex[4 * v + 3] = 1;
    for (std::size_t c = 0; c < tangents.size(); ++c) {
      for (std::size_t i = 0; i < 4; ++i)
        of_vertex[4 * static_cast<std::size_t>(split->corner[c]) + i] = tangents[c][i];
    }
    return of_vertex;
  }

  // Replaces accessor `index` by one with a value for each vertex of the split, and returns the index of that.
  absl::StatusOr<std::int64_t> Grown(const Json& index, const CornerSplit& split, std::int64_t uses) {
    const std::int64_t old = index.get<std::int64_t>();
    PLANISH_ASSIGN_OR_RETURN(const GltfAccessor accessor, OpenAccessor(gltf_.document, old));
    const std::string values = accessor.DenseBytes();
    const std::int64_t size = accessor.element_size;
    const std::int64_t stride = AlignedToFour(size);
    std::string bytes(static_cast<std::size_t>(stride * split.num_vertices()), '\0');
    for (std::size_t v = 0; v < split.source.size(); ++v) {
      std::memcpy(bytes.data() + static_cast<std::int64_t>(v) * stride, values.data() + split.source[v] * size,
                  static_cast<std::size_t>(size));
    }
    return patch_.Replace(old, uses, Shape(old, split.num_vertices()), std::move(bytes), stride == size ? 0 : stride,
                          kArrayBuffer);
  }

  std::int64_t WithoutBytes(const Json& index, std::int64_t count, std::int64_t uses) {
    const std::int64_t old = index.get<std::int64_t>();
    return patch_.ReplaceWithoutBytes(old, uses, Shape(old, count));
  }

  // The JSON of an accessor with `count` elements, without bytes. Its bounds stay, since copies add no new values.
  Json Shape(std::int64_t old, std::int64_t count) const {
    Json shape = gltf_.document.json["accessors"][static_cast<std::size_t>(old)];
    for (const char* gone : {"bufferView", "byteOffset", "sparse"}) shape.erase(gone);
    shape["count"] = count;
    return shape;
  }

  // Writes the indices. Strips and fans become lists: one of their indices belongs to several triangles, which may need
  // different copies of a vertex.
  void WriteIndices(const std::vector<std::int32_t>& indices, std::int64_t num_vertices, Json* primitive) {
    std::int64_t old = -1;
    GltfComponent component = GltfComponent::kUshort;
    Json shape = Json::object();
    if (primitive->contains("indices")) {
      old = (*primitive)["indices"].get<std::int64_t>();
      shape = Shape(old, 0);
      component = static_cast<GltfComponent>(shape["componentType"].get<int>());
      shape.erase("min");
      shape.erase("max");
    }
    const std::int64_t largest = num_vertices - 1;
    if (component == GltfComponent::kUbyte && largest > 254) component = GltfComponent::kUshort;
    if (component == GltfComponent::kUshort && largest > kLargestUshortIndex) component = GltfComponent::kUint;
    shape["componentType"] = static_cast<int>(component);
    shape["count"] = indices.size();
    shape["type"] = "SCALAR";
    std::string bytes;
    for (const std::int32_t index : indices) AppendIndex(index, component, &bytes);
    (*primitive)["indices"] = patch_.Replace(old, 1, shape, std::move(bytes), 0, kElementArrayBuffer);
    primitive->erase("mode");
  }

  absl::Status WriteDracoPrimitive(const CornerSplit& split, const std::vector<std::int32_t>& indices,
                                   bool drops_tangents, Json* primitive) {
    Json& extension = (*primitive)["extensions"][kDracoExtension];
    // Decoded again to get the quantization parameters.
    PLANISH_ASSIGN_OR_RETURN(const std::string_view compressed,
                             ViewBytes(gltf_.document, extension["bufferView"], kDracoExtension));
    PLANISH_ASSIGN_OR_RETURN(DracoPoints points, DecodeDracoPoints(std::string(compressed), true));
    if (drops_tangents && extension["attributes"].contains(kTangent)) {
      const Json id = extension["attributes"][kTangent];
      std::erase_if(points.attributes, [&id](const DracoAttribute& attribute) { return id == attribute.unique_id; });
      extension["attributes"].erase(kTangent);
    }
    ReplaceDracoUv(
        split, indices,
        extension["attributes"].contains(uv_name_) ? extension["attributes"][uv_name_].get<std::int64_t>() : -1,
        &points);
    extension["attributes"][uv_name_] = points.attributes.back().unique_id;
    PLANISH_ASSIGN_OR_RETURN(std::string bytes, EncodeDracoPoints(points));
    extension["bufferView"] = patch_.AddView(extension["bufferView"].get<std::int64_t>(), std::move(bytes), 0, 0);

    const std::int64_t old = primitive->contains("indices") ? (*primitive)["indices"].get<std::int64_t>() : -1;
    Json shape = old < 0 ? Json::object() : Shape(old, 0);
    const bool is_large = split.num_vertices() - 1 > kLargestUshortIndex;
    if (is_large || !shape.contains("componentType")) {
      shape["componentType"] = static_cast<int>(is_large ? GltfComponent::kUint : GltfComponent::kUshort);
    }
    if (shape["componentType"] == 5121 && split.num_vertices() > 255) shape["componentType"] = 5123;
    shape["count"] = indices.size();
    shape["type"] = "SCALAR";
    shape.erase("min");
    shape.erase("max");
    (*primitive)["indices"] = patch_.ReplaceWithoutBytes(old, 1, shape);
    primitive->erase("mode");
    RequireDraco();
    return absl::OkStatus();
  }

  // Lists Draco as a required extension, since the uncompressed fallback has been removed.
  void RequireDraco() {
    for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
      Json& names = patch_.json()[list];
      if (!names.is_array()) names = Json::array();
      if (std::find(names.begin(), names.end(), kDracoExtension) == names.end()) names.push_back(kDracoExtension);
    }
  }

  void MoveImages(Json* json) {
    const auto images = json->find("images");
    if (images == json->end() || !images->is_array() || options_.path == "-") return;
    for (Json& image : *images) {
      if (!image.is_object() || !image.contains("uri") || !image["uri"].is_string()) continue;
      const std::string uri = image["uri"].get<std::string>();
      if (!IsDataUri(uri)) image["uri"] = MovedUri(uri, gltf_.document.path, options_.path);
    }
  }

  std::int64_t MaterialOf(const GltfPrimitive& primitive) const {
    const Json& json = PrimitiveJson(gltf_.document.json, primitive);
    const auto material = json.find("material");
    return material == json.end() ? -1 : material->get<std::int64_t>();
  }

  // The set of UV that the tangents of a primitive belong to.
  int TangentTexcoord(const GltfPrimitive& primitive) const {
    for (const GltfTextureUse& use : TextureUses(gltf_.document.json, MaterialOf(primitive))) {
      if (use.is_normal) return use.texcoord;
    }
    return 0;
  }

  // Records the material if it uses images with the replaced UV of the primitive.
  void NoteTextures(const GltfPrimitive& primitive) {
    if (options_.textures.mode != TextureMode::kLeave) return;
    if (!PrimitiveJson(gltf_.document.json, primitive)["attributes"].contains(uv_name_)) return;
    const std::int64_t material = MaterialOf(primitive);
    if (stale_.contains(material)) return;
    std::string textures;
    for (const GltfTextureUse& use : TextureUses(gltf_.document.json, material)) {
      if (use.texcoord == options_.texcoord) {
        textures += (textures.empty() ? "" : ", ") + use.slot + " (" + use.name + ")";
      }
    }
    if (!textures.empty()) stale_[material] = textures;
  }

  // Removes the colours of a primitive's vertices.
  void DropColors(Json* primitive) {
    Json& attributes = (*primitive)["attributes"];
    patch_.Release(attributes[kVertexColors].get<std::int64_t>(), 1);
    attributes.erase(kVertexColors);
    if (DracoJson(*primitive) != nullptr) {
      (*primitive)["extensions"][kDracoExtension]["attributes"].erase(kVertexColors);
    }
  }

  // Removes the tangents of a pool, and those of its morph targets, from the JSON of a primitive.
  void DropTangents(std::int64_t uses, bool is_draco, bool are_replaced, Json* primitive) {
    const auto drop = [this, uses](Json* attributes) {
      const auto tangent = attributes->find(kTangent);
      if (tangent == attributes->end()) return false;
      patch_.Release(tangent->get<std::int64_t>(), uses);
      attributes->erase(kTangent);
      return true;
    };
    if (drop(&(*primitive)["attributes"]) && !are_replaced) dropped_tangents_ += uses;
    if (is_draco) (*primitive)["extensions"][kDracoExtension]["attributes"].erase(kTangent);
    if (!primitive->contains("targets") || !(*primitive)["targets"].is_array()) return;
    for (Json& target : (*primitive)["targets"]) drop(&target);
  }

  std::vector<OutputWarning> Warnings() const {
    std::vector<OutputWarning> warnings;
    for (const auto& [material, textures] : stale_) {
      const Json& json = gltf_.document.json["materials"][static_cast<std::size_t>(material)];
      warnings.push_back({"TEXTURE_UV_REPLACED",
                          "material " + GltfName(json, "material", material) + " reads " + textures + " with " +
                              uv_name_ +
                              ", which now holds the new UV: these images no longer fit. Bake them anew, or leave "
                              "the old UV in place with --output-texcoord=" +
                              std::to_string(FreeTexcoord(gltf_))});
    }
    if (filled_texcoords_ > 0) {
      warnings.push_back({"TEXCOORDS_FILLED", std::to_string(filled_texcoords_) +
                                                  (filled_texcoords_ == 1 ? " primitive has" : " primitives have") +
                                                  " the new UV as sets below " + uv_name_ +
                                                  " too, which were missing: glTF numbers sets without gaps"});
    }
    if (dropped_tangents_ > 0) {
      warnings.push_back({"TANGENTS_DROPPED", "the tangents of " + std::to_string(dropped_tangents_) +
                                                  (dropped_tangents_ == 1 ? " primitive" : " primitives") +
                                                  " belonged to the old UV and were dropped; viewers and engines "
                                                  "compute them from the new ones"});
    }
    return warnings;
  }

  const GltfMesh& gltf_;
  const std::vector<double>& uv_;
  const OutputOptions& options_;
  const std::string uv_name_;
  GltfTextures textures_;
  GltfPatch patch_;
  std::vector<std::array<float, 4>> tangents_;  // per corner of the file, for the new UV; empty if not requested
  std::map<std::int64_t, std::string> stale_;   // by material: the textures that no longer fit
  std::int64_t dropped_tangents_ = 0;           // number of primitives
  std::int64_t filled_texcoords_ = 0;           // the same
};

}  // namespace

FlippedUv::FlippedUv(const std::vector<double>& corner_uv) : original_(corner_uv), values_(corner_uv) {
  for (std::size_t i = 0; i < values_.size(); i += 2) {
    values_[i] = static_cast<float>(values_[i]);
    values_[i + 1] = static_cast<float>(1 - values_[i + 1]);
  }
}

void FlippedUv::Check(const std::vector<std::int64_t>& corners, std::vector<OutputWarning>* warnings) const {
  const auto orientation = [&corners](const std::vector<double>& uv, std::size_t first) {
    Vec2 p[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const auto c = static_cast<std::size_t>(corners[first + k]);
      p[k] = Vec2(uv[2 * c], uv[2 * c + 1]);
    }
    return Orientation(p[0], p[1], p[2]);
  };
  std::int64_t changed = 0;
  for (std::size_t i = 0; i + 2 < corners.size(); i += 3)
    changed += orientation(original_, i) != -orientation(values_, i);
  if (changed == 0) return;
  warnings->push_back(
      {"UV_PRECISION", std::to_string(changed) +
                           " triangles are so thin in the map that they turn or flatten when v is rounded to a float "
                           "that counts downwards, as glTF has it; write an OBJ or PLY to keep them"});
}

absl::StatusOr<WrittenMesh> GltfFiles(Json json, std::string buffer, int indent, const std::string& other_chunks,
                                      bool external_buffer, const OutputOptions& options) {
  WrittenMesh written;
  if (buffer.empty()) json.erase("buffers");
  if (options.format == MeshFormat::kGlb) {
    PLANISH_ASSIGN_OR_RETURN(std::string bytes, GlbBytes(json, std::move(buffer), other_chunks));
    written.files.push_back({options.path, std::move(bytes)});
    return written;
  }
  if (!buffer.empty() && external_buffer && options.path != "-") {
    const std::filesystem::path path = std::filesystem::path(options.path).replace_extension(".bin");
    json["buffers"][0]["uri"] = UriOfFileName(path.filename().string());
    written.files.push_back({path.string(), std::move(buffer)});
  } else if (!buffer.empty()) {
    json["buffers"][0]["uri"] = DataUri(buffer);
  }
  written.files.push_back({options.path, json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n"});
  return written;
}

absl::StatusOr<WrittenMesh> WriteGltf(const GltfMesh& gltf, const std::vector<double>& corner_uv,
                                      const OutputOptions& options) {
  const FlippedUv uv(corner_uv);
  PLANISH_ASSIGN_OR_RETURN(WrittenMesh written, GltfUvWriter(gltf, uv.values(), options).Write());
  std::vector<std::int64_t> corners(gltf.corner_vertex.size());
  for (std::size_t i = 0; i < corners.size(); ++i) corners[i] = static_cast<std::int64_t>(i);
  uv.Check(corners, &written.warnings);
  return written;
}

}  // namespace planish
