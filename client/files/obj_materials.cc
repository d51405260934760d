#include "client/files/obj_materials.h"

#include <algorithm>
#include <optional>

#include "absl/strings/ascii.h"
#include "client/files/obj_scanner.h"
#include "core/base/number.h"

namespace planish {
namespace {

// The keywords of maps, and the meaning of their images. Reflection maps are not listed, as they do not use UV.
struct MapKeyword {
  const char* keyword;
  TextureMeaning meaning;
};
constexpr MapKeyword kMapKeywords[] = {
    {"map_kd", TextureMeaning::kColor},  {"map_ka", TextureMeaning::kColor},   {"map_ks", TextureMeaning::kColor},
    {"map_ke", TextureMeaning::kColor},  {"map_ns", TextureMeaning::kData},    {"map_d", TextureMeaning::kData},
    {"map_tr", TextureMeaning::kData},   {"map_pr", TextureMeaning::kData},    {"map_pm", TextureMeaning::kData},
    {"map_ps", TextureMeaning::kData},   {"map_pc", TextureMeaning::kData},    {"map_pcr", TextureMeaning::kData},
    {"map_bump", TextureMeaning::kData}, {"bump", TextureMeaning::kData},      {"disp", TextureMeaning::kData},
    {"map_disp", TextureMeaning::kData}, {"decal", TextureMeaning::kColor},    {"norm", TextureMeaning::kNormal},
    {"map_kn", TextureMeaning::kNormal}, {"map_norm", TextureMeaning::kNormal}};

// The most words that follow an option: -o, -s and -t have one to three numbers, other options a fixed number of words.
// nullopt: there is no such option.
std::optional<int> WordsOfOption(std::string_view option) {
  for (const std::string_view one :
       {"-blendu", "-blendv", "-boost", "-bm", "-cc", "-clamp", "-imfchan", "-texres", "-type"}) {
    if (option == one) return 1;
  }
  if (option == "-mm") return 2;
  if (option == "-o" || option == "-s" || option == "-t") return 3;
  return std::nullopt;
}

// The word at `*at`; moves `*at` behind it and the following blanks.
std::string_view NextWord(std::string_view text, std::size_t* at) {
  const std::size_t begin = std::min(text.find_first_not_of(" \t", *at), text.size());
  const std::size_t end = std::min(text.find_first_of(" \t", begin), text.size());
  *at = std::min(text.find_first_not_of(" \t", end), text.size());
  return text.substr(begin, end - begin);
}

// Words separated by one blank, as the OBJ reader stores names.
std::string Normalized(std::string_view text) {
  std::string name;
  for (std::size_t at = 0; at < text.size();) {
    const std::string_view word = NextWord(text, &at);
    if (word.empty()) break;
    name.append(name.empty() ? "" : " ").append(word);
  }
  return name;
}

bool ParseMap(std::string_view rest, MtlMap* map) {
  std::size_t at = std::min(rest.find_first_not_of(" \t"), rest.size());
  while (at < rest.size() && rest[at] == '-') {
    const std::size_t begin = at;
    std::size_t next = at;
    const std::string option = absl::AsciiStrToLower(std::string(NextWord(rest, &next)));
    const std::optional<int> words = WordsOfOption(option);
    if (!words) break;  // a file name that begins like an option
    const bool numbers = *words == 3;
    std::array<double, 3> values = {};
    int found = 0;
    std::string_view word;
    for (; found < *words && next < rest.size(); ++found) {
      std::size_t behind = next;
      word = NextWord(rest, &behind);
      if (numbers && !ParseDouble(word, &values[static_cast<std::size_t>(found)])) break;
      next = behind;
    }
    at = next;
    if (option == "-s" || option == "-o") {
      std::array<double, 2>& target = option == "-s" ? map->scale : map->offset;
      for (std::size_t i = 0; i < 2 && static_cast<int>(i) < found; ++i) target[i] = values[i];
    } else if (option == "-clamp") {
      map->clamp = absl::AsciiStrToLower(std::string(word)) == "on";
    } else {
      map->options.append(rest.substr(begin, at - begin));
    }
  }
  map->file = std::string(rest.substr(at));
  absl::StripAsciiWhitespace(&map->file);
  // Exporters on Windows write backslashes.
  std::replace(map->file.begin(), map->file.end(), '\\', '/');
  return !map->file.empty();
}

}  // namespace

MtlFile ParseMtl(std::string_view text) {
  MtlFile file;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find_first_of("\r\n", at), text.size());
    file.lines.emplace_back(text.substr(at, end - at));
    at = end + (text.substr(end, 2) == "\r\n" ? 2 : 1);
  }
  for (std::size_t i = 0; i < file.lines.size(); ++i) {
    const std::string_view line = file.lines[i];
    std::size_t at = 0;
    const std::string keyword = absl::AsciiStrToLower(std::string(NextWord(line, &at)));
    if (keyword == "newmtl") {
      if (!file.materials.empty()) file.materials.back().end_line = i;
      file.materials.push_back({Normalized(line.substr(at)), i, file.lines.size(), {}});
      continue;
    }
    const auto* const known = std::find_if(std::begin(kMapKeywords), std::end(kMapKeywords),
                                           [&](const MapKeyword& each) { return keyword == each.keyword; });
    if (known == std::end(kMapKeywords) || file.materials.empty()) continue;
    MtlMap map;
    std::size_t begin = 0;
    map.keyword = std::string(NextWord(line, &begin));
    map.line = i;
    map.meaning = known->meaning;
    map.may_be_normals = keyword == "map_bump" || keyword == "bump";
    if (ParseMap(line.substr(at), &map)) file.materials.back().maps.push_back(std::move(map));
  }
  for (MtlMaterial& material : file.materials) {
    const bool has_opacity = std::any_of(material.maps.begin(), material.maps.end(), [](const MtlMap& map) {
      const std::string keyword = absl::AsciiStrToLower(map.keyword);
      return keyword == "map_d" || keyword == "map_tr";
    });
    for (MtlMap& map : material.maps) map.has_alpha = has_opacity && map.meaning == TextureMeaning::kColor;
  }
  return file;
}

std::string MtlLine(const MtlMap& map, const std::string& file) {
  return map.keyword + " " + map.options + file;
}

std::vector<std::string> MaterialLibraries(std::string_view obj) {
  std::vector<std::string> names;
  ObjScanner scanner(obj);
  ObjStatement statement;
  while (scanner.Next(&statement)) {
    ObjTokens tokens(obj, statement);
    std::string_view word;
    if (!tokens.Next(&word) || word != "mtllib") continue;
    // The words may be one file name with blanks, or several files. Exporters write the former.
    std::string all;
    while (tokens.Next(&word)) all.append(all.empty() ? "" : " ").append(word);
    if (!all.empty() && std::find(names.begin(), names.end(), all) == names.end()) names.push_back(all);
  }
  return names;
}

}  // namespace planish
