#include "tests/deploy/yaml_files.h"

#include <map>

#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"
#include "gtest/gtest.h"

namespace planish::deploy {

std::vector<YAML::Node> Objects::OfKind(const std::string& kind) const {
  std::vector<YAML::Node> found;
  for (const YAML::Node& object : all) {
    if (object["kind"].as<std::string>() == kind) found.push_back(object);
  }
  return found;
}

YAML::Node Objects::Get(const std::string& kind, const std::string& name) const {
  for (const YAML::Node& object : OfKind(kind)) {
    const std::string its = TextAt(object, "/metadata/name");
    if (its == name || its.starts_with(name + "-")) return object;
  }
  ADD_FAILURE() << "there is no " << kind << " " << name;
  return {};
}

Objects ParseObjects(const std::string& text) {
  Objects objects;
  for (const YAML::Node& object : YAML::LoadAll(text)) {
    if (object.IsMap()) objects.all.push_back(object);
  }
  return objects;
}

YAML::Node At(YAML::Node node, const std::string& path) {
  for (const absl::string_view part : absl::StrSplit(path, '/', absl::SkipEmpty())) {
    const std::string key(part);
    std::size_t index = 0;
    if (node.IsSequence() && absl::SimpleAtoi(key, &index)) {
      node.reset(node[index]);
    } else if (node.IsMap()) {
      node.reset(node[key]);
    } else {
      return YAML::Node(YAML::NodeType::Undefined);
    }
    if (!node.IsDefined()) return node;
  }
  return node;
}

std::string TextAt(const YAML::Node& node, const std::string& path) {
  const YAML::Node found = At(node, path);
  return found.IsDefined() && found.IsScalar() ? found.as<std::string>() : "";
}

double Bytes(const std::string& quantity) {
  static const std::map<std::string, double> units = {{"", 1}, {"Ki", 1024.0}, {"Mi", 1048576.0}, {"Gi", 1073741824.0}};
  const std::size_t end = quantity.find_first_not_of("0123456789");
  const auto unit = units.find(end == std::string::npos ? "" : quantity.substr(end));
  EXPECT_TRUE(unit != units.end()) << quantity;
  return unit == units.end() ? 0 : std::stod(quantity.substr(0, end)) * unit->second;
}

}  // namespace planish::deploy
