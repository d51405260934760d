#include "server/config/settings.h"

#include <unistd.h>

#include <algorithm>
#include <utility>

#include "CLI/CLI.hpp"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "server/config/near_name.h"
#include "server/config/settings_file.h"

namespace planish {
namespace {

std::string DidYouMean(const std::string& name) {
  return name.empty() ? "" : absl::StrCat("; did you mean ", name, "?");
}

// The error without the flag that CLI11 puts in front: the caller names the place instead.
std::string Reason(const CLI::Option& option, const CLI::Error& error) {
  const std::string flag = option.get_name() + ": ";
  const std::string text = error.what();
  return absl::StartsWith(text, flag) ? text.substr(flag.size()) : text;
}

}  // namespace

Environment ReadEnvironment(const std::string& prefix) {
  Environment variables;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string text = *entry;
    const std::size_t equals = text.find('=');
    if (equals != std::string::npos && absl::StartsWith(text, prefix)) {
      variables.emplace(text.substr(0, equals), text.substr(equals + 1));
    }
  }
  return variables;
}

Settings::Settings(CLI::App* app, std::string prefix) : app_(app), prefix_(std::move(prefix)) {
  for (CLI::Option* option : app_->get_options()) {
    if (!option->get_configurable() || option->get_lnames().empty()) continue;
    const std::string& key = option->get_lnames().front();
    Entry& entry = entries_[key];
    entry.option = option;
    entry.is_flag = option->get_items_expected_max() == 0;
    entry.is_list = option->get_items_expected_max() > 1;
    // Runs before all other transformations, so it sees the text as written.
    option->transform([&entry](std::string text) {
      entry.texts.push_back(text);
      return text;
    });
    order_.push_back(key);
  }
}

std::vector<std::string> Settings::AddEnvironment(const Environment& environment) {
  std::vector<std::string> errors;
  for (const std::string& key : order_) {
    Entry& entry = entries_.at(key);
    const auto variable = environment.find(Variable(key));
    if (variable == environment.end() || variable->second.empty() || entry.option->count() > 0) continue;
    std::vector<std::string> values = {variable->second};
    if (entry.is_list) {
      values = absl::StrSplit(variable->second, ',', absl::SkipWhitespace());
      for (std::string& value : values) absl::StripAsciiWhitespace(&value);
    }
    const std::string problem = Give(&entry, values, "environment");
    if (!problem.empty()) errors.push_back(absl::StrCat(variable->first, ": ", problem));
  }
  return errors;
}

std::vector<std::string> Settings::AddFile(const std::string& path) {
  SettingsFile file = ReadSettingsFile(path);
  std::vector<std::string> errors = std::move(file.errors);
  for (const FileSetting& setting : file.settings) {
    const auto fail = [&](int line, const std::string& what) {
      errors.push_back(absl::StrCat(path, ":", line, ": ", setting.key, ": ", what));
    };
    const auto found = entries_.find(setting.key);
    if (found == entries_.end()) {
      const CLI::Option* other = app_->get_option_no_throw("--" + setting.key);
      fail(setting.line, other != nullptr ? "is for the command line only"
                                          : "there is no such setting" + DidYouMean(NearName(setting.key, Keys())));
      continue;
    }
    Entry& entry = found->second;
    if (setting.is_list && !entry.is_list) {
      fail(setting.line, "takes one value, not a list");
      continue;
    }
    if (setting.values.empty()) {
      fail(setting.line, "the list is empty");
      continue;
    }
    std::vector<std::string> values;
    for (const FileValue& value : setting.values) values.push_back(value.text);
    // An overridden value must be valid too: it takes effect as soon as the override is removed.
    const bool overridden = entry.option->count() > 0;
    const std::string problem =
        overridden ? Check(&entry, values) : Give(&entry, values, absl::StrCat(path, ":", setting.line));
    if (problem.empty()) continue;
    const auto culprit = std::find_if(setting.values.begin(), setting.values.end(),
                                      [&](const FileValue& value) { return !Check(&entry, {value.text}).empty(); });
    fail(culprit == setting.values.end() ? setting.line : culprit->line, problem);
  }
  return errors;
}

std::vector<std::string> Settings::UnknownVariables(const Environment& environment,
                                                    const std::vector<std::string>& known) const {
  std::vector<std::string> variables = known;
  for (const std::string& key : order_) variables.push_back(Variable(key));
  std::vector<std::string> sentences;
  for (const auto& [name, value] : environment) {
    if (!absl::StartsWith(name, prefix_) || std::count(variables.begin(), variables.end(), name) > 0) continue;
    sentences.push_back(absl::StrCat(name, ": there is no such setting", DidYouMean(NearName(name, variables))));
  }
  return sentences;
}

std::vector<Setting> Settings::InEffect() const {
  std::vector<Setting> settings;
  for (const std::string& key : order_) {
    const Entry& entry = entries_.at(key);
    Setting setting = {key, {}, entry.is_list, "default"};
    if (entry.option->count() > 0) {
      setting.values = entry.texts;
      setting.source = entry.source.empty() ? "flag" : entry.source;
    } else if (entry.is_flag) {
      setting.values = {"false"};
    } else {
      // If the option has no default in words, takes the present value of its variable.
      if (entry.option->get_default_str().empty()) entry.option->capture_default_str();
      std::string text = entry.option->get_default_str();
      if (entry.is_list && absl::StartsWith(text, "[")) {
        setting.values = absl::StrSplit(text.substr(1, text.size() - 2), ',', absl::SkipEmpty());
      } else if (!text.empty()) {
        setting.values = {std::move(text)};
      }
    }
    settings.push_back(std::move(setting));
  }
  return settings;
}

std::vector<std::string> Settings::Keys() const {
  return order_;
}

std::string Settings::Variable(const std::string& key) const {
  return prefix_ + absl::AsciiStrToUpper(absl::StrReplaceAll(key, {{"-", "_"}}));
}

std::string Settings::Give(Entry* entry, const std::vector<std::string>& values, const std::string& source) {
  entry->texts.clear();
  try {
    entry->option->add_result(values);
    entry->option->run_callback();
  } catch (const CLI::Error& error) {
    return Reason(*entry->option, error);
  }
  entry->source = source;
  return "";
}

std::string Settings::Check(Entry* entry, const std::vector<std::string>& values) {
  const std::vector<std::string> texts = entry->texts;
  const std::string source = entry->source;
  entry->option->clear();
  const std::string problem = Give(entry, values, "");
  entry->option->clear();
  entry->texts.clear();
  if (!texts.empty()) Give(entry, texts, source);
  return problem;
}

}  // namespace planish
