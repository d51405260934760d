// CLI11, and a helper for flags that choose a value of an enum. For sources that declare flags.
#pragma once

#include <string>
#include <vector>

#include "CLI/CLI.hpp"

namespace planish::cli {

// Values of an enum by their names, for flags that choose one.
template <typename Enum>
struct Choices {
  std::vector<Enum> values;

  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const Enum value : values) names.emplace_back(ToString(value));
    return names;
  }

  // Adds a flag that accepts these names and sets `target`, an Enum or an optional one.
  template <typename Target>
  CLI::Option* AddTo(CLI::App& app, const std::string& flag, Target& target, const std::string& description) const {
    return app
        .add_option_function<std::string>(
            flag,
            [*this, &target](const std::string& name) {
              for (const Enum value : values) {
                if (name == ToString(value)) target = value;
              }
            },
            description)
        ->check(CLI::IsMember(Names()).description(""))
        ->type_name(CLI::detail::join(Names(), "|"));
  }
};

}  // namespace planish::cli
