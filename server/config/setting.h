// Settings in effect, and their form as a configuration file.
#pragma once

#include <string>
#include <vector>

namespace planish {

struct Setting {
  std::string key;                  // the flag's name without the dashes
  std::vector<std::string> values;  // as a person would write them; empty: not set
  bool is_list = false;
  // Where the values come from: "flag", "environment", "FILE:LINE" or "default".
  std::string source = "default";

  bool SameValue(const Setting& other) const { return values == other.values; }
};

// The values as text: "64", "[a, b]", or "none".
std::string ValueText(const Setting& setting);

// A line "key: value" for each setting, with its source as a comment. Settings that are not set become comments. Read
// as a configuration file, the text gives the same values.
std::string ToYaml(const std::vector<Setting>& settings);

}  // namespace planish
