// Images drawn by commands that ask no server.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/session.h"
#include "client/files/mesh_output.h"
#include "planish/error.h"

namespace planish::cli {

// Does `work`, which draws the images of `outputs`, shows each of them on the way, and ends with CANCELLED when the
// first signal comes. `name`: of the file that is worked on. Throws what `work` throws.
void DrawImages(const TerminalArguments& terminal, const std::string& name, Interrupts& interrupts,
                std::vector<OutputOptions> outputs, const std::function<void(const std::vector<OutputOptions>&)>& work);

// Ends a command that was interrupted before it wrote anything: prints that, and returns the exit code.
int Interrupted(bool json, const Error& error, double seconds);

}  // namespace planish::cli
