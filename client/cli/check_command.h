// `planish check`, which needs no server.
#pragma once

#include <string>

#include "client/cli/arguments.h"
#include "client/cli/check.h"

namespace planish::cli {

class Interrupts;

struct CheckArguments {
  InputArguments inputs;
  Requirements requirements;
  int texture_size = 0;  // 0: the default of MapCheckOptions
  int tiles = 0;
  int texcoord = 0;
  bool all_texcoords = false;  // check every UV set of a file instead of set `texcoord`
  bool json = false;
};

void AddFlags(CLI::App& app, CheckArguments& arguments);
std::string Check(CheckArguments& arguments);
int Run(const CheckArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
