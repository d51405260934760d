#include "client/files/gltf_join.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <map>
#include <utility>
#include <vector>

#include "client/files/gltf_accessor.h"
#include "client/files/gltf_bake.h"
#include "client/files/gltf_patch.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

constexpr std::int64_t kTriangleList = 4;
constexpr std::int64_t kVertexBuffer = 34962, kIndexBuffer = 34963;  // bufferView.target
constexpr std::int64_t kLargestJoinedShort = 65534;           // 65535 restarts strips

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
        const std::string kind = KindOfPrimitive(primitives[p]);
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
        has_joined_ = true;
      }
      meshes[m]["primitives"] = std::move(left);
    }
    return absl::OkStatus();
  }

  bool has_joined() const { return has_joined_; }
  GltfPatch& patch() { return patch_; }

 private:
  const Json& AccessorJson(const Json& index) const { return document_.json["accessors"][index.get<std::size_t>()]; }

  // A key that is equal for primitives which can become one; empty: the primitive stays alone.
  std::string KindOfPrimitive(const Json& primitive) const {
    if (GltfIntAt(primitive, "mode", kTriangleList) != kTriangleList || primitive.contains("extensions")) return "";
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
    return kind.dump(-1, ' ', false, Json::error_handler_t::replace);
  }

  absl::Status Join(const std::vector<const Json*>& parts, Json* joined) {
    // Parts that share their vertices go on sharing them.
    std::vector<const Json*> pools;
    std::vector<std::int64_t> first_of_pool;
    std::vector<std::int64_t> indices;
    std::int64_t num_vertices = 0;
    for (const Json* const part : parts) {
      const auto same = std::find_if(pools.begin(), pools.end(), [part](const Json* pool) {
        return (*pool)["attributes"] == (*part)["attributes"] &&
               pool->value("targets", Json()) == part->value("targets", Json());
      });
      const std::int64_t count = AccessorJson((*part)["attributes"]["POSITION"])["count"].get<std::int64_t>();
      std::int64_t first = num_vertices;
      if (same == pools.end()) {
        pools.push_back(part);
        first_of_pool.push_back(first);
        num_vertices += count;
      } else {
        first = first_of_pool[static_cast<std::size_t>(same - pools.begin())];
      }
      PLANISH_RETURN_IF_ERROR(AppendIndices(*part, first, count, &indices));
    }
    for (auto& [name, index] : (*joined)["attributes"].items()) {
      const std::string& key = name;
      PLANISH_ASSIGN_OR_RETURN(
          index, JoinedAccessor(pools, num_vertices, [&key](const Json& pool) { return pool["attributes"][key]; }));
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
    std::string bytes;
    for (const std::int64_t index : indices) AppendIndex(index, component, &bytes);
    const Json shape = {{"componentType", static_cast<int>(component)}, {"count", indices.size()}, {"type", "SCALAR"}};
    (*joined)["indices"] = patch_.Replace(-1, 1, shape, std::move(bytes), 0, kIndexBuffer);
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

  // Joins the accessors that the pools have at `place` into one. Returns its index.
  absl::StatusOr<std::int64_t> JoinedAccessor(const std::vector<const Json*>& pools, std::int64_t num_vertices,
                                              const auto& place) {
    Json shape = AccessorJson(place(*pools[0]));
    for (const char* gone : {"bufferView", "byteOffset", "sparse", "name"}) shape.erase(gone);
    shape["count"] = num_vertices;
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
      Widen(
          AccessorJson(index), "min", [](double a, double b) { return std::min(a, b); }, &shape);
      Widen(
          AccessorJson(index), "max", [](double a, double b) { return std::max(a, b); }, &shape);
    }
    return patch_.Replace(-1, 1, shape, std::move(bytes), stride == size ? 0 : stride, kVertexBuffer);
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
  }

  const GltfDocument& document_;
  GltfPatch patch_;
  bool has_joined_ = false;
};

}  // namespace

absl::Status JoinPrimitives(const std::string& path, Json* json, std::string* buffer) {
  GltfDocument document;
  document.path = path;
  document.json = std::move(*json);
  document.buffers = {std::move(*buffer)};
  PrimitiveJoin join(document);
  PLANISH_RETURN_IF_ERROR(join.Run());
  if (join.has_joined()) {
    *buffer = join.patch().TakeBuffer();
    *json = std::move(join.patch().json());
  } else {
    *buffer = std::move(document.buffers[0]);
    *json = std::move(document.json);
  }
  return absl::OkStatus();
}

}  // namespace planish
