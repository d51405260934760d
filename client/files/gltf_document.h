// A glTF 2.0 file as JSON and bytes. Used only in client/files.
//
// The JSON is edited as a document (nlohmann's ordered_json) instead of being read into structs, so that everything
// unknown is preserved. tinygltf 2.7, tried for this, lost unknown data of one small file: non-standard members, nulls
// and empty arrays inside extensions (the mappings of KHR_materials_variants), and integers above 2^31 in extras; and
// it does not check the ranges of accessors.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "nlohmann/json.hpp"

namespace planish {

using Json = nlohmann::ordered_json;

struct GltfDocument {
  std::string path;
  bool is_binary = false;            // GLB
  int indent = -1;                   // blanks per level, as Json::dump() takes them; -1: all on one line
  Json json;                         // an object
  std::vector<std::string> buffers;  // byteLength bytes each; empty if a buffer has no data
  std::string other_chunks;          // those of a GLB after JSON and BIN, unchanged
  std::int64_t num_bytes = 0;        // of the file and all buffers
};

// Splits the container, parses the JSON, checks the version and loads all buffers: the chunk of a GLB, data URIs and
// files beside `path`. Decompresses meshopt (gltf_meshopt.h).
// FILE_MALFORMED (with metadata "element" if it is known), FILE_UNREADABLE, FILE_UNSUPPORTED.
absl::StatusOr<GltfDocument> ParseGltf(const std::string& path, std::string_view bytes);

// FILE_MALFORMED: "path: element: message".
absl::Status GltfFault(const GltfDocument& document, const std::string& element, const std::string& message);

// The array `key` of the document's root; empty if it is missing. ParseGltf() has checked that it is one of objects.
const Json& GltfArray(const GltfDocument& document, const char* key);

// The largest integer in JSON such that a double holds it and all smaller ones exactly.
inline constexpr std::int64_t kLargestGltfInt = std::int64_t{1} << 53;

// Member `key` of `object`, which must be a whole number in [least, most]; `fallback` if it is missing. FILE_MALFORMED
// for other values, and for a missing member without `fallback`.
absl::StatusOr<std::int64_t> GltfInt(const GltfDocument& document, const Json& object, const std::string& element,
                                     const char* key, std::int64_t least, std::int64_t most,
                                     std::optional<std::int64_t> fallback);

// `value` as an index below `count`. FILE_MALFORMED if it is no such index; `element` is for the message.
absl::StatusOr<std::int64_t> GltfIndex(const GltfDocument& document, const Json& value, const std::string& element,
                                       std::int64_t count);

// The member `key` of `object` if it is an object, else null.
const Json* GltfObject(const Json& object, const char* key);

// The integer `key` of `object`; `otherwise` where it is missing or no integer.
std::int64_t GltfIntAt(const Json& object, const char* key, std::int64_t otherwise);

// The number at `at` in `root`, clamped to the range of float; `otherwise` if there is no number.
double GltfNumberAt(const Json& root, const Json::json_pointer& at, double otherwise);

// The member "name" of `object`, or "kind_index" if it has none.
std::string GltfName(const Json& object, const char* kind, std::int64_t index);

// The bytes of a GLB with this JSON, buffer and other chunks. Reuses the memory of `buffer` if its capacity suffices.
// RESOURCE_EXHAUSTED FILE_TOO_LARGE: above 4 GiB.
absl::StatusOr<std::string> GlbBytes(const Json& json, std::string buffer, const std::string& other_chunks);

// The bytes of a URI: a data URI, or at most `size` bytes of a file beside document.path. `element` is for messages.
// FILE_MALFORMED, FILE_UNREADABLE; FILE_UNSUPPORTED for URIs with another scheme and for absolute paths.
absl::StatusOr<std::string> LoadGltfUri(const GltfDocument& document, const std::string& element,
                                        const std::string& uri, std::int64_t size);

// The path of the file that a relative URI names, relative to the document's folder. FILE_UNSUPPORTED for URIs with a
// scheme and for absolute paths; `element` is for the message.
absl::StatusOr<std::string> FileOfUri(const GltfDocument& document, const std::string& element, const std::string& uri);

bool IsDataUri(std::string_view uri);
// A data URI of the bytes: "data:application/octet-stream;base64,...".
std::string DataUri(const std::string& bytes);

// Rewrites a relative URI in a file at `from` so that it names the same file from a file at `to`. Returns any other URI
// unchanged.
std::string MovedUri(const std::string& uri, const std::string& from, const std::string& to);

// A file name as a URI, with special characters as %XX.
std::string UriOfFileName(const std::string& name);

}  // namespace planish
