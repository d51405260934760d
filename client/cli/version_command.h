// `planish version`.
#pragma once

#include "client/cli/arguments.h"

namespace planish::cli {

class Interrupts;

struct VersionArguments {
  ServerArguments server;
  bool json = false;
  TerminalArguments terminal;
};

void AddFlags(CLI::App& app, VersionArguments& arguments);
int Run(const VersionArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
