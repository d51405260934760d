#include "client/src/uv_bytes.h"

#include <bit>
#include <cstring>

#include "core/base/sha256.h"
#include "planish/error.h"

namespace planish {
inline namespace abi0 {
namespace {

static_assert(std::endian::native == std::endian::little, "UV travel little-endian");

Error Corrupt(const std::string& what) {
  return Error(ErrorCode::kDataLoss, "UV_CORRUPT", "the UV that arrived are not the ones the server made: " + what);
}

template <typename Number>
std::vector<Number> Numbers(const std::string& bytes) {
  std::vector<Number> numbers(bytes.size() / sizeof(Number));
  std::memcpy(numbers.data(), bytes.data(), bytes.size());
  return numbers;
}

}  // namespace

Uv ParseUv(const v1::UvDescription& description, const std::string& bytes, const PackedMesh& mesh) {
  if (description.mesh_sha256() != mesh.sha256) {
    throw Error(ErrorCode::kFailedPrecondition, "MESH_MISMATCH",
                "the job was made from another mesh (the SHA-256 of the mesh bytes differs): give the same file");
  }
  const bool is_double = description.precision() == v1::PRECISION_DOUBLE;
  if (description.corner_count() != 3 * mesh.triangles) {
    throw Corrupt(std::to_string(description.corner_count()) + " corners for " + std::to_string(mesh.triangles) +
                  " triangles");
  }
  const std::size_t expected = static_cast<std::size_t>(6 * mesh.triangles) * (is_double ? 8 : 4);
  if (bytes.size() != expected) {
    throw Corrupt(std::to_string(bytes.size()) + " bytes instead of " + std::to_string(expected));
  }
  if (Sha256(bytes) != description.uv_sha256()) throw Corrupt("their SHA-256 differs");
  Uv uv;
  uv.precision = is_double ? Precision::kDouble : Precision::kFloat;
  if (is_double) {
    uv.doubles = Numbers<double>(bytes);
  } else {
    uv.floats = Numbers<float>(bytes);
  }
  return uv;
}

}  // namespace abi0
}  // namespace planish
