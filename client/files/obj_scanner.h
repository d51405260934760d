// Finds the statements and tokens of an OBJ. Shared by the reader and the writer, so that both find the same ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace planish {

// One statement: a line, joined with the next one if it ends in '\'.
struct ObjStatement {
  std::size_t begin = 0;  // offsets in the text; [begin, end) excludes the line end, [end, next) is the line end
  std::size_t end = 0;
  std::size_t next = 0;
  std::int64_t line = 0;  // 1-based line of `begin`
};

// Iterates over the statements. Line ends are LF or CRLF, or CR in a text without any LF. A UTF-8 byte order mark at
// the start belongs to no statement. A '\' inside a comment joins nothing: comments contain Windows paths.
class ObjScanner {
 public:
  // `text` must outlive the scanner.
  explicit ObjScanner(std::string_view text);

  // False at the end of the text.
  bool Next(ObjStatement* statement);

 private:
  // Offset of the first line end from `from` on; the size of the text if there is none.
  std::size_t LineEnd(std::size_t from) const;

  std::string_view text_;
  char line_feed_;
  std::size_t position_;
  std::int64_t line_ = 1;
};

// Iterates over the tokens of one statement. Blanks and line joints separate them, '#' ends the statement.
class ObjTokens {
 public:
  ObjTokens(std::string_view text, const ObjStatement& statement)
      : text_(text), position_(statement.begin), end_(statement.end) {}

  // False after the last token. Tokens are never empty and point into the text.
  bool Next(std::string_view* token);

 private:
  // Whether a '\' at `position` is right before a line end.
  bool IsJoint(std::size_t position) const;

  std::string_view text_;
  std::size_t position_;
  std::size_t end_;
};

// Whether a statement with this keyword is a face; before version 3 of the format "f" was called "fo".
inline bool IsObjFace(std::string_view keyword) {
  return keyword == "f" || keyword == "fo";
}

// A corner of an f or l statement, as text: "v", "v/vt", "v//vn" or "v/vt/vn".
struct ObjCorner {
  std::string_view vertex;
  std::string_view texture;  // empty: none
  std::string_view after;    // from the second '/' to the end, with the slash: "", "/" or "/vn"
};
ObjCorner SplitObjCorner(std::string_view token);

}  // namespace planish
