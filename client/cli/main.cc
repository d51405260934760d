// planish: the command line.
#include <malloc.h>

#include <cstdlib>
#include <exception>
#include <iostream>
#include <variant>

#include "client/cli/command_line.h"
#include "client/cli/exit_codes.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"

namespace planish::cli {
namespace {

template <typename CommandArguments>
int RunCommand(const CommandArguments& arguments) {
  if constexpr (requires { arguments.terminal; }) SetColorMode(arguments.terminal.color);
  Interrupts interrupts;
  try {
    return Run(arguments, interrupts);
  } catch (const Error& error) {
    std::cerr << ErrorText(error, "", StderrTerminal());
    if constexpr (requires { arguments.json; }) {
      if (arguments.json) std::cout << ToText(ReportJson(FailureOf(error)));
    }
    return ExitCodeOf(error);
  } catch (const std::exception& exception) {
    std::cerr << "planish: internal error: " << exception.what() << "\n";
    return kFailed;
  }
}

}  // namespace
}  // namespace planish::cli

int main(int argc, char** argv) {
  // Returns the memory of images and mipmaps to the system when they are freed.
  mallopt(M_MMAP_THRESHOLD, 4 << 20);
  // Without this, gRPC would log errors that the command reports itself.
  setenv("GRPC_VERBOSITY", "NONE", 0);
  const planish::cli::ParsedArguments parsed = planish::cli::ParseArguments(argc, argv);
  std::cout << parsed.out << std::flush;
  std::cerr << parsed.err;
  if (!parsed.arguments) return parsed.exit_code;
  return std::visit([](const auto& arguments) { return planish::cli::RunCommand(arguments); }, *parsed.arguments);
}
