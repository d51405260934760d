// EXT_meshopt_compression, which gltfpack writes. Used inside client/files only.
#pragma once

#include "absl/status/status.h"
#include "client/files/gltf_document.h"

namespace planish {

inline constexpr char kMeshoptExtension[] = "EXT_meshopt_compression";

// Decompresses the views of `document`, whose buffers were loaded, into a buffer behind the others, and takes every
// trace of the extension out of the JSON: what is written later is not compressed. FILE_MALFORMED (metadata "element").
absl::Status DecompressMeshopt(GltfDocument* document);

}  // namespace planish
