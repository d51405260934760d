// What the flags of a command mean together, beyond what each says alone.
#pragma once

#include <string>

#include "client/cli/arguments.h"

namespace planish::cli {

// Decides what depends on several flags and on whether inputs are directories (`batch`, `sheet`), completes the job's
// name, and returns what is wrong, in words; empty if nothing.
std::string CheckTogether(Arguments& arguments);

}  // namespace planish::cli
