// Decodes and checks what a job says about the elements of its mesh (planish.v1.MeshElements). No other code does.
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

// The fields of planish.v1.MeshElements as numbers; empty if not given.
struct MeshElements {
  std::vector<std::int32_t> seam_corners;
  std::vector<std::int32_t> uncut_corners;
  std::vector<std::int32_t> face_polygon;
  std::vector<std::int32_t> face_atlas;
  std::vector<float> face_weights;
};

// Decodes and checks `elements`. `num_faces`: nullopt if it is not known before the mesh is decoded; then corners and
// lengths of lists are only checked against the largest possible mesh. INVALID_ARGUMENT with OPTIONS_INVALID and
// metadata "field" (the name in planish.v1.MeshElements) and "corner" or "face", the first wrong one. Wrong are: bytes
// that are not a multiple of 4, numbers out of range, lists for the triangles whose length is not the number of
// triangles, and combinations with `options` that are not allowed.
absl::StatusOr<MeshElements> DecodeMeshElements(const v1::MeshElements& elements, const v1::UnwrapOptions& options,
                                                std::optional<std::int64_t> num_faces);

// Packs numbers of 4 bytes as in planish.v1.MeshElements: little-endian.
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
