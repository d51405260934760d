// `planish admin`: drain, undrain, stats and config.
#pragma once

#include <string>

#include "client/cli/arguments.h"

namespace planish::cli {

class Interrupts;

struct AdminArguments {
  ServerArguments server;
};
struct AdminDrainArguments : AdminArguments {
  bool wait = false;  // return only when no job is left
};
struct AdminUndrainArguments : AdminArguments {};
struct AdminStatsArguments : AdminArguments {
  bool json = false;
};
struct AdminConfigArguments : AdminArguments {};

void AddFlags(CLI::App& app, AdminArguments& arguments);
void AddFlags(CLI::App& app, AdminDrainArguments& arguments);
void AddFlags(CLI::App& app, AdminStatsArguments& arguments);
std::string Check(AdminArguments& arguments);
int Run(const AdminDrainArguments& arguments, Interrupts& interrupts);
int Run(const AdminUndrainArguments& arguments, Interrupts& interrupts);
int Run(const AdminStatsArguments& arguments, Interrupts& interrupts);
int Run(const AdminConfigArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
