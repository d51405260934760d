// The flags of UnwrapOptions, made from the annotations of the fields (proto/planish/v1/about.proto).
#pragma once

#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "planish/types.h"

namespace planish::cli {

// Adds the flags with About.group = `group` to the present group of `app`'s help. Parsing sets `options`, which must
// outlive it.
void AddOptionsOfGroup(CLI::App& app, UnwrapOptions& options, const std::string& group);
// Adds the flags of the fields with these names.
void AddOptions(CLI::App& app, UnwrapOptions& options, const std::vector<std::string>& names);

}  // namespace planish::cli
