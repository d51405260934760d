// Helpers for what commands print: the width of text on a terminal, numbers for people, the terminal's properties.
#pragma once

#include <cstdint>
#include <string>

namespace planish::cli {

// ---- Text on a terminal

// The number of columns of a UTF-8 text; colour codes do not count. East Asian wide characters and emoji have two
// columns, accents that combine with the character before have none, and a byte that is not UTF-8 has one.
int DisplayWidth(const std::string& text);

// A printable form of a file name. Control characters, bidirectional controls, bytes that are not UTF-8, and, unless
// `utf8`, non-ASCII characters become '?'.
std::string Printable(const std::string& name, bool utf8);

// Printable() for each line of a text; line breaks stay.
std::string PrintableLines(const std::string& text, bool utf8);

// If `text` is wider than `columns`: an ellipsis and the end of the text; otherwise `text`. It must have no colour
// codes.
std::string CutToWidth(const std::string& text, int columns, bool utf8);

// Breaks lines of `text` between words, so that lines are at most `columns` wide unless a single word is wider.
// Continuation lines are indented by two columns.
std::string Wrapped(const std::string& text, int columns);

// `text` filled up with spaces to `columns`: after the text or, with `right`, before it.
std::string Padded(const std::string& text, int columns, bool right = false);

// ---- Numbers for people

std::string WithCommas(std::int64_t number);         // "23,062"
std::string Scientific(double number);               // "3.2e-05"
std::string Fixed(double number, int digits);        // "1.25"
std::string Significant(double number, int digits);  // "3.02e+07", "30200", "341", "0.0125"
std::string Duration(double seconds);                // "0.42 s", "12.3 s", "3:05", "1:02:09"
std::string Megabytes(std::int64_t bytes);           // "0.3 MB", "1,204 MB"
std::string Counted(std::int64_t count, const std::string& one, const std::string& many);  // "1 face", "2,000 faces"

// ---- The terminal behind stderr

struct Terminal {
  bool is_tty = false;
  bool is_dumb = false;  // the cursor cannot be moved, so a bar cannot be repainted
  bool utf8 = false;
  bool color = false;
  int width = 80;   // columns, as of now
  int height = 24;  // rows
};

// Looks at stderr, $TERM, $NO_COLOR and the locale (LC_ALL, LC_CTYPE, LANG), and obeys SetColorMode().
Terminal StderrTerminal();

// kAuto: colours on a terminal that can show them, unless $NO_COLOR is set.
enum class ColorMode { kAuto, kAlways, kNever };

// Wraps `text` to the terminal's width. Text for pipes and files is unchanged.
std::string ForTerminal(const std::string& text, const Terminal& terminal);

// Sets the mode of the whole process. main() calls it before anything is printed in colour.
void SetColorMode(ColorMode mode);

// `text` between the escape sequence `color` and the sequence that resets it. Unchanged if the terminal has no color or
// the text is empty.
std::string Colored(const Terminal& terminal, const char* color, const std::string& text);

}  // namespace planish::cli
