#include "core/draco/header.h"

#include <array>

#include "core/draco/library.h"
#include "draco/compression/config/compression_shared.h"
#include "draco/core/decoder_buffer.h"
#include "draco/core/varint_decoding.h"

namespace planish {
namespace {

constexpr std::string_view kDracoMagic = "DRACO";
// The most metadata and entries that are skipped. If there are more, the counts are unknown.
constexpr int kMostMetadata = 100'000;
constexpr std::uint16_t kOldestWithMetadata = DRACO_BITSTREAM_VERSION(1, 3);
// From these versions on, numbers have variable length.
constexpr std::uint16_t kVarintSequential = DRACO_BITSTREAM_VERSION(2, 2);
constexpr std::uint16_t kVarintEdgebreaker = DRACO_BITSTREAM_VERSION(2, 0);
// Before this version, Edgebreaker data begins with the number of points that splitting non-manifold vertices adds.
constexpr std::uint16_t kWithoutAddedPoints = DRACO_BITSTREAM_VERSION(2, 2);

bool Skip(std::int64_t size, draco::DecoderBuffer* buffer) {
  if (size > buffer->remaining_size()) return false;
  buffer->Advance(size);
  return true;
}

bool SkipName(draco::DecoderBuffer* buffer) {
  std::uint8_t length = 0;
  return buffer->Decode(&length) && Skip(length, buffer);
}

// A metadata tree for every attribute that has one, each after the attribute's number, then one for the geometry.
// Nested metadata follows its parent, so the depth does not matter for finding the end.
bool SkipMetadata(draco::DecoderBuffer* buffer) {
  int skipped = 0;
  std::uint32_t attributes = 0, attribute = 0;
  if (!draco::DecodeVarint(&attributes, buffer)) return false;
  for (std::uint64_t tree = 0; tree <= attributes; ++tree) {
    if (tree < attributes && !draco::DecodeVarint(&attribute, buffer)) return false;
    std::uint64_t left = 1;  // number of metadata of this tree that are not skipped yet
    for (bool has_name = false; left > 0; --left, has_name = true) {
      std::uint32_t entries = 0, size = 0, within = 0;
      if (++skipped > kMostMetadata || (has_name && !SkipName(buffer))) return false;
      if (!draco::DecodeVarint(&entries, buffer)) return false;
      for (std::uint32_t i = 0; i < entries; ++i) {
        if (++skipped > kMostMetadata || !SkipName(buffer)) return false;
        if (!draco::DecodeVarint(&size, buffer) || !Skip(size, buffer)) return false;
      }
      if (!draco::DecodeVarint(&within, buffer)) return false;
      left += within;
    }
  }
  return true;
}

}  // namespace

absl::StatusOr<DracoCounts> PeekDraco(std::string_view bytes) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  std::array<char, kDracoMagic.size()> magic;
  std::array<std::uint8_t, 4> head;  // version, geometry, method
  std::uint16_t flags = 0;
  if (!buffer.Decode(magic.data(), magic.size()) || std::string_view(magic.data(), magic.size()) != kDracoMagic ||
      !buffer.Decode(head.data(), head.size()) || !buffer.Decode(&flags)) {
    return NotDraco(bytes);
  }
  DracoCounts counts;
  const auto version = static_cast<std::uint16_t>(DRACO_BITSTREAM_VERSION(head[0], head[1]));
  const bool is_mesh = head[2] == draco::TRIANGULAR_MESH;
  if (!is_mesh && head[2] != draco::POINT_CLOUD) return counts;
  counts.geometry = is_mesh ? DracoGeometry::kMesh : DracoGeometry::kPointCloud;
  static_assert(draco::MESH_SEQUENTIAL_ENCODING == 0 && draco::POINT_CLOUD_SEQUENTIAL_ENCODING == 0 &&
                draco::MESH_EDGEBREAKER_ENCODING == 1 && draco::POINT_CLOUD_KD_TREE_ENCODING == 1);
  if (head[3] == 0) counts.method = DracoMethod::kSequential;
  if (head[3] == 1) counts.method = is_mesh ? DracoMethod::kEdgebreaker : DracoMethod::kKdTree;
  const std::uint16_t newest = is_mesh ? draco::kDracoMeshBitstreamVersion : draco::kDracoPointCloudBitstreamVersion;
  if (counts.method == DracoMethod::kUnknown || head[0] < 1 || version > newest) return counts;
  if (version >= kOldestWithMetadata && (flags & METADATA_FLAG_MASK) != 0 && !SkipMetadata(&buffer)) return counts;
  const bool is_edgebreaker = counts.method == DracoMethod::kEdgebreaker;
  const bool is_varint = is_mesh && version >= (is_edgebreaker ? kVarintEdgebreaker : kVarintSequential);
  const auto read = [&](std::uint32_t* number) {
    return is_varint ? draco::DecodeVarint(number, &buffer) : buffer.Decode(number);
  };
  std::uint8_t traversal = 0;
  std::uint32_t added = 0, faces = 0, vertices = 0;
  if (is_edgebreaker) {
    if (!buffer.Decode(&traversal) || (version < kWithoutAddedPoints && !read(&added))) return counts;
    if (!read(&vertices) || !read(&faces)) return counts;
  } else if ((is_mesh && !read(&faces)) || !read(&vertices)) {
    return counts;
  }
  counts.faces = faces;
  counts.vertices = vertices;
  return counts;
}

}  // namespace planish
