// `planish pack`, which needs no server.
#pragma once

#include <map>
#include <string>

#include "client/cli/arguments.h"
#include "planish/types.h"

namespace planish::cli {

class Interrupts;

struct PackArguments {
  std::string input;
  int texcoord = 0;
  OutputArguments output;
  UnwrapOptions options;                           // only the options of the atlas
  bool keep_density = false;                       // islands keep their sizes relative to each other
  std::map<std::string, double> material_weights;  // factor of the texel density by material, in [0.01, 100]
  bool json = false;
  TerminalArguments terminal;
};

void AddFlags(CLI::App& app, PackArguments& arguments);
std::string Check(PackArguments& arguments);
int Run(const PackArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
