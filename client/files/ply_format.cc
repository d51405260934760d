#include "client/files/ply_format.h"

#include <algorithm>
#include <bit>
#include <optional>

#include "client/files/file_io.h"
#include "client/files/seam_copies.h"
#include "client/files/text_cursor.h"
#include "core/base/number.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

std::optional<PlyType> TypeOfName(std::string_view name) {
  struct Row {
    std::string_view name;
    std::string_view other_name;
    PlyType type;
  };
  static constexpr Row kRows[] = {
      {"char", "int8", PlyType::kInt8},        {"uchar", "uint8", PlyType::kUint8},
      {"short", "int16", PlyType::kInt16},     {"ushort", "uint16", PlyType::kUint16},
      {"int", "int32", PlyType::kInt32},       {"uint", "uint32", PlyType::kUint32},
      {"float", "float32", PlyType::kFloat32}, {"double", "float64", PlyType::kFloat64},
  };
  for (const Row& row : kRows) {
    if (name == row.name || name == row.other_name) return row.type;
  }
  return std::nullopt;
}

std::vector<std::string_view> Words(std::string_view line) {
  constexpr std::string_view kBlanks = " \t\r\v\f";
  std::vector<std::string_view> words;
  std::size_t begin = line.find_first_not_of(kBlanks);
  while (begin != std::string_view::npos) {
    const std::size_t end = std::min(line.find_first_of(kBlanks, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kBlanks, end);
  }
  return words;
}

// Whether the first face, read in this header's encoding, has vertices that exist.
bool HasSoundFace(const std::string& path, std::string_view bytes, const PlyHeader& header) {
  const absl::StatusOr<PlyLayout> layout = FindPlyLayout(path, header);
  if (!layout.ok()) return false;
  PlyValues values(path, bytes, header);
  for (std::size_t i = 0; i < layout->face; ++i) {
    const PlyElement& element = header.elements[i];
    for (std::int64_t k = 0; k < element.count && !element.properties.empty(); ++k) {
      for (const PlyProperty& property : element.properties) {
        if (!values.SkipProperty({element.name.c_str(), k}, property).ok()) return false;
      }
    }
  }
  const PlyElement& faces = header.elements[layout->face];
  for (std::size_t p = 0; p < layout->indices; ++p) {
    if (!values.SkipProperty({"face", 0}, faces.properties[p]).ok()) return false;
  }
  const PlyProperty& indices = faces.properties[layout->indices];
  std::int64_t corners = 0;
  if (!values.ReadInt({"face", 0}, indices.count_type, &corners).ok() || corners < 3) return false;
  for (std::int64_t k = 0; k < corners; ++k) {
    std::int64_t vertex = 0;
    if (!values.ReadInt({"face", 0}, indices.type, &vertex).ok()) return false;
    if (vertex < 0 || vertex >= header.elements[layout->vertex].count) return false;
  }
  return true;
}

// Guesses the encoding if the header does not say it: text, or binary in one of two byte orders.
PlyEncoding GuessEncoding(const std::string& path, std::string_view bytes, const PlyHeader& header) {
  const std::string_view data = bytes.substr(header.data_offset);
  const bool is_text =
      std::all_of(data.begin(), data.end(), [](char c) { return (c >= ' ' && c <= '~') || IsBlank(c); });
  if (is_text) return PlyEncoding::kAscii;
  PlyHeader tried = header;
  tried.encoding = PlyEncoding::kBigEndian;
  return HasSoundFace(path, bytes, tried) ? PlyEncoding::kBigEndian : PlyEncoding::kLittleEndian;
}

class HeaderReader {
 public:
  HeaderReader(const std::string& path, std::string_view bytes) : path_(path), bytes_(bytes) {}

  absl::StatusOr<PlyHeader> Read() {
    std::string_view line;
    if (!NextLine(&line) || line != "ply") return Fault("a PLY file starts with a line \"ply\", this one does not");
    while (true) {
      if (!NextLine(&line)) return Fault("the header has no \"end_header\"; the file is cut off or not a PLY");
      const std::vector<std::string_view> words = Words(line);
      if (words.empty() || words[0] == "obj_info") continue;
      if (words[0] == "comment") {
        const std::string_view comment = words.size() > 1 ? line.substr(words[1].data() - line.data()) : "";
        if (IsSeamMark(comment)) header_.seam_marks.push_back(comment);
        if (const std::string_view image = PlyImage(comment); !image.empty()) header_.images.push_back(image);
        continue;
      }
      if (words[0] == "end_header") break;
      if (words[0] == "format") {
        PLANISH_RETURN_IF_ERROR(ReadFormat(words));
        header_.has_format = true;
      } else if (words[0] == "element") {
        PLANISH_RETURN_IF_ERROR(ReadElement(words));
      } else if (words[0] == "property") {
        PLANISH_RETURN_IF_ERROR(ReadProperty(words));
      } else {
        return Fault("unknown line in the header: " + Quoted(line));
      }
    }
    header_.data_offset = position_;
    header_.data_line = line_ + 1;
    if (!header_.has_format) header_.encoding = GuessEncoding(path_, bytes_, header_);
    PLANISH_RETURN_IF_ERROR(CheckCounts());
    return std::move(header_);
  }

 private:
  absl::Status Fault(const std::string& message) const { return FileMalformed(path_, line_, message); }

  // Lines end with LF, CRLF or CR. Returns the line without its end.
  bool NextLine(std::string_view* line) {
    const std::size_t end = bytes_.find_first_of("\r\n", position_);
    if (end == std::string_view::npos) return false;
    ++line_;
    *line = bytes_.substr(position_, end - position_);
    position_ = end + (bytes_.substr(end, 2) == "\r\n" ? 2 : 1);
    return true;
  }

  absl::Status ReadFormat(const std::vector<std::string_view>& words) {
    const std::string_view name = words.size() > 1 ? words[1] : "";
    if (name == "ascii") {
      header_.encoding = PlyEncoding::kAscii;
    } else if (name == "binary_little_endian") {
      header_.encoding = PlyEncoding::kLittleEndian;
    } else if (name == "binary_big_endian") {
      header_.encoding = PlyEncoding::kBigEndian;
    } else {
      return Fault("unknown format " + Quoted(name));
    }
    return absl::OkStatus();
  }

  absl::Status ReadElement(const std::vector<std::string_view>& words) {
    PlyElement element;
    if (words.size() != 3 || !ParseInt(words[2], &element.count) || element.count < 0) {
      return Fault("an element line is \"element NAME COUNT\"");
    }
    element.name = words[1];
    header_.elements.push_back(element);
    return absl::OkStatus();
  }

  absl::Status ReadProperty(const std::vector<std::string_view>& words) {
    if (header_.elements.empty()) return Fault("a property before the first element");
    PlyProperty property;
    property.is_list = words.size() == 5 && words[1] == "list";
    if (!property.is_list && words.size() != 3) {
      return Fault("a property line is \"property TYPE NAME\" or \"property list TYPE TYPE NAME\"");
    }
    const std::optional<PlyType> type = TypeOfName(words[words.size() - 2]);
    const std::optional<PlyType> count_type = property.is_list ? TypeOfName(words[2]) : PlyType::kUint8;
    if (!type || !count_type) return Fault("unknown type in the header");
    if (!IsInteger(*count_type)) return Fault("the length of a list must have an integer type");
    property.type = *type;
    property.count_type = *count_type;
    property.name = words.back();
    header_.elements.back().properties.push_back(property);
    return absl::OkStatus();
  }

  absl::Status CheckCounts() const {
    const std::uint64_t remaining = bytes_.size() - header_.data_offset;
    for (const PlyElement& element : header_.elements) {
      std::uint64_t least_bytes = 0;
      for (const PlyProperty& property : element.properties) {
        if (header_.encoding == PlyEncoding::kAscii) {
          least_bytes += 2;
        } else {
          least_bytes += PlyTypeSize(property.is_list ? property.count_type : property.type);
        }
      }
      // The last value of an ascii file may lack its line end.
      if (least_bytes == 0 || static_cast<std::uint64_t>(element.count) <= (remaining + 1) / least_bytes) continue;
      return FileMalformed(path_, 0,
                           "the header announces " + std::to_string(element.count) + " of element " +
                               Quoted(element.name) + ", but only " + std::to_string(remaining) +
                               " bytes follow; the file seems to be cut off");
    }
    return absl::OkStatus();
  }

  const std::string& path_;
  std::string_view bytes_;
  std::size_t position_ = 0;
  std::int64_t line_ = 0;
  PlyHeader header_;
};

}  // namespace

int PlyTypeSize(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat32:
      return 4;
    case PlyType::kFloat64:
      return 8;
  }
  return 0;
}

bool IsInteger(PlyType type) {
  return type != PlyType::kFloat32 && type != PlyType::kFloat64;
}

std::string_view PlyImage(std::string_view comment) {
  constexpr std::string_view kKeyword = "TextureFile", kBlanks = " \t\v\f";
  const std::size_t begin = comment.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos || !comment.substr(begin).starts_with(kKeyword)) return "";
  const std::string_view rest = comment.substr(begin + kKeyword.size());
  const std::size_t name = rest.find_first_not_of(kBlanks);
  if (name == 0 || name == std::string_view::npos) return "";
  return rest.substr(name, rest.find_last_not_of(kBlanks) + 1 - name);
}

absl::StatusOr<PlyHeader> ReadPlyHeader(const std::string& path, std::string_view bytes) {
  return HeaderReader(path, bytes).Read();
}

namespace {

std::optional<std::size_t> ElementNamed(const PlyHeader& header, std::string_view name) {
  for (std::size_t i = 0; i < header.elements.size(); ++i) {
    if (header.elements[i].name == name) return i;
  }
  return std::nullopt;
}

std::optional<std::size_t> Property(const PlyElement& element, std::string_view name, bool is_list) {
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    if (element.properties[i].name == name && element.properties[i].is_list == is_list) return i;
  }
  return std::nullopt;
}

}  // namespace

absl::StatusOr<PlyLayout> FindPlyLayout(const std::string& path, const PlyHeader& header) {
  const auto vertex = ElementNamed(header, "vertex");
  const auto face = ElementNamed(header, "face");
  if (!vertex) return FileMalformed(path, 0, "no element \"vertex\" in the header");
  if (!face || header.elements[*face].count == 0) {
    return FileMalformed(path, 0,
                         ElementNamed(header, "tristrips")
                             ? "triangle strips are not supported; save the mesh with an element \"face\""
                             : "no faces; a point cloud cannot be unwrapped");
  }
  PlyLayout layout;
  layout.vertex = *vertex;
  layout.face = *face;
  const PlyElement& vertices = header.elements[*vertex];
  const PlyElement& faces = header.elements[*face];
  if (vertices.count > INT32_MAX) return FileMalformed(path, 0, "more than 2147483647 vertices");
  for (int axis = 0; axis < 3; ++axis) {
    const std::string_view name = std::string_view("xyz").substr(axis, 1);
    const auto property = Property(vertices, name, false);
    if (!property && vertices.count > 0) {
      return FileMalformed(path, 0, "the vertices have no property " + Quoted(name));
    }
    layout.xyz[axis] = property.value_or(0);
  }
  static constexpr std::array<const char*, 2> kUvNames[] = {
      {"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}};
  for (const auto& names : kUvNames) {
    const auto u = Property(vertices, names[0], false);
    const auto v = Property(vertices, names[1], false);
    if (!layout.vertex_uv && u && v) layout.vertex_uv = {*u, *v};
  }
  auto indices = Property(faces, "vertex_indices", true);
  if (!indices) indices = Property(faces, "vertex_index", true);
  if (!indices) return FileMalformed(path, 0, "the faces have no list property \"vertex_indices\"");
  if (!IsInteger(faces.properties[*indices].type)) {
    return FileMalformed(path, 0, "vertex_indices must have an integer type");
  }
  layout.indices = *indices;
  layout.face_uv = Property(faces, "texcoord", true);
  return layout;
}

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
  // Counts are at most 2^32 here, so the product cannot overflow.
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
    AppendShortest(length, copy);
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
