// `planish inspect`, which needs no server.
#pragma once

#include <string>

#include "client/cli/arguments.h"

namespace planish::cli {

class Interrupts;

struct InspectArguments {
  std::string input;
  int texcoord = 0;
  bool json = false;
  TerminalArguments terminal;
};

void AddFlags(CLI::App& app, InspectArguments& arguments);
std::string Check(InspectArguments& arguments);
int Run(const InspectArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
