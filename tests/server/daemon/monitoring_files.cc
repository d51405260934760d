#include "tests/server/daemon/monitoring_files.h"

#include <yaml-cpp/yaml.h>

#include <functional>
#include <regex>
#include <sstream>
#include <stdexcept>

#include "nlohmann/json.hpp"
#include "tests/testing/files.h"

namespace planish {
namespace {

using nlohmann::json;

std::set<std::string> LabelsIn(const std::string& braces) {
  static const std::regex label(R"re(([a-zA-Z_]+)\s*(=~|!~|!=|=)\s*")re");
  std::set<std::string> labels;
  for (std::sregex_iterator it(braces.begin(), braces.end(), label), end; it != end; ++it) labels.insert((*it)[1]);
  return labels;
}

}  // namespace

std::vector<std::string> ExpressionsOfRules(const std::string& path) {
  std::vector<std::string> expressions;
  for (const YAML::Node& group : YAML::LoadFile(path)["groups"]) {
    for (const YAML::Node& rule : group["rules"]) expressions.push_back(rule["expr"].as<std::string>());
  }
  return expressions;
}

std::vector<std::string> ExpressionsOfDashboard(const std::string& path) {
  std::vector<std::string> expressions;
  const std::function<void(const json&)> look = [&](const json& node) {
    for (const auto& [key, value] : node.items()) {
      if ((key == "expr" || key == "query") && value.is_string()) expressions.push_back(value);
      if (value.is_structured()) look(value);
    }
  };
  look(json::parse(ReadFile(path)));
  return expressions;
}

std::vector<Selector> SelectorsOf(const std::string& expression) {
  static const std::regex selector(R"(\b(planish_[a-z0-9_]+)\s*(\{[^}]*\})?)");
  std::vector<Selector> selectors;
  for (std::sregex_iterator it(expression.begin(), expression.end(), selector), end; it != end; ++it) {
    selectors.push_back({(*it)[1], LabelsIn((*it)[2])});
  }
  return selectors;
}

Scrape ParseScrape(const std::string& text) {
  static const std::regex comment(R"(^# (HELP|TYPE) ([a-z0-9_]+) (.+)$)");
  static const std::regex sample(R"(^([a-z0-9_]+)(\{.*\})? ([-+.0-9eEnaInf]+)$)");
  Scrape scrape;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (std::regex_match(line, match, comment)) {
      (match[1] == "HELP" ? scrape.help : scrape.types)[match[2]] = match[3];
    } else if (std::regex_match(line, match, sample)) {
      const std::set<std::string> labels = LabelsIn(match[2]);
      scrape.samples[match[1]].insert(labels.begin(), labels.end());
      scrape.values[match[1].str() + match[2].str()] = std::stod(match[3]);
    } else {
      throw std::runtime_error("not a line of a scrape: " + line);
    }
  }
  return scrape;
}

}  // namespace planish
