// EXT_meshopt_compression and its successor KHR_meshopt_compression, which gltfpack writes. Used only in client/files.
#pragma once

#include "absl/status/status.h"
#include "client/files/gltf_document.h"

namespace planish {

// Decompresses the views of `document`, whose buffers were loaded, into an additional buffer, and removes the
// extensions from the JSON, so that the file is written without compression. meshoptimizer 0.18 supports neither the
// stream version nor the filter COLOR that KHR_meshopt_compression added: such a view is read from the file's fallback
// buffer, if it has one.
// FILE_MALFORMED, FILE_UNSUPPORTED (metadata "element").
absl::Status DecompressMeshopt(GltfDocument* document);

}  // namespace planish
