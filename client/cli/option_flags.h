// The flags of UnwrapOptions, as proto/planish/v1/about.proto describes them at the fields.
#pragma once

#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "planish/types.h"

namespace planish::cli {

// Adds the flags of a group of the help to the present group of `app`. `options` must outlive the parsing.
void AddOptionsOfGroup(CLI::App& app, UnwrapOptions& options, const std::string& group);
// Adds the flags of these fields.
void AddOptions(CLI::App& app, UnwrapOptions& options, const std::vector<std::string>& names);

}  // namespace planish::cli
