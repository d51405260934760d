// The first word of an OFF file.
#pragma once

#include <string_view>

#include "absl/status/statusor.h"
#include "core/io/text_cursor.h"

namespace planish {

struct OffKeyword {
  std::string_view token;   // "OFF", "STCOFF", ...; empty: left out, the counts come first
  std::size_t letters = 0;  // of the token, without a byte order mark before them
  bool has_uv = false;      // "ST": two texture coordinates end each vertex
};

// Takes OFF and its variants with colours, normals and texture coordinates, all of which follow x y z on a line.
absl::StatusOr<OffKeyword> ReadOffKeyword(TextCursor& cursor);

}  // namespace planish
