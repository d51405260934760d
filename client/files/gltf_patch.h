// New bytes into a glTF document, in place of old ones that nobody else uses. Used inside client/files only.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "client/files/gltf_document.h"

namespace planish {

// Indices of accessors and bufferViews never change, as extensions may refer to them in ways that we do not know. So an
// accessor is replaced where it stands if what is replaced were its only uses, and added at the end otherwise; and the
// views that are left without a use take the new bytes. Anything that looks like an index inside an extension that we
// do not know counts as a use.
class GltfPatch {
 public:
  // Works on a copy of document.json. `document` must have been read by ReadGltf, and outlive the object.
  explicit GltfPatch(const GltfDocument& document);

  Json& json() { return json_; }

  // Takes away `uses` uses of accessor `old` (-1: none) and puts an accessor with `bytes` in a view of its own. `shape`
  // has componentType, count, type and what else is to stand in the accessor; the old one's name and extras stay.
  // `stride` 0: the view has none. `target` 0: likewise. Returns the accessor's index.
  std::int64_t Replace(std::int64_t old, std::int64_t uses, const Json& shape, std::string bytes, std::int64_t stride,
                       std::int64_t target);
  // The same without bytes: for values that Draco holds.
  std::int64_t ReplaceWithoutBytes(std::int64_t old, std::int64_t uses, const Json& shape);
  // Takes away `uses` uses of accessor `old`, whose bytes go if there are no others.
  void Release(std::int64_t old, std::int64_t uses);
  // Takes away one use of `old_view` (-1: none) and puts `bytes` into a view. Returns its index.
  std::int64_t AddView(std::int64_t old_view, std::string bytes, std::int64_t stride, std::int64_t target);

  // Takes away one use of view `old` (-1: none), whose bytes go if there are no others.
  void ReleaseView(std::int64_t old);
  // Whether an extension that we do not know has whole numbers, which may be indices of anything.
  bool has_unknown_indices() const { return has_unknown_indices_; }

  // Lays out the one buffer of the edited document: the bytes that are still in use, as they were and aligned as they
  // were, then the new ones. json() has offsets and lengths then, and a buffer without a URI.
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
  std::vector<std::int64_t> free_views_;      // descending, so that the first is taken first
  std::vector<std::int64_t> free_accessors_;  // released, and not taken by new ones yet
  std::map<std::int64_t, std::string> new_views_;
};

}  // namespace planish
