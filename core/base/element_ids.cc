#include "core/base/element_ids.h"

#include <charconv>
#include <cstdlib>
#include <regex>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace planish::ids {

std::string IdList(std::span<const std::int64_t> ids) {
  return absl::StrJoin(ids, ",");
}

std::vector<std::int64_t> IdsIn(const std::string& text) {
  std::vector<std::int64_t> found;
  for (const char* at = text.data(); at < text.data() + text.size();) {
    std::int64_t id = 0;
    const auto [end, error] = std::from_chars(*at == '-' ? at + 1 : at, text.data() + text.size(), id);
    if (error == std::errc()) found.push_back(id);
    at = error == std::errc() ? end : at + 1;
  }
  return found;
}

namespace {

// The list without repeated items: several triangles may belong to one polygon of a file.
std::string EachOnce(const std::string& list) {
  std::vector<std::string> items;
  std::set<std::string> seen;
  for (std::string& item : std::vector<std::string>(absl::StrSplit(list, ','))) {
    if (seen.insert(item).second) items.push_back(std::move(item));
  }
  return absl::StrJoin(items, ",");
}

}  // namespace

std::map<std::string, std::string> RenumberMetadata(const std::map<std::string, std::string>& metadata,
                                                    const Renumbering& renumbering) {
  static const auto* vertex_key = new std::regex("vert(ex|ices)|edges?");
  static const auto* face_key = new std::regex("faces?");
  static const auto* id = new std::regex("[0-9]+");
  std::map<std::string, std::string> result = metadata;
  for (auto& [key, value] : result) {
    const bool is_face = std::regex_match(key, *face_key);
    const IdMap& map = is_face ? renumbering.face : renumbering.vertex;
    if (!map || !(is_face || std::regex_match(key, *vertex_key))) continue;
    const std::string text = std::exchange(value, "");
    auto last = text.begin();
    for (std::sregex_iterator match(text.begin(), text.end(), *id), end; match != end; ++match) {
      const std::int64_t mapped = map(std::strtoll(match->str().c_str(), nullptr, 10));
      value.append(last, (*match)[0].first).append(mapped < 0 ? match->str() : std::to_string(mapped));
      last = (*match)[0].second;
    }
    value.append(last, text.end());
    if (is_face) value = EachOnce(value);
  }
  return result;
}

}  // namespace planish::ids
