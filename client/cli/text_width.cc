#include "client/cli/text_width.h"

#include <utf8proc.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace planish::cli {
namespace {

struct Character {
  std::size_t begin = 0, size = 1;  // bytes
  utf8proc_int32_t code = -1;       // -1: no UTF-8; a byte by itself

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

// A terminal may act on it, or show what follows in another order.
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
  // What takes no column, as an accent, belongs to the character before it and stays only with that.
  std::size_t begin = text.size();
  for (auto it = characters.rbegin(); it != characters.rend() && (left -= it->Width()) >= 0; ++it) {
    if (it->Width() > 0) begin = it->begin;
  }
  return ellipsis + text.substr(begin);
}

std::string Padded(const std::string& text, int columns, bool right) {
  const std::string spaces(static_cast<std::size_t>(std::max(0, columns - DisplayWidth(text))), ' ');
  return right ? spaces + text : text + spaces;
}

}  // namespace planish::cli
