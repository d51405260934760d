#include "client/cli/estimate_command.h"

#include <cstdint>
#include <iostream>
#include <optional>
#include <string>

#include "client/cli/exit_codes.h"
#include "client/cli/flags.h"
#include "client/cli/mesh_input.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"

namespace planish::cli {

void AddFlags(CLI::App& app, EstimateArguments& arguments) {
  app.footer(
      "Estimates memory while the job runs, run time on one core and time in the queue, from the size of the mesh. "
      "Exit codes: 0 the\nserver would accept the job now, 1 it would not, 2 bad usage or unreadable file, 3 server "
      "unreachable.");
  app.add_option("IN", arguments.input, "Mesh file, as for unwrap")->type_name("");
  app.add_option("--triangles", arguments.triangles, "Estimate for a mesh of N triangles instead of a file")
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{1} << 40).description(""))
      ->type_name("N");
  AddServer(app, arguments.server, "without it a private server is started");
  AddJson(app, arguments.json);
  AddTerminal(app, arguments.terminal);
}

std::string Check(EstimateArguments& arguments) {
  if (arguments.input.empty() != (arguments.triangles == 0)) return "";
  return "estimate what? Give a mesh file, or --triangles=N";
}

namespace {

void Print(const JobEstimate& estimate) {
  std::cout << "size     " << Counted(estimate.triangles, "triangle", "triangles") << ", "
            << Counted(estimate.vertices, "vertex", "vertices") << "\n"
            << "memory   " << Megabytes(estimate.memory_bytes) << " while it runs\n"
            << "run      about " << Duration(estimate.run_time.count()) << " on one core\n"
            << "wait     "
            << (estimate.queue_time.count() > 0 ? "about " + Duration(estimate.queue_time.count()) + " in the queue"
                                                : "none")
            << "\n";
  if (estimate.refusal) {
    std::cout << "refused  " << Printable(ErrorLine(*estimate.refusal), true) << "\n";
  } else {
    std::cout << "accepted if sent now\n";
  }
  std::cout << std::flush;
}

}  // namespace

int Run(const EstimateArguments& arguments, Interrupts& interrupts) {
  std::optional<MeshInput> input;
  if (!arguments.input.empty()) input.emplace(arguments.input);
  ServerChoice server(arguments.server, interrupts);
  const JobEstimate estimate = input ? server.client().Estimate(input->view(), UnwrapOptions())
                                     : server.client().Estimate(arguments.triangles, 0, UnwrapOptions());
  if (arguments.json) {
    std::cout << ToText(ToJson(estimate)) << std::flush;
  } else {
    Print(estimate);
  }
  return estimate.refusal ? kFailed : kOk;
}

}  // namespace planish::cli
