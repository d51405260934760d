// Files of the source tree, and what programs print.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "tests/testing/files.h"
#include "tests/testing/process.h"

namespace planish::deploy {

// Of a file of the source tree, e.g. "deploy/compose.yaml".
std::string ReadSource(const std::string& path);

// "--name" of every flag in the help of `program` (with subcommands, apart by blanks), those of its subcommands not.
std::set<std::string> FlagsOf(const std::string& program);

// "--name" wherever it stands as a word of its own or before "=".
std::set<std::string> FlagsIn(const std::string& text);

}  // namespace planish::deploy
