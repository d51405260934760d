#include "server/rpc/wire_scan.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "google/protobuf/descriptor.pb.h"
#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/io/coded_stream.h"
#include "google/protobuf/message.h"
#include "google/protobuf/wire_format_lite.h"

namespace planish {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::MessageFactory;
using google::protobuf::internal::WireFormatLite;

// The depth limit of protobuf's own parser.
constexpr int kMaxDepth = 100;

// Memory that these take in addition to their contents: a string, with its pointer and its allocation; an entry of a
// map; an unknown field.
constexpr std::int64_t kStringBytes = 64;
constexpr std::int64_t kEntryBytes = 96;
constexpr std::int64_t kUnknownBytes = 48;

absl::Status WireInvalid(const std::string& message, std::map<std::string, std::string> metadata = {}) {
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", message, std::move(metadata));
}

std::int64_t ElementBytes(const FieldDescriptor& field) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT64:
    case FieldDescriptor::CPPTYPE_UINT64:
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return 8;
    case FieldDescriptor::CPPTYPE_BOOL:
      return 1;
    default:
      return 4;
  }
}

class Scanner {
 public:
  Scanner(google::protobuf::io::ZeroCopyInputStream* stream, const google::protobuf::Descriptor* type,
          std::int64_t max_fields)
      : in_(stream), root_(type), max_fields_(max_fields) {}

  absl::StatusOr<WireCost> Scan(std::int64_t length) {
    const auto limit = in_.PushLimit(static_cast<int>(length));
    PLANISH_RETURN_IF_ERROR(Fields(root_, "", 0));
    in_.PopLimit(limit);
    return cost_;
  }

 private:
  // Scans fields up to the current limit of the stream.
  absl::Status Fields(const google::protobuf::Descriptor* type, const std::string& path, int depth) {
    if (depth > kMaxDepth) return Malformed();
    std::map<int, int> counts;  // messages in repeated fields so far, by field number; for paths
    while (in_.BytesUntilLimit() > 0) {
      const std::uint32_t tag = in_.ReadTag();
      const int number = WireFormatLite::GetTagFieldNumber(tag);
      if (number == 0) return Malformed();
      if (++cost_.fields > max_fields_) {
        return WireInvalid(absl::StrCat("the message has more than ", max_fields_, " fields"));
      }
      const FieldDescriptor* field = type == nullptr ? nullptr : type->FindFieldByNumber(number);
      const auto wire = WireFormatLite::GetTagWireType(tag);
      if (wire == WireFormatLite::WIRETYPE_LENGTH_DELIMITED) {
        const bool is_list = field != nullptr && field->is_repeated() && field->message_type() != nullptr;
        PLANISH_RETURN_IF_ERROR(Delimited(field, path, is_list ? counts[number]++ : -1, depth));
      } else {
        PLANISH_RETURN_IF_ERROR(Scalar(field, tag, depth));
      }
    }
    return absl::OkStatus();
  }

  // `index`: the position in a repeated field; -1 if the field is not repeated.
  absl::Status Delimited(const FieldDescriptor* field, const std::string& path, int index, int depth) {
    std::uint32_t length = 0;
    if (!in_.ReadVarint32(&length) || static_cast<std::int64_t>(length) > in_.BytesUntilLimit()) return Malformed();
    const int size = static_cast<int>(length);
    if (field == nullptr) {
      cost_.bytes += kUnknownBytes + size;
      return in_.Skip(size) ? absl::OkStatus() : Malformed();
    }
    std::string name = path.empty() ? field->name() : absl::StrCat(path, ".", field->name());
    if (field->message_type() != nullptr) {
      cost_.bytes += field->is_map() ? kEntryBytes : SizeOf(*field->message_type());
      if (index >= 0 && !field->is_map()) absl::StrAppend(&name, "[", index, "]");
      const auto limit = in_.PushLimit(size);
      PLANISH_RETURN_IF_ERROR(Fields(field->message_type(), name, depth + 1));
      in_.PopLimit(limit);
      return absl::OkStatus();
    }
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_STRING) {
      cost_.bytes += kStringBytes + size;
      if (field->type() == FieldDescriptor::TYPE_BYTES) return in_.Skip(size) ? absl::OkStatus() : Malformed();
      return Text(*field, path, name, size);
    }
    if (!field->is_packable()) {
      cost_.bytes += kUnknownBytes + size;
      return in_.Skip(size) ? absl::OkStatus() : Malformed();
    }
    return Packed(*field, size);
  }

  absl::Status Scalar(const FieldDescriptor* field, std::uint32_t tag, int depth) {
    if (field == nullptr) cost_.bytes += kUnknownBytes;
    // Counts each element twice, since lists grow by doubling.
    if (field != nullptr && field->is_repeated()) cost_.bytes += 2 * ElementBytes(*field);
    std::uint64_t number = 0;
    switch (WireFormatLite::GetTagWireType(tag)) {
      case WireFormatLite::WIRETYPE_VARINT:
        return in_.ReadVarint64(&number) ? absl::OkStatus() : Malformed();
      case WireFormatLite::WIRETYPE_FIXED64:
        return in_.Skip(8) ? absl::OkStatus() : Malformed();
      case WireFormatLite::WIRETYPE_FIXED32:
        return in_.Skip(4) ? absl::OkStatus() : Malformed();
      case WireFormatLite::WIRETYPE_START_GROUP:
        return Group(WireFormatLite::GetTagFieldNumber(tag), depth + 1);
      default:
        return Malformed();
    }
  }

  // No message of ours has groups, so this is an unknown field.
  absl::Status Group(int number, int depth) {
    if (depth > kMaxDepth) return Malformed();
    while (true) {
      const std::uint32_t tag = in_.ReadTag();
      if (tag == WireFormatLite::MakeTag(number, WireFormatLite::WIRETYPE_END_GROUP)) return absl::OkStatus();
      if (WireFormatLite::GetTagFieldNumber(tag) == 0) return Malformed();
      if (++cost_.fields > max_fields_) {
        return WireInvalid(absl::StrCat("the message has more than ", max_fields_, " fields"));
      }
      if (WireFormatLite::GetTagWireType(tag) == WireFormatLite::WIRETYPE_LENGTH_DELIMITED) {
        PLANISH_RETURN_IF_ERROR(Delimited(nullptr, "", -1, depth));
      } else {
        PLANISH_RETURN_IF_ERROR(Scalar(nullptr, tag, depth));
      }
    }
  }

  absl::Status Text(const FieldDescriptor& field, const std::string& path, const std::string& name, int size) {
    bool has_nul = false;
    const bool read = ForPieces(size, [&](const char* data, int length) {
      has_nul = has_nul || std::memchr(data, '\0', static_cast<std::size_t>(length)) != nullptr;
    });
    if (!read) return Malformed();
    if (!has_nul) return absl::OkStatus();
    // For a string in a map, the error names the map.
    const bool is_entry = field.containing_type()->options().map_entry();
    const std::string& where = is_entry ? path : name;
    return WireInvalid(where + " has a NUL byte", {{"field", where}});
  }

  absl::Status Packed(const FieldDescriptor& field, int size) {
    const std::int64_t element = ElementBytes(field);
    const auto wire = WireFormatLite::WireTypeForFieldType(static_cast<WireFormatLite::FieldType>(field.type()));
    if (wire != WireFormatLite::WIRETYPE_VARINT) {
      cost_.bytes += size;
      return in_.Skip(size) ? absl::OkStatus() : Malformed();
    }
    std::int64_t count = 0;
    const bool read = ForPieces(size, [&](const char* data, int length) {
      count += std::count_if(data, data + length, [](char c) { return (static_cast<unsigned char>(c) & 0x80) == 0; });
    });
    cost_.bytes += element * count;
    return read ? absl::OkStatus() : Malformed();
  }

  // Calls `see` with the next `size` bytes, in the pieces in which the stream has them.
  template <class See>
  bool ForPieces(int size, const See& see) {
    while (size > 0) {
      const void* data = nullptr;
      int length = 0;
      if (!in_.GetDirectBufferPointer(&data, &length)) return false;
      length = std::min(length, size);
      see(static_cast<const char*>(data), length);
      if (!in_.Skip(length)) return false;
      size -= length;
    }
    return true;
  }

  // Memory of an empty message and the pointer to it.
  std::int64_t SizeOf(const google::protobuf::Descriptor& type) {
    const auto [found, is_new] = sizes_.try_emplace(&type, 0);
    if (is_new) {
      const auto* prototype = MessageFactory::generated_factory()->GetPrototype(&type);
      found->second = static_cast<std::int64_t>(prototype->SpaceUsedLong() + 3 * sizeof(void*));
    }
    return found->second;
  }

  absl::Status Malformed() const { return NoSuchMessage(root_); }

  google::protobuf::io::CodedInputStream in_;
  const google::protobuf::Descriptor* const root_;
  const std::int64_t max_fields_;
  WireCost cost_;
  std::map<const google::protobuf::Descriptor*, std::int64_t> sizes_;
};

}  // namespace

absl::StatusOr<WireCost> ScanMessage(google::protobuf::io::ZeroCopyInputStream* stream, std::int64_t length,
                                     const google::protobuf::Descriptor* type, std::int64_t max_fields) {
  return Scanner(stream, type, max_fields).Scan(length);
}

absl::Status NoSuchMessage(const google::protobuf::Descriptor* type) {
  return WireInvalid("the message is malformed: it is no " +
                     (type == nullptr ? "message of this method" : type->full_name()));
}

}  // namespace planish
