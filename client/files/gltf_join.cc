#include "client/files/gltf_join.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "client/files/gltf_accessor.h"
#include "client/files/gltf_bake.h"
#include "client/files/gltf_mesh.h"
#include "client/files/gltf_patch.h"
#include "core/base/status_macros.h"
#include "core/draco/points.h"

namespace planish {
namespace {

constexpr std::int64_t kTriangleList = 4;
constexpr std::int64_t kVertexBuffer = 34962, kIndexBuffer = 34963;  // bufferView.target
constexpr std::int64_t kLargestJoinedShort = 65534;                  // 65535 restarts strips

class PrimitiveJoin {
 public:
  explicit PrimitiveJoin(const GltfDocument& document) : document_(document), patch_(document) {}

  absl::Status Run() {
    Json& meshes = patch_.json()["meshes"];
    for (std::size_t m = 0; m < meshes.size(); ++m) {
      const Json primitives = meshes[m]["primitives"];
      // Lists of primitives that can become one, in the order of their first primitives.
      std::vector<std::vector<std::size_t>> joined;
      std::map<std::string, std::size_t> by_kind;
      for (std::size_t p = 0; p < primitives.size(); ++p) {
        PLANISH_ASSIGN_OR_RETURN(const std::string kind, KindOfPrimitive(primitives[p]));
        const auto [known, is_new] = by_kind.emplace(kind, joined.size());
        if (is_new || kind.empty()) {
          joined.push_back({p});
        } else {
          joined[known->second].push_back(p);
        }
      }
      if (joined.size() == primitives.size()) continue;
      Json left = Json::array();
      for (const std::vector<std::size_t>& list : joined) {
        left.push_back(primitives[list[0]]);
        if (list.size() == 1) continue;
        std::vector<const Json*> parts;
        for (const std::size_t p : list) parts.push_back(&primitives[p]);
        PLANISH_RETURN_IF_ERROR(Join(parts, &left.back()));
      }
      meshes[m]["primitives"] = std::move(left);
    }
    return absl::OkStatus();
  }

  GltfPatch& patch() { return patch_; }

 private:
  const Json& AccessorJson(const Json& index) const { return document_.json["accessors"][index.get<std::size_t>()]; }

  // A key that is equal for primitives which can become one; empty: the primitive stays alone.
  absl::StatusOr<std::string> KindOfPrimitive(const Json& primitive) {
    if (GltfIntAt(primitive, "mode", kTriangleList) != kTriangleList) return "";
    const Json* const draco = DracoJson(primitive);
    if (primitive.contains("extensions") && (draco == nullptr || primitive["extensions"].size() > 1)) return "";
    const auto kinds = [this](const Json& attributes) {
      std::map<std::string, Json> kind;  // by name
      for (const auto& [name, index] : attributes.items()) {
        const Json& accessor = AccessorJson(index);
        kind[name] = {accessor["componentType"], accessor["type"], accessor.value("normalized", false)};
      }
      return Json(kind);
    };
    Json kind = {GltfIntAt(primitive, "material", -1), kinds(primitive["attributes"]),
                 primitive.value("extras", Json())};
    for (const Json& target : primitive.value("targets", Json::array())) kind.push_back(kinds(target));
    if (draco != nullptr) {
      PLANISH_ASSIGN_OR_RETURN(const DracoPoints points, PointsOf(primitive));
      std::map<std::string, Json> compressed;
      for (const auto& [name, id] : (*draco)["attributes"].items()) {
        const DracoAttribute* const attribute = AttributeOf(points, id);
        if (attribute == nullptr) return "";
        compressed[name] = {attribute->kind, attribute->component, attribute->components, attribute->normalized};
      }
      if (compressed.size() != points.attributes.size()) return "";  // others would be lost
      kind.push_back(compressed);
    }
    return kind.dump(-1, ' ', false, Json::error_handler_t::replace);
  }

  absl::Status Join(const std::vector<const Json*>& parts, Json* joined) {
    // Parts that share their vertices go on sharing them.
    std::vector<const Json*> pools;
    std::map<std::string, std::int64_t> first_of_pool;
    std::vector<std::int64_t> indices;
    std::int64_t num_vertices = 0;
    const bool is_draco = DracoJson(*parts[0]) != nullptr;
    DracoPoints points;  // if is_draco: of all parts
    for (const Json* const part : parts) {
      const std::int64_t count = AccessorJson((*part)["attributes"]["POSITION"])["count"].get<std::int64_t>();
      std::int64_t first = num_vertices;
      if (is_draco) {
        pools.push_back(part);
        num_vertices += count;
        PLANISH_RETURN_IF_ERROR(AppendPoints(*part, *parts[0], &points));
        continue;
      }
      const std::string vertices = Json({(*part)["attributes"], part->value("targets", Json())}).dump();
      const auto [known, is_new] = first_of_pool.emplace(vertices, num_vertices);
      if (is_new) {
        pools.push_back(part);
        num_vertices += count;
      } else {
        first = known->second;
      }
      PLANISH_RETURN_IF_ERROR(AppendIndices(*part, first, count, &indices));
    }
    for (auto& [name, index] : (*joined)["attributes"].items()) {
      const std::string& key = name;
      const auto place = [&key](const Json& pool) { return pool["attributes"][key]; };
      const bool is_compressed = is_draco && (*DracoJson(*parts[0]))["attributes"].contains(key);
      if (is_compressed) {
        index = patch_.ReplaceWithoutBytes(-1, 1, JoinedShape(pools, num_vertices, place));
      } else {
        PLANISH_ASSIGN_OR_RETURN(index, JoinedAccessor(pools, num_vertices, place));
      }
    }
    const std::size_t num_targets = joined->contains("targets") ? (*joined)["targets"].size() : 0;
    for (std::size_t t = 0; t < num_targets; ++t) {
      for (auto& [name, index] : (*joined)["targets"][t].items()) {
        const std::string& key = name;
        PLANISH_ASSIGN_OR_RETURN(index, JoinedAccessor(pools, num_vertices, [&key, t](const Json& pool) {
                                   return pool["targets"][t][key];
                                 }));
      }
    }
    for (const Json* const part : parts) ReleaseAll(*part);
    const bool is_short = num_vertices - 1 <= kLargestJoinedShort;
    const GltfComponent component = is_short ? GltfComponent::kUshort : GltfComponent::kUint;
    Json shape = {{"componentType", static_cast<int>(component)}, {"count", indices.size()}, {"type", "SCALAR"}};
    if (is_draco) {
      shape["count"] = 3 * points.faces.size();
      PLANISH_ASSIGN_OR_RETURN(std::string bytes, EncodeDracoPoints(points));
      Json& extension = (*joined)["extensions"][kDracoExtension];
      extension["bufferView"] = patch_.AddView(-1, std::move(bytes), 0, 0);
      (*joined)["indices"] = patch_.ReplaceWithoutBytes(-1, 1, shape);
      return absl::OkStatus();
    }
    std::string bytes;
    for (const std::int64_t index : indices) AppendIndex(index, component, &bytes);
    (*joined)["indices"] = patch_.Replace(-1, 1, shape, std::move(bytes), 0, kIndexBuffer);
    return absl::OkStatus();
  }

  absl::StatusOr<DracoPoints> PointsOf(const Json& primitive) const {
    PLANISH_ASSIGN_OR_RETURN(const std::string_view compressed,
                             ViewBytes(document_, (*DracoJson(primitive))["bufferView"], kDracoExtension));
    return DecodeDracoPoints(std::string(compressed), /*want_quantization=*/true);
  }

  // The attribute of `points` that has an id, or null.
  static auto AttributeOf(auto& points, const Json& id) -> decltype(points.attributes.data()) {
    const auto found = std::find_if(points.attributes.begin(), points.attributes.end(),
                                    [&id](const DracoAttribute& each) { return id == each.unique_id; });
    return found == points.attributes.end() ? nullptr : &*found;
  }

  // Appends the points and faces of a primitive, with the ids that attributes have in the primitive `first`.
  absl::Status AppendPoints(const Json& primitive, const Json& first, DracoPoints* all) const {
    PLANISH_ASSIGN_OR_RETURN(DracoPoints points, PointsOf(primitive));
    if (all->faces.empty()) {
      *all = std::move(points);
      return absl::OkStatus();
    }
    const Json& ids = (*DracoJson(primitive))["attributes"];
    for (const auto& [name, id] : (*DracoJson(first))["attributes"].items()) {
      const DracoAttribute& part = *AttributeOf(points, ids[name]);
      DracoAttribute& whole = *AttributeOf(*all, id);
      whole.values += part.values;
      // On different grids the values are stored exactly.
      const bool same_grid =
          whole.quantization_bits == part.quantization_bits && whole.origin == part.origin && whole.range == part.range;
      if (!same_grid) whole.quantization_bits = 0;
    }
    const auto shift = static_cast<std::int32_t>(all->num_points);
    for (const Face& face : points.faces) all->faces.push_back({face[0] + shift, face[1] + shift, face[2] + shift});
    all->num_points += points.num_points;
    return absl::OkStatus();
  }

  absl::Status AppendIndices(const Json& primitive, std::int64_t first, std::int64_t count,
                             std::vector<std::int64_t>* indices) const {
    if (!primitive.contains("indices")) {
      for (std::int64_t i = 0; i < count; ++i) indices->push_back(first + i);
      return absl::OkStatus();
    }
    PLANISH_ASSIGN_OR_RETURN(const GltfAccessor accessor,
                             OpenAccessor(document_, primitive["indices"].get<std::int64_t>()));
    const std::string bytes = accessor.DenseBytes();
    for (std::int64_t i = 0; i < accessor.count; ++i) {
      indices->push_back(first + IndexValue(bytes.data() + i * accessor.element_size, accessor.component));
    }
    return absl::OkStatus();
  }

  // The shape of the accessors that the pools have at a place, as one.
  Json JoinedShape(const std::vector<const Json*>& pools, std::int64_t num_vertices, const auto& place) const {
    Json shape = AccessorJson(place(*pools[0]));
    for (const char* gone : {"bufferView", "byteOffset", "sparse", "name"}) shape.erase(gone);
    shape["count"] = num_vertices;
    for (const Json* const pool : pools) {
      const Json& accessor = AccessorJson(place(*pool));
      Widen(
          accessor, "min", [](double a, double b) { return std::min(a, b); }, &shape);
      Widen(
          accessor, "max", [](double a, double b) { return std::max(a, b); }, &shape);
    }
    return shape;
  }

  // These accessors, as one.
  absl::StatusOr<std::int64_t> JoinedAccessor(const std::vector<const Json*>& pools, std::int64_t num_vertices,
                                              const auto& place) {
    std::string bytes;
    std::int64_t stride = 0, size = 0;
    for (const Json* const pool : pools) {
      const Json index = place(*pool);
      PLANISH_ASSIGN_OR_RETURN(const GltfAccessor accessor, OpenAccessor(document_, index.get<std::int64_t>()));
      const std::string values = accessor.DenseBytes();
      size = accessor.element_size;
      stride = (size + 3) / 4 * 4;
      const std::size_t begin = bytes.size();
      bytes.resize(begin + static_cast<std::size_t>(stride * accessor.count), '\0');
      for (std::int64_t v = 0; v < accessor.count; ++v) {
        std::memcpy(bytes.data() + begin + static_cast<std::size_t>(v * stride), values.data() + v * size,
                    static_cast<std::size_t>(size));
      }
    }
    return patch_.Replace(-1, 1, JoinedShape(pools, num_vertices, place), std::move(bytes), stride == size ? 0 : stride,
                          kVertexBuffer);
  }

  // Widens the bound `key` (min or max) of `shape` by that of `accessor`. Drops the bound unless both have it.
  static void Widen(const Json& accessor, const char* key, double (*wider)(double, double), Json* shape) {
    const bool both = accessor.contains(key) && shape->contains(key) && accessor[key].is_array() &&
                      (*shape)[key].is_array() && accessor[key].size() == (*shape)[key].size();
    if (!both) {
      shape->erase(key);
      return;
    }
    for (std::size_t i = 0; i < accessor[key].size(); ++i) {
      if (wider(accessor[key][i].get<double>(), (*shape)[key][i].get<double>()) != (*shape)[key][i].get<double>()) {
        (*shape)[key][i] = accessor[key][i];
      }
    }
  }

  void ReleaseAll(const Json& primitive) {
    for (const Json& index : primitive["attributes"]) patch_.Release(index.get<std::int64_t>(), 1);
    for (const Json& target : primitive.value("targets", Json::array())) {
      for (const Json& index : target) patch_.Release(index.get<std::int64_t>(), 1);
    }
    if (primitive.contains("indices")) patch_.Release(primitive["indices"].get<std::int64_t>(), 1);
    if (const Json* const draco = DracoJson(primitive)) patch_.ReleaseView((*draco)["bufferView"].get<std::int64_t>());
  }

  const GltfDocument& document_;
  GltfPatch patch_;
};

}  // namespace

absl::Status JoinPrimitives(const std::string& path, Json* json, std::string* buffer) {
  GltfDocument document;
  document.path = path;
  document.json = std::move(*json);
  document.buffers = {std::move(*buffer)};
  PrimitiveJoin join(document);
  PLANISH_RETURN_IF_ERROR(join.Run());
  join.patch().Compact();
  *buffer = join.patch().TakeBuffer();
  *json = std::move(join.patch().json());
  return absl::OkStatus();
}

}  // namespace planish
