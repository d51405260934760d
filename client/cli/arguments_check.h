// What the flags of a command line say together.
#pragma once

#include <string>

#include "client/cli/arguments.h"

namespace planish::cli {

// Decides what depends on several flags and on whether inputs are directories (`batch`), completes the job's name, and
// returns what is wrong, in words; empty if nothing.
std::string CheckTogether(Arguments& arguments);

}  // namespace planish::cli
