// Settings as they are in effect, and their form as a configuration file.
#pragma once

#include <string>
#include <vector>

namespace planish {

struct Setting {
  std::string key;                  // the flag's name without the dashes
  std::vector<std::string> values;  // as one would write them; none: not set
  bool is_list = false;
  // Where it comes from: "flag", "environment", "FILE:LINE" or "default".
  std::string source = "default";

  bool SameValue(const Setting& other) const { return values == other.values; }
};

// "64", "[a, b]", or "none".
std::string ValueText(const Setting& setting);

// One "key: value" a line, each with its source as a comment; those that are not set are comments altogether. Read as a
// configuration file it gives the same values.
std::string ToYaml(const std::vector<Setting>& settings);

}  // namespace planish
