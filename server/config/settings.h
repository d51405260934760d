// One table of settings, CLI11's options, filled from three places: the command line over the environment over a file.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "server/config/setting.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace planish {

// Variables by name.
using Environment = std::map<std::string, std::string>;

// Those of this process whose names begin with `prefix`.
Environment ReadEnvironment(const std::string& prefix);

// Every option with a long name that is configurable() is a setting: "--retain-mb" is the key "retain-mb" of the file
// and, with the prefix "PLANISHD_", the variable PLANISHD_RETAIN_MB. A list is one value or a list in the file, and
// separated by commas in a variable. A place that has a setting replaces lists of lower ones too.
//
// Ranges, choices and conversions are those of the options, wherever a value comes from.
class Settings {
 public:
  // After the options of *app were defined and before app->parse(). `app` must outlive this.
  Settings(CLI::App* app, std::string prefix);
  Settings(const Settings&) = delete;
  Settings& operator=(const Settings&) = delete;

  // These two come after app->parse(), in this order. Each gives values to the settings that have none so far and
  // returns what is wrong: "PLANISHD_QUEUE: ...", "FILE:LINE: KEY: ...". After an error *app's variables are of no use.
  // Variables that are empty count as not set.
  std::vector<std::string> AddEnvironment(const Environment& environment);
  std::vector<std::string> AddFile(const std::string& path);

  // Sentences about variables that begin with the prefix and are no setting's; `known` are others' names.
  std::vector<std::string> UnknownVariables(const Environment& environment,
                                            const std::vector<std::string>& known) const;

  // All settings, in the order in which they were defined. What no place has is what the option's variable holds, if it
  // has a default or a value by now.
  std::vector<Setting> InEffect() const;

 private:
  struct Entry {
    CLI::Option* option = nullptr;
    bool is_flag = false;
    bool is_list = false;
    std::vector<std::string> texts;  // as given, before the option's transformations
    std::string source;              // empty: the command line, or nowhere
  };

  std::vector<std::string> Keys() const;
  std::string Variable(const std::string& key) const;
  // Empty, or why the option does not take the values.
  static std::string Give(Entry* entry, const std::vector<std::string>& values, const std::string& source);
  // The same without giving them.
  static std::string Check(Entry* entry, const std::vector<std::string>& values);

  CLI::App* const app_;
  const std::string prefix_;
  std::map<std::string, Entry> entries_;  // by key
  std::vector<std::string> order_;        // keys as defined
};

}  // namespace planish
