#pragma once

#include "CLI/App.hpp"
#include "planish/types.h"

namespace planish::cli {

// --priority, --deadline, --budget and --fresh, for every command that creates jobs.
void AddScheduling(CLI::App& app, Scheduling& scheduling);

}  // namespace planish::cli
