// Options whose values are words.
#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "CLI/CLI.hpp"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace planish {

// Adds an option whose value is one of `choices`. Its default is the value of `target`.
template <class Value>
void AddChoice(CLI::App* app, const std::string& flag, Value* target,
               const std::vector<std::pair<std::string, Value>>& choices, const std::string& description) {
  std::vector<std::string> words;
  std::string otherwise;
  for (const auto& [word, value] : choices) {
    words.push_back(word);
    if (value == *target) otherwise = word;
  }
  const auto is_word = [words](const std::string& text) {
    const bool known = std::find(words.begin(), words.end(), text) != words.end();
    return known ? std::string() : absl::StrCat(text, " is not one of ", absl::StrJoin(words, ", "));
  };
  app->add_option_function<std::string>(
         flag,
         [target, choices](const std::string& text) {
           for (const auto& [word, value] : choices) {
             if (word == text) *target = value;
           }
         },
         description)
      ->check(CLI::Validator(is_word, ""))
      ->default_str(otherwise)
      ->type_name(absl::StrJoin(words, "|"));
}

}  // namespace planish
