// The flags that several commands have, and the subcommands with their own.
#pragma once

#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "client/cli/arguments.h"

namespace planish::cli {

const char* ToString(ColorMode mode);     // "auto", "always", "never"
const char* ToString(ProgressMode mode);  // "auto", "bar", ...

// Values of an enum by their names, for options that choose one.
template <typename Enum>
struct Choices {
  std::vector<Enum> values;

  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const Enum value : values) names.emplace_back(ToString(value));
    return names;
  }

  // Adds an option whose text is checked, and sets `target`, an Enum or an optional one, when it is given.
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

// Each adds flags that set fields of `arguments`, which must outlive the parsing. What depends on the command is said
// by `description` or, about a server, by `otherwise`.
void AddServer(CLI::App& app, Arguments& arguments, const std::string& otherwise);
void AddLabels(CLI::App& app, Arguments& arguments, const std::string& description);
void AddTimeout(CLI::App& app, Arguments& arguments, const std::string& description);
void AddScheduling(CLI::App& app, Scheduling& scheduling);
void AddJson(CLI::App& app, Arguments& arguments);
void AddOutput(CLI::App& app, Arguments& arguments, bool takes_batch);
void AddPreview(CLI::App& app, Arguments& arguments);
void AddTexcoord(CLI::App& app, Arguments& arguments);
void AddOutputTexcoord(CLI::App& app, Arguments& arguments);
// --textures and what goes with it.
void AddTextures(CLI::App& app, Arguments& arguments);
// --merge-materials, --bake, --memory and --allow-outside, which AddTextures() includes.
void AddImageFlags(CLI::App& app, Arguments& arguments);
// --quiet and --color. It begins a group, so it comes last, but for AddProgress(), which adds --progress and --verbose.
void AddTerminal(CLI::App& app, Arguments& arguments);
void AddProgress(CLI::App& app, Arguments& arguments);

// Each adds subcommands.
void DefineUnwrap(CLI::App& app, Arguments& arguments);          // mesh_flags.cc
void DefineMapCommands(CLI::App& app, Arguments& arguments);     // mesh_flags.cc: pack, check, report, inspect
void DefineServerCommands(CLI::App& app, Arguments& arguments);  // flags.cc: estimate, jobs, health, admin, version

}  // namespace planish::cli
