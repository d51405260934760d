#include "tests/e2e/command.h"

#include <utility>

namespace planish::testing {
namespace {

std::vector<std::string> Words(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), PLANISH_COMMAND);
  return arguments;
}

ProcessOptions Options(std::map<std::string, std::string> environment) {
  environment.try_emplace("PLANISHD", PLANISHD_COMMAND);
  return {.environment = std::move(environment), .without = "PLANISH"};
}

}  // namespace

Command::Command(std::vector<std::string> arguments, std::map<std::string, std::string> environment)
    : Process(Words(std::move(arguments)), Options(std::move(environment))) {}

Outcome Planish(const std::vector<std::string>& arguments, const std::map<std::string, std::string>& environment) {
  return Command(arguments, environment).Wait();
}

PrivateServerOptions ServerOptions(int workers, const std::vector<std::string>& more) {
  PrivateServerOptions options;
  options.executable = PLANISHD_COMMAND;
  options.workers = workers;
  options.extra_arguments = more;
  return options;
}

}  // namespace planish::testing
