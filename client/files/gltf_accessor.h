// Accessors of a glTF file, checked against their bytes. Used only in client/files.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "client/files/gltf_document.h"

namespace planish {

enum class GltfComponent { kByte = 5120, kUbyte = 5121, kShort = 5122, kUshort = 5123, kUint = 5125, kFloat = 5126 };

int ComponentSize(GltfComponent component);

// The elements of an accessor, all checked to lie within the bytes of the document. The document must outlive them.
struct GltfAccessor {
  std::string element;  // "accessors[3]", for messages
  std::int64_t count = 0;
  int components = 0;  // numbers per element
  GltfComponent component = GltfComponent::kFloat;
  bool normalized = false;
  std::int64_t element_size = 0;  // bytes; columns of matrices start at multiples of 4
  const char* data = nullptr;     // null: all zero
  std::int64_t stride = 0;
  // Sparse elements, which replace some of the elements above.
  std::int64_t sparse_count = 0;
  GltfComponent sparse_component = GltfComponent::kUint;
  const char* sparse_indices = nullptr;  // of the replaced elements: below count, ascending
  const char* sparse_values = nullptr;   // the new elements, element_size bytes apart

  // All elements, without gaps.
  std::string DenseBytes() const;
};

// Opens accessor `index`, which must be below the number of accessors. FILE_MALFORMED if the accessor or its views are
// inconsistent.
absl::StatusOr<GltfAccessor> OpenAccessor(const GltfDocument& document, std::int64_t index);

// The bytes of bufferView `index`. FILE_MALFORMED, naming `element` or the view, if they do not lie in a buffer.
absl::StatusOr<std::string_view> ViewBytes(const GltfDocument& document, const Json& index, const std::string& element);

// A component as a number; "normalized" integers are scaled to [-1, 1] or [0, 1].
double ComponentValue(const char* bytes, GltfComponent component, bool normalized);
// An index as a number. `component`: kUbyte, kUshort or kUint.
std::int64_t IndexValue(const char* bytes, GltfComponent component);
void AppendIndex(std::int64_t value, GltfComponent component, std::string* bytes);

}  // namespace planish
