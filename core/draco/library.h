// Shared by the codecs of this folder: calls of the Draco library and its errors. Not for other folders.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/error.h"
#include "core/mesh/mesh.h"
#include "draco/compression/expert_encode.h"
#include "draco/mesh/mesh.h"

namespace planish {

// An INVALID_ARGUMENT error with this reason, message and metadata.
absl::Status InvalidDraco(const std::string& reason, const std::string& message,
                          const std::map<std::string, std::string>& metadata = {});

// INVALID_ARGUMENT, MESH_DECODE_FAILED: `bytes` do not begin like Draco data.
absl::Status NotDraco(std::string_view bytes);

// Decodes a triangle mesh, without further checks. With `keep_quantized`, quantized values stay integers and keep their
// quantization parameters. INVALID_ARGUMENT: MESH_DECODE_FAILED, MESH_NOT_A_MESH, MESH_EMPTY. May throw the exceptions
// that CatchOutOfMemory() catches.
absl::StatusOr<std::unique_ptr<draco::Mesh>> OpenDraco(std::string_view bytes, bool keep_quantized = false);

// The points of all faces. INVALID_ARGUMENT, MESH_INDEX_OUT_OF_RANGE: a point does not exist.
absl::StatusOr<std::vector<Face>> FacesOf(const draco::Mesh& mesh);

// Whether every value lies within the attribute's bytes and every point has an entry, which the decoder does not
// guarantee for hostile bytes. Entries may still be out of range.
bool IsBacked(const draco::PointAttribute& attribute, std::uint32_t num_points);

// INVALID_ARGUMENT, MESH_INDEX_OUT_OF_RANGE: "a face has the index V, ...".
absl::Status IndexOutOfRange(std::int64_t face, std::int64_t vertex, std::int64_t count);

// Checks that there are faces to encode, all within `count` points. INVALID_ARGUMENT: MESH_EMPTY,
// MESH_INDEX_OUT_OF_RANGE.
absl::Status CheckFaces(const std::vector<Face>& faces, std::int64_t count);

// Replaces the faces of `mesh` by `faces`.
void SetFaces(const std::vector<Face>& faces, draco::Mesh* mesh);

// Encodes faces and points in their order. `point_bytes` is the size of all values of a point that are not quantized.
absl::StatusOr<std::string> EncodeInOrder(std::int64_t point_bytes, const draco::Mesh& mesh,
                                          draco::ExpertEncoder* encoder);

// Returns function(), or RESOURCE_EXHAUSTED, OUT_OF_MEMORY, "not enough memory to <doing> the mesh" if memory runs out.
template <typename Function>
auto CatchOutOfMemory(const std::string& doing, const Function& function) -> decltype(function()) {
  const auto error = [&] {
    return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY",
                     "not enough memory to " + doing + " the mesh");
  };
  try {
    return function();
  } catch (const std::bad_alloc&) {
    return error();
  } catch (const std::length_error&) {  // a size that a damaged header declares
    return error();
  }
}

}  // namespace planish
