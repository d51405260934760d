// The values behind the header of a PLY file, one after another.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "core/io/ply_header.h"
#include "core/io/text_cursor.h"

namespace planish {

// In ascii or binary alike. Errors as in readers.h.
class PlyValues {
 public:
  // `path`, `bytes` (the whole file) and `header` must outlive the object.
  PlyValues(const std::string& path, std::string_view bytes, const PlyHeader& header);

  bool is_text() const { return encoding_ == PlyEncoding::kAscii; }
  // Of the last value; 0 in binary files.
  std::int64_t line() const { return is_text() ? cursor_.line() : 0; }

  absl::Status ReadDouble(const ElementName& element, PlyType type, double* value);
  absl::Status ReadInt(const ElementName& element, PlyType type, std::int64_t* value);
  // Skips `count` values, whatever they are.
  absl::Status Skip(const ElementName& element, PlyType type, std::int64_t count);
  // Skips a property, a list with all its values, and appends it to `copy` as it is in the file: binary values, or
  // ascii ones with a blank behind each.
  absl::Status Copy(const ElementName& element, const PlyProperty& property, std::string* copy);
  // Skips a property, whatever it is.
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
  std::size_t position_ = 0;  // binary only; the cursor has its own
};

}  // namespace planish
