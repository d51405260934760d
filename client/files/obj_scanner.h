// Where the statements and tokens of an OBJ stand: shared by the reader and the writer, so that both see the same ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace planish {

// One statement: a line, with the lines that a '\' at its end joins to it.
struct ObjStatement {
  std::size_t begin = 0;  // offsets in the text; [begin, end) is without the line end, [end, next) is the line end
  std::size_t end = 0;
  std::size_t next = 0;
  std::int64_t line = 0;  // 1-based line of `begin`
};

// Walks over the statements. Line ends are LF or CRLF, or CR in a text without any LF. A UTF-8 byte order mark at the
// start belongs to no statement. A '\' inside a comment joins nothing: comments hold Windows paths.
class ObjScanner {
 public:
  // `text` must outlive the scanner.
  explicit ObjScanner(std::string_view text);

  // False at the end of the text.
  bool Next(ObjStatement* statement);

 private:
  // Offset of the line end at or behind `from`; the size of the text if there is none.
  std::size_t LineEnd(std::size_t from) const;

  std::string_view text_;
  char line_feed_;
  std::size_t position_;
  std::int64_t line_ = 1;
};

// Walks over the tokens of one statement; blanks and line joints separate them, '#' ends the statement.
class ObjTokens {
 public:
  ObjTokens(std::string_view text, const ObjStatement& statement)
      : text_(text), position_(statement.begin), end_(statement.end) {}

  // False behind the last token. Tokens are never empty and point into the text.
  bool Next(std::string_view* token);

 private:
  // Whether a '\' at `position` stands right before a line end.
  bool IsJoint(std::size_t position) const;

  std::string_view text_;
  std::size_t position_;
  std::size_t end_;
};

// Whether a statement with this keyword is a face: "fo" is what "f" was called before version 3 of the format.
inline bool IsObjFace(std::string_view keyword) {
  return keyword == "f" || keyword == "fo";
}

// A corner of an f or l statement, as bytes: "v", "v/vt", "v//vn" or "v/vt/vn".
struct ObjCorner {
  std::string_view vertex;
  std::string_view texture;  // empty: none
  std::string_view after;    // from the second '/' to the end, with the slash: "", "/" or "/vn"
};
ObjCorner SplitObjCorner(std::string_view token);

}  // namespace planish
