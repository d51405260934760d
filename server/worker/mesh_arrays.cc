#include "server/worker/mesh_arrays.h"

#include <array>
#include <bit>
#include <cstring>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace planish {
namespace {

static_assert(std::endian::native == std::endian::little, "arrays are copied as they lie in memory");

constexpr std::int64_t kMaxInt = std::numeric_limits<std::int32_t>::max();

using Position = std::array<float, 3>;
using Triangle = std::array<std::uint32_t, 3>;

absl::Status TooLarge(const char* element, std::int64_t count, std::int64_t limit) {
  return MakeError(absl::StatusCode::kResourceExhausted, "MESH_TOO_LARGE",
                   absl::StrCat("the mesh has ", count, " ", element, ", ", limit, " can be counted"),
                   {{"element", element}, {"limit", absl::StrCat(limit)}});
}

}  // namespace

absl::StatusOr<Mesh> ReadMeshArrays(std::string_view bytes, std::int64_t vertices) {
  const auto size = static_cast<std::int64_t>(bytes.size());
  constexpr auto kPositionBytes = static_cast<std::int64_t>(sizeof(Position));
  constexpr auto kFaceBytes = static_cast<std::int64_t>(sizeof(Triangle));
  if (vertices < 0 || vertices > size / kPositionBytes || (size - vertices * kPositionBytes) % kFaceBytes != 0) {
    return InternalError("the server sent arrays of another length than it announced");
  }
  const std::int64_t faces = (size - vertices * kPositionBytes) / kFaceBytes;
  if (faces == 0) return MakeError(absl::StatusCode::kInvalidArgument, "MESH_EMPTY", "the mesh has no triangle");
  if (vertices > kMaxInt) return TooLarge("vertices", vertices, kMaxInt);
  if (faces > kMaxInt / 3) return TooLarge("faces", faces, kMaxInt / 3);

  Mesh mesh;
  mesh.positions.reserve(static_cast<std::size_t>(vertices));
  const char* at = bytes.data();
  for (std::int64_t v = 0; v < vertices; ++v, at += sizeof(Position)) {
    Position position;
    std::memcpy(position.data(), at, sizeof position);
    mesh.positions.emplace_back(position[0], position[1], position[2]);
  }
  mesh.faces.resize(static_cast<std::size_t>(faces));
  for (std::int64_t f = 0; f < faces; ++f, at += sizeof(Triangle)) {
    Triangle triangle;
    std::memcpy(triangle.data(), at, sizeof triangle);
    for (std::size_t k = 0; k < 3; ++k) {
      if (triangle[k] >= vertices) {
        return MakeError(
            absl::StatusCode::kInvalidArgument, "MESH_INDEX_OUT_OF_RANGE",
            absl::StrCat("a face has the index ", triangle[k], ", but the mesh has ", vertices, " vertices"),
            {{"faces", absl::StrCat(f)}});
      }
      mesh.faces[static_cast<std::size_t>(f)][k] = static_cast<std::int32_t>(triangle[k]);
    }
  }
  return mesh;
}

}  // namespace planish
