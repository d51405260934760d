#include "client/cli/scheduling_flags.h"

#include <string>

#include "CLI/CLI.hpp"

namespace planish::cli {

void AddScheduling(CLI::App& app, Scheduling& scheduling) {
  app.add_option_function<std::string>(
         "--priority",
         [&scheduling](const std::string& name) {
           for (const Priority priority : {Priority::kLow, Priority::kNormal, Priority::kHigh}) {
             if (name == ToString(priority)) scheduling.priority = priority;
           }
         },
         "Which waiting job is next: high counts as 10 minutes older, low as 10 minutes younger [normal]")
      ->check(CLI::IsMember({"low", "normal", "high"}).description(""))
      ->type_name("low|normal|high");
  app.add_option("--deadline", scheduling.timeout_seconds,
                 "Let the server fail the job if it has not ended so long after it was accepted, whoever waits for it")
      ->check(CLI::Validator(CLI::PositiveNumber).description(""))
      ->type_name("SECONDS");
  app.add_option("--budget", scheduling.compute_budget_seconds,
                 "Stop the job when it has run for so long, and take the best map that it has then")
      ->check(CLI::Validator(CLI::PositiveNumber).description(""))
      ->type_name("SECONDS");
  app.add_flag("--fresh", scheduling.fresh, "Compute anew even if the server has the result for this mesh already");
}

}  // namespace planish::cli
