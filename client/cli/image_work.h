// Redraws images for commands that need no server.
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

// Calls work(outputs), which redraws images, and shows the progress, an image at a time. The first signal stops the
// drawing; then throws CANCELLED. `name`: the file being processed, shown with the progress. Throws what `work` throws.
void DrawImages(const TerminalArguments& terminal, const std::string& name, Interrupts& interrupts,
                std::vector<OutputOptions> outputs, const std::function<void(const std::vector<OutputOptions>&)>& work);

// For a command that was interrupted before it wrote anything: prints that, and returns the exit code.
int Interrupted(bool json, const Error& error, double seconds);

}  // namespace planish::cli
