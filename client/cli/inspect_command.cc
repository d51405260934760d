#include "client/cli/inspect_command.h"

#include <iostream>

#include "client/cli/exit_codes.h"
#include "client/cli/flags.h"
#include "client/cli/inspection.h"
#include "client/cli/mesh_input.h"
#include "client/cli/results.h"
#include "client/cli/text.h"

namespace planish::cli {

void AddFlags(CLI::App& app, InspectArguments& arguments) {
  app.footer(
      "Needs no server. Exit codes: 0 unwrap would take the mesh, 1 it would refuse it, 2 bad usage or unreadable "
      "file.");
  app.add_option("IN", arguments.input, "Mesh file, as for unwrap")->required()->type_name("");
  AddTexcoord(app, arguments.texcoord);
  AddJson(app, arguments.json);
  AddTerminal(app, arguments.terminal);
}

std::string Check(InspectArguments& arguments) {
  return CheckTexcoord(arguments.texcoord, arguments.input);
}

int Run(const InspectArguments& arguments, Interrupts& /*interrupts*/) {
  const MeshInput input({arguments.input}, arguments.texcoord);
  const Inspection inspection = Inspect(input);
  std::cout << (arguments.json ? ToText(InspectionJson(input, inspection))
                               : PrintableLines(InspectionText(input, inspection), true))
            << std::flush;
  return inspection.refusal ? kFailed : kOk;
}

}  // namespace planish::cli
