// `planish estimate`.
#pragma once

#include <cstdint>
#include <string>

#include "client/cli/arguments.h"

namespace planish::cli {

class Interrupts;

struct EstimateArguments {
  std::string input;
  std::int64_t triangles = 0;  // in place of `input`
  ServerArguments server;
  bool json = false;
  TerminalArguments terminal;
};

void AddFlags(CLI::App& app, EstimateArguments& arguments);
std::string Check(EstimateArguments& arguments);
int Run(const EstimateArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
