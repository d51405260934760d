// What a job knows of the elements of its mesh (planish.v1.MeshElements): the one place where its bytes become numbers and
// are checked.
#pragma once

#include <bit>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "planish/v1/planish.pb.h"

namespace planish {

// The fields of planish.v1.MeshElements as numbers; empty where nothing is said.
struct MeshElements {
  std::vector<std::int32_t> seam_corners;
  std::vector<std::int32_t> uncut_corners;
  std::vector<std::int32_t> face_polygon;
  std::vector<std::int32_t> face_atlas;
  std::vector<float> face_weights;
};

// `num_faces`: if it is known before the mesh is decoded. INVALID_ARGUMENT, OPTIONS_INVALID with metadata "field" (as
// planish.v1.MeshElements names it) and "corner" or "face", the first that is wrong: bytes that are no whole numbers,
// numbers out of range, lists for the triangles that are not as long as there are triangles, and what does not go with
// `options`. Without `num_faces` corners and the lengths of lists are in range at most for some mesh.
absl::StatusOr<MeshElements> DecodeMeshElements(const v1::MeshElements& elements, const v1::UnwrapOptions& options,
                                                std::optional<std::int64_t> num_faces);

// Numbers of 4 bytes as planish.v1.MeshElements has them.
template <typename Number>
std::string PackNumbers(std::span<const Number> numbers) {
  static_assert(sizeof(Number) == 4);
  std::string bytes;
  bytes.reserve(4 * numbers.size());
  for (const Number number : numbers) {
    const auto value = std::bit_cast<std::uint32_t>(number);
    for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<char>(value >> shift));
  }
  return bytes;
}

}  // namespace planish
