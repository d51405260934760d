#include "client/files/gltf_patch.h"

#include <algorithm>
#include <functional>

#include "client/files/gltf_mesh.h"

namespace planish {
namespace {

// Alignment of offsets in a file, in bytes; no glTF type needs more.
constexpr std::size_t kAlignment = 8;

void Pad(std::string* bytes, std::size_t remainder) {
  while (bytes->size() % kAlignment != remainder) bytes->push_back('\0');
}

void Count(std::int64_t index, std::vector<std::int64_t>* uses) {
  if (index >= 0 && index < static_cast<std::int64_t>(uses->size())) ++(*uses)[static_cast<std::size_t>(index)];
}

// Whether an extension is known not to refer to accessors or views. (Extensions of materials, textures and lights have
// many numbers that mean other things.)
bool RefersToNoBytes(std::string_view extension) {
  for (const std::string_view prefix :
       {"KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_", "MSFT_texture_"}) {
    if (extension.substr(0, prefix.size()) == prefix) return true;
  }
  // CountUses() counts the view of Draco.
  return extension == kDracoExtension;
}

// Calls action(element) for the elements of an array or object that `object` may have.
template <typename Value, typename Action>
void ForEach(Value& object, const char* key, const Action& action) {
  if (!object.is_object()) return;
  const auto list = object.find(key);
  if (list == object.end() || !list->is_structured()) return;
  for (auto& value : *list) action(value);
}

// Calls action(index) if `object` has an index there.
template <typename Value, typename Action>
void AtIndex(Value& object, const char* key, const Action& action) {
  if (!object.is_object()) return;
  const auto index = object.find(key);
  if (index != object.end() && index->is_number_integer()) action(*index);
}

// Calls action(index) for each reference to an accessor, but for those of unknown extensions.
template <typename Value, typename Action>
void ForEachAccessorIndex(Value& root, const Action& action) {
  const auto attribute = [&action](auto& index) {
    if (index.is_number_integer()) action(index);
  };
  ForEach(root, "meshes", [&](auto& mesh) {
    ForEach(mesh, "primitives", [&](auto& primitive) {
      AtIndex(primitive, "indices", action);
      ForEach(primitive, "attributes", attribute);
      ForEach(primitive, "targets", [&](auto& target) {
        if (!target.is_object()) return;
        for (auto& index : target) attribute(index);
      });
    });
  });
  ForEach(root, "animations", [&](auto& animation) {
    ForEach(animation, "samplers", [&](auto& sampler) {
      AtIndex(sampler, "input", action);
      AtIndex(sampler, "output", action);
    });
  });
  ForEach(root, "skins", [&](auto& skin) { AtIndex(skin, "inverseBindMatrices", action); });
}

// The same for views.
template <typename Value, typename Action>
void ForEachViewIndex(Value& root, const Action& action) {
  ForEach(root, "meshes", [&](auto& mesh) {
    ForEach(mesh, "primitives", [&](auto& primitive) {
      if (DracoJson(primitive) != nullptr) AtIndex(primitive["extensions"][kDracoExtension], "bufferView", action);
    });
  });
  ForEach(root, "images", [&](auto& image) { AtIndex(image, "bufferView", action); });
  ForEach(root, "accessors", [&](auto& accessor) {
    AtIndex(accessor, "bufferView", action);
    if (GltfObject(accessor, "sparse") == nullptr) return;
    for (const char* part : {"indices", "values"}) {
      if (GltfObject(accessor["sparse"], part) != nullptr) AtIndex(accessor["sparse"][part], "bufferView", action);
    }
  });
}

Json& ArrayAt(Json& root, const char* key) {
  if (!root.contains(key)) root[key] = Json::array();
  return root[key];
}

}  // namespace

std::vector<std::int64_t> TakeOutOfRoot(const std::vector<bool>& gone, const char* key, Json* root) {
  std::vector<std::int64_t> index(gone.size(), -1);
  Json left = Json::array();
  for (std::size_t i = 0; i < gone.size(); ++i) {
    if (gone[i]) continue;
    index[i] = static_cast<std::int64_t>(left.size());
    left.push_back(std::move((*root)[key][i]));
  }
  if (left.empty()) {
    root->erase(key);
  } else {
    (*root)[key] = std::move(left);
  }
  return index;
}

GltfPatch::GltfPatch(const GltfDocument& document) : document_(document), json_(document.json) {
  ArrayAt(json_, "accessors");
  ArrayAt(json_, "bufferViews");
  accessor_uses_.resize(json_["accessors"].size(), 0);
  view_uses_.resize(json_["bufferViews"].size(), 0);
  CountUses();
}

// Counts every whole number inside an unknown extension, since it may be the index of an accessor or of a view.
void GltfPatch::CountUnknownUses(const Json& value, std::vector<std::int64_t>* uses) {
  if (value.is_number_integer()) {
    has_unknown_indices_ = true;
    Count(value.get<std::int64_t>(), uses);
  } else if (value.is_structured()) {
    for (const auto& [key, child] : value.items()) {
      if (!RefersToNoBytes(key)) CountUnknownUses(child, uses);
    }
  }
}

void GltfPatch::CountUses() {
  // Visits every "extensions" of the document. The recursion is bounded, as the depth of the JSON was checked.
  const auto extensions = [this](const auto& self, const Json& value) -> void {
    if (!value.is_structured()) return;
    for (const auto& [key, child] : value.items()) {
      if (key == "extensions") {
        CountUnknownUses(child, &accessor_uses_);
        CountUnknownUses(child, &view_uses_);
      } else {
        self(self, child);
      }
    }
  };
  extensions(extensions, json_);

  ForEachAccessorIndex(json_, [this](const Json& index) { Count(index.get<std::int64_t>(), &accessor_uses_); });
  ForEachViewIndex(json_, [this](const Json& index) { Count(index.get<std::int64_t>(), &view_uses_); });
}

void GltfPatch::ReleaseView(std::int64_t view) {
  if (view < 0 || view >= static_cast<std::int64_t>(view_uses_.size())) return;
  if (--view_uses_[static_cast<std::size_t>(view)] > 0) return;
  free_views_.insert(std::upper_bound(free_views_.begin(), free_views_.end(), view, std::greater<>()), view);
}

void GltfPatch::ReleaseViews(const Json& accessor) {
  ReleaseView(GltfIntAt(accessor, "bufferView", -1));
  const Json* const sparse = GltfObject(accessor, "sparse");
  if (sparse == nullptr) return;
  for (const char* part : {"indices", "values"}) {
    if (const Json* const object = GltfObject(*sparse, part)) ReleaseView(GltfIntAt(*object, "bufferView", -1));
  }
}

void GltfPatch::Release(std::int64_t old, std::int64_t uses) {
  std::int64_t& left = accessor_uses_[static_cast<std::size_t>(old)];
  left -= uses;
  if (left > 0) return;
  Json& accessor = json_["accessors"][static_cast<std::size_t>(old)];
  ReleaseViews(accessor);
  for (const char* gone : {"bufferView", "byteOffset", "sparse"}) accessor.erase(gone);
  free_accessors_.push_back(old);
}

// Removes free accessors at the end of the list, which changes no other index. Other free ones stay, without bytes.
void GltfPatch::DropFreeAccessors() {
  Json& accessors = json_["accessors"];
  std::sort(free_accessors_.begin(), free_accessors_.end());
  while (!free_accessors_.empty() && free_accessors_.back() + 1 == static_cast<std::int64_t>(accessors.size())) {
    accessors.erase(accessors.size() - 1);
    free_accessors_.pop_back();
  }
}

// Removes free views at the end of the list. Other free views stay, and all refer to the same byte.
void GltfPatch::DropFreeViews() {
  Json& views = json_["bufferViews"];
  std::size_t last = 0;  // free_views_ is descending: the views before this one are removed
  while (last < free_views_.size() && free_views_[last] + 1 == static_cast<std::int64_t>(views.size())) {
    views.erase(views.size() - 1);
    ++last;
  }
  free_views_.erase(free_views_.begin(), free_views_.begin() + static_cast<std::ptrdiff_t>(last));
  for (const std::int64_t view : free_views_) {
    views[static_cast<std::size_t>(view)] = {{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 1}};
  }
}

void GltfPatch::Compact() {
  if (has_unknown_indices_) return;
  std::vector<bool> gone(json_["accessors"].size(), false);
  for (std::size_t a = 0; a < gone.size(); ++a) {
    const Json& accessor = json_["accessors"][a];
    gone[a] = accessor_uses_[a] <= 0 && !accessor.contains("bufferView") && !accessor.contains("sparse");
  }
  const std::vector<std::int64_t> accessor = TakeOutOfRoot(gone, "accessors", &json_);
  ArrayAt(json_, "accessors");
  const auto renumber = [](const std::vector<std::int64_t>& numbers) {
    return [&numbers](Json& index) {
      const auto old = index.get<std::int64_t>();
      if (old >= 0 && old < std::ssize(numbers)) index = numbers[static_cast<std::size_t>(old)];
    };
  };
  ForEachAccessorIndex(json_, renumber(accessor));
  free_accessors_.clear();

  gone.assign(json_["bufferViews"].size(), false);
  for (std::size_t v = 0; v < gone.size(); ++v) {
    gone[v] = view_uses_[v] <= 0 && GltfIntAt(json_["bufferViews"][v], "byteLength", 0) <= 1;  // DropFreeViews()
  }
  for (const std::int64_t view : free_views_) gone[static_cast<std::size_t>(view)] = true;
  const std::vector<std::int64_t> view = TakeOutOfRoot(gone, "bufferViews", &json_);
  ArrayAt(json_, "bufferViews");
  ForEachViewIndex(json_, renumber(view));
  free_views_.clear();
  std::map<std::int64_t, std::string> moved;
  for (auto& [old, bytes] : new_views_) moved[view[static_cast<std::size_t>(old)]] = std::move(bytes);
  new_views_ = std::move(moved);
  accessor_uses_.assign(json_["accessors"].size(), 0);
  view_uses_.assign(json_["bufferViews"].size(), 0);
  CountUses();
}

std::int64_t GltfPatch::SlotFor(std::int64_t old, std::int64_t uses) {
  Json& accessors = json_["accessors"];
  if (old >= 0) {
    std::int64_t& left = accessor_uses_[static_cast<std::size_t>(old)];
    left -= uses;
    if (left <= 0) {
      ReleaseViews(accessors[static_cast<std::size_t>(old)]);
      left = uses;
      return old;
    }
  }
  if (!free_accessors_.empty()) {
    const std::int64_t slot = free_accessors_.back();
    free_accessors_.pop_back();
    accessor_uses_[static_cast<std::size_t>(slot)] = uses;
    return slot;
  }
  accessors.push_back(Json::object());
  accessor_uses_.push_back(uses);
  return static_cast<std::int64_t>(accessors.size()) - 1;
}

std::int64_t GltfPatch::ReplaceWithoutBytes(std::int64_t old, std::int64_t uses, const Json& shape) {
  const std::int64_t slot = SlotFor(old, uses);
  Json& accessors = json_["accessors"];
  Json accessor = shape;
  if (old >= 0) {
    for (const char* kept : {"name", "extras"}) {
      const Json& source = document_.json["accessors"][static_cast<std::size_t>(old)];
      if (source.contains(kept)) accessor[kept] = source[kept];
    }
  }
  accessors[static_cast<std::size_t>(slot)] = std::move(accessor);
  return slot;
}

std::int64_t GltfPatch::Replace(std::int64_t old, std::int64_t uses, const Json& shape, std::string bytes,
                                std::int64_t stride, std::int64_t target) {
  const std::int64_t slot = ReplaceWithoutBytes(old, uses, shape);
  const std::int64_t view = AddView(-1, std::move(bytes), stride, target);
  json_["accessors"][static_cast<std::size_t>(slot)]["bufferView"] = view;
  return slot;
}

std::int64_t GltfPatch::AddView(std::int64_t old_view, std::string bytes, std::int64_t stride, std::int64_t target) {
  ReleaseView(old_view);
  Json& views = json_["bufferViews"];
  std::int64_t view = static_cast<std::int64_t>(views.size());
  if (free_views_.empty()) {
    views.push_back(Json::object());
    view_uses_.push_back(0);
  } else {
    view = free_views_.back();
    free_views_.pop_back();
  }
  Json json = {{"buffer", 0}, {"byteOffset", 0}, {"byteLength", bytes.size()}};
  if (stride > 0) json["byteStride"] = stride;
  if (target > 0) json["target"] = target;
  views[static_cast<std::size_t>(view)] = std::move(json);
  view_uses_[static_cast<std::size_t>(view)] = 1;
  new_views_[view] = std::move(bytes);
  return view;
}

std::string GltfPatch::TakeBuffer() {
  DropFreeAccessors();
  DropFreeViews();
  Json& views = json_["bufferViews"];
  // Per old buffer, the ranges of the views that are still used. They may overlap.
  struct Range {
    std::int64_t begin, end;
    std::size_t view;
  };
  std::vector<std::vector<Range>> ranges(document_.buffers.size());
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (new_views_.contains(static_cast<std::int64_t>(v)) ||
        std::binary_search(free_views_.begin(), free_views_.end(), static_cast<std::int64_t>(v), std::greater<>())) {
      continue;
    }
    Json& view = views[v];
    const std::int64_t buffer = GltfIntAt(view, "buffer", -1);
    if (buffer < 0 || buffer >= static_cast<std::int64_t>(ranges.size())) continue;
    const std::int64_t size = static_cast<std::int64_t>(document_.buffers[static_cast<std::size_t>(buffer)].size());
    const std::int64_t begin = std::clamp<std::int64_t>(GltfIntAt(view, "byteOffset", -1), 0, size);
    const std::int64_t length = std::clamp<std::int64_t>(GltfIntAt(view, "byteLength", -1), 0, size - begin);
    ranges[static_cast<std::size_t>(buffer)].push_back({begin, begin + length, v});
  }
  std::string result;
  // Leaves room for what GlbBytes() puts around the buffer. Reserved memory that is never written to costs nothing.
  constexpr std::size_t kRoom = 1 << 20;
  std::size_t most = kRoom;
  for (const auto& list : ranges) {
    for (const Range& range : list) most += static_cast<std::size_t>(range.end - range.begin) + 2 * kAlignment;
  }
  for (const auto& [v, bytes] : new_views_) most += bytes.size() + kAlignment;
  result.reserve(most);
  for (std::size_t b = 0; b < ranges.size(); ++b) {
    std::sort(ranges[b].begin(), ranges[b].end(),
              [](const Range& x, const Range& y) { return x.begin != y.begin ? x.begin < y.begin : x.view < y.view; });
    std::int64_t copied_to = -1;  // position in the old buffer up to which bytes are copied; -1: none yet
    std::int64_t shift = 0;
    for (const Range& range : ranges[b]) {
      if (copied_to < 0 || range.begin > copied_to) {
        Pad(&result, static_cast<std::size_t>(range.begin) % kAlignment);
        shift = static_cast<std::int64_t>(result.size()) - range.begin;
        copied_to = range.begin;
      }
      if (range.end > copied_to) {
        result.append(document_.buffers[b], static_cast<std::size_t>(copied_to),
                      static_cast<std::size_t>(range.end - copied_to));
        copied_to = range.end;
      }
      Json& view = views[range.view];
      view["buffer"] = 0;
      view["byteOffset"] = range.begin + shift;
      view["byteLength"] = range.end - range.begin;
    }
  }
  for (auto& [v, bytes] : new_views_) {
    Pad(&result, 0);
    views[static_cast<std::size_t>(v)]["byteOffset"] = result.size();
    result += bytes;
    bytes = std::string();
  }
  if (result.empty() && !free_views_.empty()) result.resize(1);
  // The merged buffer keeps the name and extras of the first old buffer.
  Json& buffers = ArrayAt(json_, "buffers");
  if (buffers.empty()) buffers.push_back(Json::object());
  Json buffer = buffers[0];
  buffer.erase("uri");
  buffer["byteLength"] = result.size();
  buffers = Json::array({std::move(buffer)});
  return result;
}

}  // namespace planish
