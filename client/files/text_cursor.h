// Reads tokens and numbers of ascii PLY, OFF and STL, with their line numbers.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"

namespace planish {

// The element of a value, for messages: "vertex 12".
struct ElementName {
  const char* kind;
  std::int64_t index;  // 0-based
};

class TextCursor {
 public:
  // `path` and `text` must outlive the cursor. With `hash_comments`, '#' begins a comment up to the end of the line.
  TextCursor(const std::string& path, std::string_view text, std::int64_t first_line, bool hash_comments)
      : path_(path), text_(text), line_(first_line), hash_comments_(hash_comments) {}

  // The next token, or an empty one at the end of the text.
  std::string_view Token();
  // The next token, without consuming it.
  std::string_view Peek();
  // The remaining tokens on the line of the last token.
  std::vector<std::string_view> RestOfLine();
  // Skips the rest of the line.
  void SkipLine();
  // Line of the last token.
  std::int64_t line() const { return token_line_; }
  // Bytes not read yet.
  std::int64_t remaining() const { return static_cast<std::int64_t>(text_.size() - position_); }

  // Read the next token as a number, or fail with a message about `element`.
  absl::Status ReadDouble(const ElementName& element, double* value);
  absl::Status ReadInt(const ElementName& element, std::int64_t* value);

  // FILE_MALFORMED at the line of the last token.
  absl::Status Fault(const std::string& message) const;

 private:
  absl::Status NotANumber(const ElementName& element, std::string_view token, const char* wanted) const;
  void SkipBlanks();

  const std::string& path_;
  std::string_view text_;
  std::size_t position_ = 0;
  std::int64_t line_;
  std::int64_t token_line_ = 0;
  bool hash_comments_;
};

}  // namespace planish
