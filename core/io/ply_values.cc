#include "core/io/ply_values.h"

#include <bit>

#include "core/base/status_macros.h"
#include "core/io/file_error.h"
#include "core/io/number.h"

namespace planish {
namespace {

std::int64_t Integer(PlyType type, std::uint64_t bits) {
  switch (type) {
    case PlyType::kInt8:
      return static_cast<std::int8_t>(bits);
    case PlyType::kInt16:
      return static_cast<std::int16_t>(bits);
    case PlyType::kInt32:
      return static_cast<std::int32_t>(bits);
    default:
      return static_cast<std::int64_t>(bits);
  }
}

}  // namespace

PlyValues::PlyValues(const std::string& path, std::string_view bytes, const PlyHeader& header)
    : path_(path),
      bytes_(bytes.substr(header.data_offset)),
      encoding_(header.encoding),
      cursor_(path, bytes_, header.data_line, false) {}

absl::Status PlyValues::Fault(const std::string& message) const {
  return FileMalformed(path_, line(), message);
}

absl::Status PlyValues::CutOff(const ElementName& element) const {
  return Fault("the file ends before " + std::string(element.kind) + " " + std::to_string(element.index) +
               " is complete; it seems to be cut off");
}

absl::Status PlyValues::ReadBits(const ElementName& element, int size, std::uint64_t* bits) {
  if (bytes_.size() - position_ < static_cast<std::size_t>(size)) return CutOff(element);
  *bits = 0;
  for (int i = 0; i < size; ++i) {
    const int byte = encoding_ == PlyEncoding::kBigEndian ? i : size - 1 - i;
    *bits = *bits << 8 | static_cast<unsigned char>(bytes_[position_ + byte]);
  }
  position_ += size;
  return absl::OkStatus();
}

absl::Status PlyValues::ReadDouble(const ElementName& element, PlyType type, double* value) {
  if (is_text()) return cursor_.ReadDouble(element, value);
  std::uint64_t bits = 0;
  PLANISH_RETURN_IF_ERROR(ReadBits(element, PlyTypeSize(type), &bits));
  if (type == PlyType::kFloat32) {
    *value = std::bit_cast<float>(static_cast<std::uint32_t>(bits));
  } else if (type == PlyType::kFloat64) {
    *value = std::bit_cast<double>(bits);
  } else {
    *value = static_cast<double>(Integer(type, bits));
  }
  return absl::OkStatus();
}

absl::Status PlyValues::ReadInt(const ElementName& element, PlyType type, std::int64_t* value) {
  if (is_text()) return cursor_.ReadInt(element, value);
  std::uint64_t bits = 0;
  PLANISH_RETURN_IF_ERROR(ReadBits(element, PlyTypeSize(type), &bits));
  *value = Integer(type, bits);
  return absl::OkStatus();
}

absl::Status PlyValues::Skip(const ElementName& element, PlyType type, std::int64_t count) {
  if (is_text()) {
    for (std::int64_t i = 0; i < count; ++i) {
      if (cursor_.Token().empty()) return CutOff(element);
    }
    return absl::OkStatus();
  }
  // Counts are at most 2^32 here, so the product does not overflow.
  const std::uint64_t size = static_cast<std::uint64_t>(count) * PlyTypeSize(type);
  if (bytes_.size() - position_ < size) return CutOff(element);
  position_ += size;
  return absl::OkStatus();
}

absl::Status PlyValues::ReadLength(const ElementName& element, const PlyProperty& property, std::int64_t* length) {
  *length = 1;
  if (!property.is_list) return absl::OkStatus();
  PLANISH_RETURN_IF_ERROR(ReadInt(element, property.count_type, length));
  if (*length >= 0 && *length <= UINT32_MAX) return absl::OkStatus();
  return Fault(std::string(element.kind) + " " + std::to_string(element.index) + ": a list of length " +
               std::to_string(*length));
}

absl::Status PlyValues::SkipProperty(const ElementName& element, const PlyProperty& property) {
  std::int64_t length = 0;
  PLANISH_RETURN_IF_ERROR(ReadLength(element, property, &length));
  return Skip(element, property.type, length);
}

absl::Status PlyValues::Copy(const ElementName& element, const PlyProperty& property, std::string* copy) {
  if (!is_text()) {
    const std::size_t begin = position_;
    PLANISH_RETURN_IF_ERROR(SkipProperty(element, property));
    *copy += bytes_.substr(begin, position_ - begin);
    return absl::OkStatus();
  }
  std::int64_t length = 0;
  PLANISH_RETURN_IF_ERROR(ReadLength(element, property, &length));
  if (property.is_list) {
    AppendInt(length, copy);
    *copy += ' ';
  }
  for (std::int64_t i = 0; i < length; ++i) {
    const std::string_view token = cursor_.Token();
    if (token.empty()) return CutOff(element);
    *copy += token;
    *copy += ' ';
  }
  return absl::OkStatus();
}

}  // namespace planish
