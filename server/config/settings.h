// Fills one table of settings, CLI11's options, from three sources: the command line, which overrides the environment,
// which overrides a file.
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

// The variables of this process whose names begin with `prefix`.
Environment ReadEnvironment(const std::string& prefix);

// Every option with a long name that is configurable() is a setting: "--retain-mb" is the key "retain-mb" of the file
// and, with the prefix "PLANISHD_", the variable PLANISHD_RETAIN_MB. An option that takes a list is given one value or
// a list in the file, and values separated by commas in a variable. A list from one source replaces that of a lower
// source; they are not joined.
//
// The options' ranges, choices and conversions apply to values from every source.
class Settings {
 public:
  // Call it after the options of *app were defined and before app->parse(). `app` must outlive this object.
  Settings(CLI::App* app, std::string prefix);
  Settings(const Settings&) = delete;
  Settings& operator=(const Settings&) = delete;

  // Call these two after app->parse(), in this order. Each gives values to settings that have none so far, and returns
  // the errors: "PLANISHD_QUEUE: ...", "FILE:LINE: KEY: ...". After an error the values in *app must not be used. Empty
  // variables count as not set.
  std::vector<std::string> AddEnvironment(const Environment& environment);
  std::vector<std::string> AddFile(const std::string& path);

  // A warning for each variable that begins with the prefix but is not a setting. `known`: names of other valid
  // variables.
  std::vector<std::string> UnknownVariables(const Environment& environment,
                                            const std::vector<std::string>& known) const;

  // All settings, in the order of their definition. A setting that no source gave has the option's default, or else the
  // present value of the option's variable.
  std::vector<Setting> InEffect() const;

 private:
  struct Entry {
    CLI::Option* option = nullptr;
    bool is_flag = false;
    bool is_list = false;
    std::vector<std::string> texts;  // as given, before the option's transformations
    std::string source;              // empty: the command line, or none
  };

  std::vector<std::string> Keys() const;
  std::string Variable(const std::string& key) const;
  // Gives the values to the option. Returns why it refuses them, or an empty string.
  static std::string Give(Entry* entry, const std::vector<std::string>& values, const std::string& source);
  // Like Give(), but only checks the values.
  static std::string Check(Entry* entry, const std::vector<std::string>& values);

  CLI::App* const app_;
  const std::string prefix_;
  std::map<std::string, Entry> entries_;  // by key
  std::vector<std::string> order_;        // keys in the order of their definition
};

}  // namespace planish
