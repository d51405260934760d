#include "client/src/element_ids.h"

#include <cctype>
#include <charconv>

namespace planish::ids {
namespace {

bool IsDigit(char c) {
  return std::isdigit(static_cast<unsigned char>(c)) != 0;
}
bool IsAlpha(char c) {
  return std::isalpha(static_cast<unsigned char>(c)) != 0;
}

// The id that begins at text[at], mapped; `at` moves past its digits.
std::string TakeId(const std::string& text, std::size_t& at, const IdMap& map) {
  const std::size_t begin = at;
  while (at < text.size() && IsDigit(text[at])) ++at;
  const std::string digits = text.substr(begin, at - begin);
  std::int64_t id = -1;
  const auto parsed = std::from_chars(digits.data(), digits.data() + digits.size(), id);
  if (!map || parsed.ec != std::errc()) return digits;
  const std::int64_t mapped = map(id);
  return mapped < 0 ? digits : std::to_string(mapped);
}

// The map for ids after `word`, and whether a list may follow; null for other words.
const IdMap* MapFor(const std::string& word, const Renumbering& renumbering, bool& is_list) {
  is_list = word == "vertices" || word == "edges" || word == "faces";
  if (word == "vertex" || word == "vertices" || word == "edge" || word == "edges") return &renumbering.vertex;
  if (word == "face" || word == "faces") return &renumbering.face;
  return nullptr;
}

}  // namespace

std::map<std::string, std::string> RenumberMetadata(const std::map<std::string, std::string>& metadata,
                                                    const Renumbering& renumbering) {
  std::map<std::string, std::string> result;
  for (const auto& [key, value] : metadata) {
    bool is_list = false;
    const IdMap* map = MapFor(key, renumbering, is_list);
    std::string renumbered;
    for (std::size_t at = 0; at < value.size();) {
      if (map != nullptr && IsDigit(value[at])) {
        renumbered += TakeId(value, at, *map);
      } else {
        renumbered += value[at++];
      }
    }
    result[key] = renumbered;
  }
  return result;
}

std::string RenumberMessage(const std::string& message, const Renumbering& renumbering) {
  std::string result;
  std::size_t at = 0;
  while (at < message.size()) {
    if (!IsAlpha(message[at])) {
      result += message[at++];
      continue;
    }
    const std::size_t begin = at;
    while (at < message.size() && IsAlpha(message[at])) ++at;
    const std::string word = message.substr(begin, at - begin);
    result += word;
    bool is_list = false;
    const IdMap* map = MapFor(word, renumbering, is_list);
    if (map == nullptr) continue;
    std::string separator = " ";
    while (message.compare(at, separator.size(), separator) == 0 && at + separator.size() < message.size() &&
           IsDigit(message[at + separator.size()])) {
      result += separator;
      at += separator.size();
      result += TakeId(message, at, *map);
      if (at + 1 < message.size() && message[at] == '-' && IsDigit(message[at + 1])) {
        result += message[at++];
        result += TakeId(message, at, *map);
      }
      if (!is_list) break;
      separator = ", ";
    }
  }
  return result;
}

}  // namespace planish::ids
