#include "client/cli/text_width.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace planish::cli {
namespace {

// Code points that terminals show two columns wide (the blocks of Unicode's EastAsianWidth W and F, and emoji).
constexpr std::array<std::array<std::uint32_t, 2>, 10> kWide = {{{0x1100, 0x115F},
                                                                 {0x2E80, 0x303E},
                                                                 {0x3041, 0xA4CF},
                                                                 {0xAC00, 0xD7A3},
                                                                 {0xF900, 0xFAFF},
                                                                 {0xFE30, 0xFE6F},
                                                                 {0xFF00, 0xFF60},
                                                                 {0xFFE0, 0xFFE6},
                                                                 {0x1F300, 0x1FAFF},
                                                                 {0x20000, 0x3FFFD}}};

bool IsContinuation(char byte) {
  return (static_cast<unsigned char>(byte) & 0xC0) == 0x80;
}

// Bytes of the character that begins at `at`.
std::size_t LengthAt(const std::string& text, std::size_t at) {
  std::size_t end = at + 1;
  while (end < text.size() && IsContinuation(text[end])) ++end;
  return end - at;
}

int WidthAt(const std::string& text, std::size_t at, std::size_t length) {
  const auto first = static_cast<unsigned char>(text[at]);
  std::uint32_t code = length == 3 ? first & 0x0Fu : length == 4 ? first & 0x07u : first;
  if (length < 3) return 1;
  for (std::size_t i = 1; i < length; ++i) code = code << 6 | (static_cast<unsigned char>(text[at + i]) & 0x3Fu);
  const bool wide = std::any_of(kWide.begin(), kWide.end(),
                                [code](const auto& range) { return code >= range[0] && code <= range[1]; });
  return wide ? 2 : 1;
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
    const std::size_t length = LengthAt(text, i);
    width += WidthAt(text, i, length);
    i += length;
  }
  return width;
}

std::string Printable(const std::string& name, bool utf8) {
  std::string text;
  for (std::size_t i = 0; i < name.size(); i += LengthAt(name, i)) {
    const auto byte = static_cast<unsigned char>(name[i]);
    const bool is_ascii = byte < 0x80;
    const bool is_control = byte < 0x20 || byte == 0x7F;
    // U+0080 to U+009F are control characters as well.
    const bool is_c1 = byte == 0xC2 && i + 1 < name.size() && static_cast<unsigned char>(name[i + 1]) < 0xA0;
    const bool is_torn = !is_ascii && (LengthAt(name, i) == 1 || IsContinuation(name[i]));
    text += is_control || is_c1 || is_torn || (!is_ascii && !utf8) ? "?" : name.substr(i, LengthAt(name, i));
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
  std::size_t begin = text.size();
  while (begin > 0) {
    std::size_t before = begin - 1;
    while (before > 0 && IsContinuation(text[before])) --before;
    left -= WidthAt(text, before, begin - before);
    if (left < 0) break;
    begin = before;
  }
  return ellipsis + text.substr(begin);
}

std::string Padded(const std::string& text, int columns, bool right) {
  const std::string spaces(static_cast<std::size_t>(std::max(0, columns - DisplayWidth(text))), ' ');
  return right ? spaces + text : text + spaces;
}

}  // namespace planish::cli
