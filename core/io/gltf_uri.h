// References of a glTF file to others. Used inside core/io only.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/io/gltf_document.h"

namespace planish {

// The bytes behind a URI: a data URI, or at most `size` bytes of a file beside document.path. `element` is for
// messages. FILE_MALFORMED, FILE_UNREADABLE; FILE_UNSUPPORTED for URIs with another scheme and for absolute paths.
absl::StatusOr<std::string> LoadGltfUri(const GltfDocument& document, const std::string& element,
                                        const std::string& uri, std::int64_t size);

bool IsDataUri(std::string_view uri);
// "data:application/octet-stream;base64,..."
std::string DataUri(const std::string& bytes);

// A relative URI in a file at `from`, so that it names the same file from a file at `to`. Others are left as they are.
std::string MovedUri(const std::string& uri, const std::string& from, const std::string& to);

// A file name as a URI, with what URIs cannot hold as %XX.
std::string UriOfFileName(const std::string& name);

}  // namespace planish
