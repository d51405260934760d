// The header of a PLY file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace planish {

enum class PlyEncoding { kAscii, kLittleEndian, kBigEndian };
enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

// Bytes of a value in a binary file.
int PlyTypeSize(PlyType type);
bool IsInteger(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;  // of the list's length
};

struct PlyElement {
  std::string name;
  std::int64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  std::vector<PlyElement> elements;  // in the order of their data
  std::size_t data_offset = 0;       // of the first byte behind the header
  std::int64_t data_line = 1;        // 1-based, for ascii
};

// Counts are checked against the bytes that follow: at least two characters per value in ascii, the sizes of the
// scalars and list lengths in binary. Errors as in readers.h.
absl::StatusOr<PlyHeader> ReadPlyHeader(const std::string& path, std::string_view bytes);

}  // namespace planish
