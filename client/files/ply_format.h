// PLY: the header, the layout of the elements in the file, and their values. Used only in client/files.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/files/text_cursor.h"

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
  PlyType count_type = PlyType::kUint8;  // type of the list's length
};

struct PlyElement {
  std::string name;
  std::int64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  bool has_format = false;                   // false: the encoding was guessed from the data
  std::vector<PlyElement> elements;          // in the order of their data
  std::size_t data_offset = 0;               // of the first byte after the header
  std::int64_t data_line = 1;                // 1-based, for ascii
  std::vector<std::string_view> seam_marks;  // comments, for JoinSeamVertices()
  std::vector<std::string_view> images;      // names in comments, by PlyImage()
};

// The name in a comment "TextureFile NAME", as MeshLab writes it; empty for other comments. `comment` is the text
// behind the word "comment".
std::string_view PlyImage(std::string_view comment);

// If the line "format" is missing, uses the encoding in which the data makes sense. Checks counts against the bytes
// that follow: at least two characters per value in ascii, the sizes of scalars and list lengths in binary. Errors as
// in readers.h.
absl::StatusOr<PlyHeader> ReadPlyHeader(const std::string& path, std::string_view bytes);

// Indices of elements in the header, and of properties in their element.
struct PlyLayout {
  std::size_t vertex = 0;
  std::size_t face = 0;
  std::array<std::size_t, 3> xyz = {};
  std::size_t indices = 0;  // the list of a face's vertices
  // UV of the vertices: s and t, u and v, texture_u and texture_v, or texture_s and texture_t.
  std::optional<std::array<std::size_t, 2>> vertex_uv;
  // UV of a face's corners, u v u v ...: the list texcoord (MeshLab and related programs).
  std::optional<std::size_t> face_uv;
};

// FILE_MALFORMED: no vertices or faces, or a required property is missing or has the wrong type.
absl::StatusOr<PlyLayout> FindPlyLayout(const std::string& path, const PlyHeader& header);

// Reads values in ascii or binary. Errors as in readers.h.
class PlyValues {
 public:
  // `path`, `bytes` (the whole file) and `header` must outlive the object.
  PlyValues(const std::string& path, std::string_view bytes, const PlyHeader& header);

  bool is_text() const { return encoding_ == PlyEncoding::kAscii; }
  // The line of the last value; 0 in binary files.
  std::int64_t line() const { return is_text() ? cursor_.line() : 0; }

  absl::Status ReadDouble(const ElementName& element, PlyType type, double* value);
  absl::Status ReadInt(const ElementName& element, PlyType type, std::int64_t* value);
  // Skips `count` values.
  absl::Status Skip(const ElementName& element, PlyType type, std::int64_t count);
  // Skips a property (a list with all its values) and appends it to `copy` as in the file: binary values, or ascii ones
  // with a blank after each.
  absl::Status Copy(const ElementName& element, const PlyProperty& property, std::string* copy);
  // Skips a property of any kind.
  absl::Status SkipProperty(const ElementName& element, const PlyProperty& property);

  absl::Status Fault(const std::string& message) const;

 private:
  absl::Status CutOff(const ElementName& element) const;
  absl::Status ReadBits(const ElementName& element, int size, std::uint64_t* bits);
  absl::Status ReadLength(const ElementName& element, const PlyProperty& property, std::int64_t* length);

  const std::string& path_;
  std::string_view bytes_;
  PlyEncoding encoding_;
  TextCursor cursor_;
  std::size_t position_ = 0;  // in a binary file; in text, cursor_ has the position
};

}  // namespace planish
