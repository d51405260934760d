// EXT_meshopt_compression and its successor KHR_meshopt_compression, which gltfpack writes. Used inside client/files
// only.
#pragma once

#include "absl/status/status.h"
#include "client/files/gltf_document.h"

namespace planish {

// Decompresses the views of `document`, whose buffers were loaded, into a buffer behind the others, and takes every
// trace of the extensions out of the JSON: what is written later is not compressed. Streams of the successor's own
// version and its filter COLOR are beyond meshoptimizer 0.18: a view that has them is read from the buffer that the
// file holds for others, if there is one. FILE_MALFORMED, FILE_UNSUPPORTED (metadata "element").
absl::Status DecompressMeshopt(GltfDocument* document);

}  // namespace planish
