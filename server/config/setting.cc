#include "server/config/setting.h"

#include "absl/strings/str_cat.h"
#include "yaml-cpp/yaml.h"

namespace planish {
namespace {

// The text, quoted if YAML would read something else without quotes.
std::string Scalar(const std::string& text) {
  YAML::Emitter emitter;
  emitter << text;
  return emitter.c_str();
}

std::string List(const std::vector<std::string>& values) {
  YAML::Emitter emitter;
  emitter << YAML::Flow << values;
  return emitter.c_str();
}

// Replaces control characters, since a line break in a file's name would end the comment.
std::string Comment(std::string text) {
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < ' ') c = '?';
  }
  return text;
}

}  // namespace

std::string ValueText(const Setting& setting) {
  if (setting.values.empty()) return "none";
  return setting.is_list ? List(setting.values) : Scalar(setting.values.front());
}

std::string ToYaml(const std::vector<Setting>& settings) {
  std::string text;
  for (const Setting& setting : settings) {
    if (setting.values.empty()) {
      absl::StrAppend(&text, "# ", setting.key, ": not set\n");
    } else {
      absl::StrAppend(&text, setting.key, ": ", ValueText(setting), "  # ", Comment(setting.source), "\n");
    }
  }
  return text;
}

}  // namespace planish
