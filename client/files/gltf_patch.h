// Puts new bytes into a glTF document, and reuses the places of old ones. Used only in client/files.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "client/files/gltf_document.h"

namespace planish {

// Takes the elements `gone` out of the root's array `key`, and the array if nothing is left. Returns the new index of
// each that stays, and -1 for the others.
std::vector<std::int64_t> TakeOutOfRoot(const std::vector<bool>& gone, const char* key, Json* root);

// Until Compact(), indices of accessors and bufferViews do not change, since extensions may refer to them in unknown
// ways. An accessor is replaced in place if nothing else uses it; otherwise the new one is added at the end. Unused
// views get the new bytes. Anything in an unknown extension that looks like an index counts as a use.
class GltfPatch {
 public:
  // Works on a copy of document.json. `document` must have been read by ReadGltf, and outlive the object.
  explicit GltfPatch(const GltfDocument& document);

  Json& json() { return json_; }

  // Removes `uses` uses of accessor `old` (-1: none) and adds an accessor with `bytes` in its own view. `shape` has
  // componentType, count, type and other members of the accessor; the old one's name and extras are kept. `stride` or
  // `target` 0: the view does not have that member. Returns the accessor's index.
  std::int64_t Replace(std::int64_t old, std::int64_t uses, const Json& shape, std::string bytes, std::int64_t stride,
                       std::int64_t target);
  // As Replace(), but the accessor gets no view, because Draco holds the values.
  std::int64_t ReplaceWithoutBytes(std::int64_t old, std::int64_t uses, const Json& shape);
  // Removes `uses` uses of accessor `old`, and its bytes if there are no other uses.
  void Release(std::int64_t old, std::int64_t uses);
  // Removes one use of `old_view` (-1: none) and puts `bytes` into a view. Returns the index of that view.
  std::int64_t AddView(std::int64_t old_view, std::string bytes, std::int64_t stride, std::int64_t target);

  // Removes one use of view `old` (-1: none), and its bytes if there are no other uses.
  void ReleaseView(std::int64_t old);
  // Whether an unknown extension has whole numbers, which may be indices of anything.
  bool has_unknown_indices() const { return has_unknown_indices_; }

  // Removes accessors and views that nothing uses and that have lost their bytes, here or in an earlier patch. Others
  // get smaller indices. Does nothing if has_unknown_indices().
  void Compact();

  // Lays out the single buffer of the edited document: first the old bytes still in use, unchanged and with the same
  // alignment, then the new ones. json() then has offsets and lengths, and a buffer without a URI.
  std::string TakeBuffer();

 private:
  void CountUses();
  void CountUnknownUses(const Json& value, std::vector<std::int64_t>* uses);
  std::int64_t SlotFor(std::int64_t old, std::int64_t uses);
  void ReleaseViews(const Json& accessor);
  void DropFreeAccessors();
  void DropFreeViews();

  const GltfDocument& document_;
  Json json_;
  std::vector<std::int64_t> accessor_uses_;
  std::vector<std::int64_t> view_uses_;
  bool has_unknown_indices_ = false;
  std::vector<std::int64_t> free_views_;      // descending, so that back(), the first of the file, is reused first
  std::vector<std::int64_t> free_accessors_;  // released and not reused yet
  std::map<std::int64_t, std::string> new_views_;
};

}  // namespace planish
