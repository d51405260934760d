#include "core/draco/header.h"

#include <array>
#include <cstring>

#include "core/draco/library.h"
#include "draco/compression/config/compression_shared.h"
#include "draco/core/decoder_buffer.h"
#include "draco/core/varint_decoding.h"

namespace planish {
namespace {

constexpr std::string_view kDracoMagic = "DRACO";
// Metadata and entries that are skipped; a file with more keeps its counts to itself.
constexpr int kMostMetadata = 100'000;
constexpr std::uint16_t kOldestWithMetadata = DRACO_BITSTREAM_VERSION(1, 3);
// From these versions on numbers are of variable length.
constexpr std::uint16_t kVarintSequential = DRACO_BITSTREAM_VERSION(2, 2);
constexpr std::uint16_t kVarintEdgebreaker = DRACO_BITSTREAM_VERSION(2, 0);
// Before it Edgebreaker data tell first how many points splits of vertices that are not manifold add.
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

bool ReadVarint(std::uint32_t* value, draco::DecoderBuffer* buffer) {
  return draco::DecodeVarint(value, buffer);
}

// Metadata of every attribute that has some, then those of the whole geometry. Each may have metadata within, which
// follow it, outermost first: how deep they lie does not matter to where they end.
bool SkipMetadata(draco::DecoderBuffer* buffer) {
  int skipped = 0;
  const auto skip_one = [&](bool named, std::uint64_t* within) {
    std::uint32_t entries = 0, inner = 0;
    if (++skipped > kMostMetadata || (named && !SkipName(buffer)) || !ReadVarint(&entries, buffer)) return false;
    for (std::uint32_t i = 0; i < entries; ++i) {
      std::uint32_t size = 0;
      if (++skipped > kMostMetadata || !SkipName(buffer) || !ReadVarint(&size, buffer) || !Skip(size, buffer)) {
        return false;
      }
    }
    if (!ReadVarint(&inner, buffer)) return false;
    *within += inner;
    return true;
  };
  const auto skip_tree = [&] {
    std::uint64_t within = 0;
    if (!skip_one(false, &within)) return false;
    for (; within > 0; --within) {
      if (!skip_one(true, &within)) return false;
    }
    return true;
  };
  std::uint32_t attributes = 0;
  if (!ReadVarint(&attributes, buffer)) return false;
  for (std::uint32_t i = 0; i < attributes; ++i) {
    std::uint32_t id = 0;
    if (!ReadVarint(&id, buffer) || !skip_tree()) return false;
  }
  return skip_tree();
}

// Some numbers in a row, each of 32 bits or of variable length.
template <std::size_t kCount>
bool ReadNumbers(bool varint, std::array<std::uint32_t, kCount>* numbers, draco::DecoderBuffer* buffer) {
  for (std::uint32_t& number : *numbers) {
    if (!(varint ? ReadVarint(&number, buffer) : buffer->Decode(&number))) return false;
  }
  return true;
}

void ReadSequential(std::uint16_t version, draco::DecoderBuffer* buffer, DracoCounts* counts) {
  std::array<std::uint32_t, 2> numbers;
  if (!ReadNumbers(version >= kVarintSequential, &numbers, buffer)) return;
  counts->faces = numbers[0];
  counts->vertices = numbers[1];
}

void ReadEdgebreaker(std::uint16_t version, draco::DecoderBuffer* buffer, DracoCounts* counts) {
  std::uint8_t traversal = 0;
  std::array<std::uint32_t, 1> added = {0};
  std::array<std::uint32_t, 2> numbers;
  const bool varint = version >= kVarintEdgebreaker;
  if (!buffer->Decode(&traversal)) return;
  if (version < kWithoutAddedPoints && !ReadNumbers(varint, &added, buffer)) return;
  if (!ReadNumbers(varint, &numbers, buffer)) return;
  counts->vertices = numbers[0];
  counts->faces = numbers[1];
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
  counts.version_major = head[0];
  counts.version_minor = head[1];
  const auto version = static_cast<std::uint16_t>(DRACO_BITSTREAM_VERSION(head[0], head[1]));
  const bool is_mesh = head[2] == draco::TRIANGULAR_MESH;
  if (!is_mesh && head[2] != draco::POINT_CLOUD) return counts;
  counts.geometry = is_mesh ? DracoGeometry::kMesh : DracoGeometry::kPointCloud;
  if (is_mesh && head[3] == draco::MESH_SEQUENTIAL_ENCODING) counts.method = DracoMethod::kSequential;
  if (is_mesh && head[3] == draco::MESH_EDGEBREAKER_ENCODING) counts.method = DracoMethod::kEdgebreaker;
  if (!is_mesh && head[3] == draco::POINT_CLOUD_SEQUENTIAL_ENCODING) counts.method = DracoMethod::kSequential;
  if (!is_mesh && head[3] == draco::POINT_CLOUD_KD_TREE_ENCODING) counts.method = DracoMethod::kKdTree;
  const std::uint16_t newest = is_mesh ? draco::kDracoMeshBitstreamVersion : draco::kDracoPointCloudBitstreamVersion;
  if (counts.method == DracoMethod::kUnknown || head[0] < 1 || version > newest) return counts;
  if (version >= kOldestWithMetadata && (flags & METADATA_FLAG_MASK) != 0 && !SkipMetadata(&buffer)) return counts;
  if (!is_mesh) {
    std::array<std::uint32_t, 1> points;
    if (!ReadNumbers(false, &points, &buffer)) return counts;
    counts.faces = 0;
    counts.vertices = points[0];
  } else if (counts.method == DracoMethod::kSequential) {
    ReadSequential(version, &buffer, &counts);
  } else {
    ReadEdgebreaker(version, &buffer, &counts);
  }
  return counts;
}

}  // namespace planish
