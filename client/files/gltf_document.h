// A glTF 2.0 file as JSON and bytes. Used inside client/files only.
//
// The JSON is edited as a document (nlohmann's, in its order), not read into structs and written from them: so all that
// we do not know goes through untouched. tinygltf 2.7, tried for this, lost on one small file what it has no field for:
// members of its own beside the standard ones, nulls and empty arrays inside extensions (the mappings of
// KHR_materials_variants), integers above 2^31 in extras; and it checks no range of an accessor.
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
  int indent = -1;                   // blanks a level, as nlohmann takes it
  Json json;                         // an object
  std::vector<std::string> buffers;  // byteLength bytes each; empty where a buffer has no data
  std::string other_chunks;          // of a GLB, behind JSON and BIN, as they are
  std::int64_t num_bytes = 0;        // of all there was to read
};

// Takes the container apart, parses the JSON and loads all buffers: the chunk of a GLB, data URIs and files beside
// `path`. Checks the version, and that nothing is required that we cannot read.
// FILE_MALFORMED (metadata "element" where there is one), FILE_UNREADABLE, FILE_UNSUPPORTED.
absl::StatusOr<GltfDocument> ParseGltf(const std::string& path, std::string_view bytes);

// FILE_MALFORMED: "path: element: message".
absl::Status GltfFault(const GltfDocument& document, const std::string& element, const std::string& message);

// The array `key` of the document's root; empty if there is none. FILE_MALFORMED if it is no array of objects.
absl::StatusOr<const Json*> GltfArray(const GltfDocument& document, const char* key);

// The largest integer of JSON that a double holds exactly, with all below it.
inline constexpr std::int64_t kLargestGltfInt = std::int64_t{1} << 53;

// A member of `object` that must be a whole number in [least, most]; `fallback` where there is none.
absl::StatusOr<std::int64_t> GltfInt(const GltfDocument& document, const Json& object, const std::string& element,
                                     const char* key, std::int64_t least, std::int64_t most,
                                     std::optional<std::int64_t> fallback);

// `value` as an index below `count`.
absl::StatusOr<std::int64_t> GltfIndex(const GltfDocument& document, const Json& value, const std::string& element,
                                       std::int64_t count);

// The member `key` if `object` has one that is an object, else null.
const Json* GltfObject(const Json& object, const char* key);

// The string `key`, or a name from kind and index.
std::string GltfName(const Json& object, const char* kind, std::int64_t index);

// The bytes of a file from its JSON and its one buffer. RESOURCE_EXHAUSTED FILE_TOO_LARGE: a GLB above 4 GiB.
// Without a copy if `buffer` has room for the rest.
absl::StatusOr<std::string> GlbBytes(const Json& json, std::string buffer, const std::string& other_chunks);

// The bytes behind a URI: a data URI, or at most `size` bytes of a file beside document.path. `element` is for
// messages. FILE_MALFORMED, FILE_UNREADABLE; FILE_UNSUPPORTED for URIs with another scheme and for absolute paths.
absl::StatusOr<std::string> LoadGltfUri(const GltfDocument& document, const std::string& element,
                                        const std::string& uri, std::int64_t size);

// The path of the file that a relative URI names, from the folder of the document. FILE_UNSUPPORTED for other URIs.
absl::StatusOr<std::string> FileOfUri(const GltfDocument& document, const std::string& element, const std::string& uri);

bool IsDataUri(std::string_view uri);
// "data:application/octet-stream;base64,..."
std::string DataUri(const std::string& bytes);

// A relative URI in a file at `from`, so that it names the same file from a file at `to`. Others are left as they are.
std::string MovedUri(const std::string& uri, const std::string& from, const std::string& to);

// A file name as a URI, with what URIs cannot hold as %XX.
std::string UriOfFileName(const std::string& name);

}  // namespace planish
