// How much room a text takes on a terminal.
#pragma once

#include <string>

namespace planish::cli {

// Columns of a UTF-8 text without its colour codes: two for East Asian wide characters and emoji, none for accents that
// combine with the character before. A byte that is no UTF-8 takes one.
int DisplayWidth(const std::string& text);

// A file's name as it may be shown. Control characters, those that turn the direction of writing, bytes that are no
// UTF-8, and, where `utf8` is false, all that is not ASCII become '?'.
std::string Printable(const std::string& name, bool utf8);

// The same of text that may have several lines.
std::string PrintableLines(const std::string& text, bool utf8);

// `text`, which has no colour codes, or as much of its end as fits `columns` behind an ellipsis.
std::string CutToWidth(const std::string& text, int columns, bool utf8);

// `text` with spaces behind (or, `right`, before) it, to so many columns.
std::string Padded(const std::string& text, int columns, bool right = false);

}  // namespace planish::cli
