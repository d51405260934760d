#include "client/cli/text.h"

#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>
#include <utf8proc.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace planish::cli {
namespace {

struct Character {
  std::size_t begin = 0, size = 1;  // bytes
  utf8proc_int32_t code = -1;       // -1: a byte that is not UTF-8

  int Width() const { return code < 0 ? 1 : utf8proc_charwidth(code); }
};

Character CharacterAt(const std::string& text, std::size_t at) {
  Character character = {at};
  const auto* bytes = reinterpret_cast<const utf8proc_uint8_t*>(text.data());
  const utf8proc_ssize_t size =
      utf8proc_iterate(bytes + at, static_cast<utf8proc_ssize_t>(text.size() - at), &character.code);
  if (size > 0) {
    character.size = static_cast<std::size_t>(size);
  } else {
    character.code = -1;
  }
  return character;
}

// Whether a terminal may interpret the character, or reorder the text after it.
bool IsControl(const Character& character) {
  const utf8proc_property_t& property = *utf8proc_get_property(character.code);
  switch (property.bidi_class) {
    case UTF8PROC_BIDI_CLASS_LRE:
    case UTF8PROC_BIDI_CLASS_LRO:
    case UTF8PROC_BIDI_CLASS_RLE:
    case UTF8PROC_BIDI_CLASS_RLO:
    case UTF8PROC_BIDI_CLASS_PDF:
    case UTF8PROC_BIDI_CLASS_LRI:
    case UTF8PROC_BIDI_CLASS_RLI:
    case UTF8PROC_BIDI_CLASS_FSI:
    case UTF8PROC_BIDI_CLASS_PDI:
      return true;
    default:
      return property.category == UTF8PROC_CATEGORY_CC || property.category == UTF8PROC_CATEGORY_ZL ||
             property.category == UTF8PROC_CATEGORY_ZP;
  }
}

}  // namespace

int DisplayWidth(const std::string& text) {
  int width = 0;
  for (std::size_t i = 0; i < text.size();) {
    if (text[i] == '\x1b') {
      while (i < text.size() && text[i] != 'm') ++i;
      ++i;
      continue;
    }
    const Character character = CharacterAt(text, i);
    width += character.Width();
    i += character.size;
  }
  return width;
}

std::string Printable(const std::string& name, bool utf8) {
  std::string text;
  for (std::size_t i = 0; i < name.size();) {
    const Character character = CharacterAt(name, i);
    const bool is_shown = character.code >= 0 && !IsControl(character) && (utf8 || character.code < 0x80);
    text += is_shown ? name.substr(i, character.size) : "?";
    i += character.size;
  }
  return text;
}

std::string PrintableLines(const std::string& text, bool utf8) {
  std::string lines;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines += Printable(text.substr(begin, end - begin), utf8);
    if (end < text.size()) lines += '\n';
    begin = end + 1;
  }
  return lines;
}

std::string CutToWidth(const std::string& text, int columns, bool utf8) {
  if (DisplayWidth(text) <= columns) return text;
  const std::string ellipsis = utf8 ? "…" : "..";
  int left = columns - DisplayWidth(ellipsis);
  if (left <= 0) return std::string(static_cast<std::size_t>(std::max(0, columns)), '.');
  std::vector<Character> characters;
  for (std::size_t i = 0; i < text.size(); i += characters.back().size) characters.push_back(CharacterAt(text, i));
  // A character of width 0, such as an accent, stays with the character before it.
  std::size_t begin = text.size();
  for (auto it = characters.rbegin(); it != characters.rend() && (left -= it->Width()) >= 0; ++it) {
    if (it->Width() > 0) begin = it->begin;
  }
  return ellipsis + text.substr(begin);
}

std::string Wrapped(const std::string& text, int columns) {
  constexpr char kIndent[] = "  ";
  std::string wrapped;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::string line;  // not written yet
    bool has_word = false;
    for (std::size_t at = begin; at < end;) {
      // Spaces and the word after them.
      const std::size_t word = std::min(text.find_first_not_of(' ', at), end);
      const std::size_t next = std::min(text.find(' ', word), end);
      const std::string piece = text.substr(at, next - at);
      if (has_word && DisplayWidth(line) + DisplayWidth(piece) > columns) {
        wrapped += line + "\n";
        line = kIndent + text.substr(word, next - word);
      } else {
        line += piece;
      }
      has_word = true;
      at = next;
    }
    wrapped += line;
    if (end < text.size()) wrapped += '\n';
    begin = end + 1;
  }
  return wrapped;
}

std::string Padded(const std::string& text, int columns, bool right) {
  const std::string spaces(static_cast<std::size_t>(std::max(0, columns - DisplayWidth(text))), ' ');
  return right ? spaces + text : text + spaces;
}

namespace {

template <typename... Values>
std::string Format(const char* format, Values... values) {
  char text[64];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

}  // namespace

std::string WithCommas(std::int64_t number) {
  const std::string digits = std::to_string(number);
  std::string text;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    const std::size_t left = digits.size() - i;
    if (i > 0 && left % 3 == 0 && digits[i - 1] != '-') text += ',';
    text += digits[i];
  }
  return text;
}

std::string Scientific(double number) {
  return Format("%.1e", number);
}

std::string Fixed(double number, int digits) {
  return Format("%.*f", digits, number);
}

std::string Significant(double number, int digits) {
  constexpr double kMostWritten = 1e7;
  const std::string text = Format("%.*g", digits, number);
  const double rounded = std::strtod(text.c_str(), nullptr);
  const bool is_large = std::abs(rounded) >= std::pow(10.0, digits) && std::abs(rounded) < kMostWritten;
  return is_large ? Format("%.*f", 0, rounded) : text;
}

std::string Duration(double seconds) {
  if (seconds < 9.995) return Format("%.2f s", seconds);
  if (seconds < 59.95) return Format("%.1f s", seconds);
  const long whole = static_cast<long>(seconds + 0.5);
  if (whole < 3600) return Format("%ld:%02ld", whole / 60, whole % 60);
  return Format("%ld:%02ld:%02ld", whole / 3600, whole / 60 % 60, whole % 60);
}

std::string Megabytes(std::int64_t bytes) {
  const double megabytes = 1e-6 * static_cast<double>(bytes);
  return (megabytes < 10 ? Fixed(megabytes, 1) : WithCommas(std::llround(megabytes))) + " MB";
}

std::string Counted(std::int64_t count, const std::string& one, const std::string& many) {
  return WithCommas(count) + " " + (count == 1 ? one : many);
}

namespace {

std::string Environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

bool LocaleIsUtf8() {
  for (const char* name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    const std::string locale = Environment(name);
    if (locale.empty()) continue;
    return strcasestr(locale.c_str(), "UTF-8") != nullptr || strcasestr(locale.c_str(), "UTF8") != nullptr;
  }
  return false;
}

ColorMode color_mode = ColorMode::kAuto;

}  // namespace

void SetColorMode(ColorMode mode) {
  color_mode = mode;
}

Terminal StderrTerminal() {
  Terminal terminal;
  const std::string term = Environment("TERM");
  terminal.is_tty = isatty(STDERR_FILENO) == 1;
  terminal.is_dumb = term.empty() || term == "dumb";
  terminal.utf8 = LocaleIsUtf8();
  terminal.color = color_mode == ColorMode::kAuto
                       ? terminal.is_tty && !terminal.is_dumb && Environment("NO_COLOR").empty()
                       : color_mode == ColorMode::kAlways;
  winsize size = {};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0) {
    if (size.ws_col > 0) terminal.width = size.ws_col;
    if (size.ws_row > 0) terminal.height = size.ws_row;
  }
  return terminal;
}

std::string ForTerminal(const std::string& text, const Terminal& terminal) {
  return terminal.is_tty ? Wrapped(text, terminal.width) : text;
}

std::string Colored(const Terminal& terminal, const char* color, const std::string& text) {
  return terminal.color && !text.empty() ? color + text + "\x1b[0m" : text;
}

}  // namespace planish::cli
