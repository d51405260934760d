// `planish health`.
#pragma once

#include <string>

#include "client/cli/arguments.h"

namespace planish::cli {

class Interrupts;

struct HealthArguments {
  std::string url = "http://127.0.0.1:9741/readyz";
};

void AddFlags(CLI::App& app, HealthArguments& arguments);
std::string Check(HealthArguments& arguments);
int Run(const HealthArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
