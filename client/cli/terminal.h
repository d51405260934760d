// What the terminal behind stderr can do.
#pragma once

#include <string>

namespace planish::cli {

struct Terminal {
  bool is_tty = false;
  bool is_dumb = false;  // no cursor movement: a bar would only make a mess
  bool utf8 = false;
  bool color = false;
  int width = 80;   // columns, as of now
  int height = 24;  // rows
};

// Looks at stderr, $TERM, $NO_COLOR and the locale (LC_ALL, LC_CTYPE, LANG), and obeys SetColorMode().
Terminal StderrTerminal();

// kAuto: colours on a terminal that can show them, unless $NO_COLOR is set.
enum class ColorMode { kAuto, kAlways, kNever };

// Decides for the whole process. main() calls it before anything is printed in colour.
void SetColorMode(ColorMode mode);

// `text` between `color`, an escape sequence, and the one that resets it; as it is where the terminal has no color or
// the text is empty.
std::string Colored(const Terminal& terminal, const char* color, const std::string& text);

}  // namespace planish::cli
