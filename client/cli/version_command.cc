#include "client/cli/version_command.h"

#include <iostream>
#include <optional>
#include <string>

#include "client/cli/exit_codes.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "planish/error.h"

namespace planish::cli {

void AddFlags(CLI::App& app, VersionArguments& arguments) {
  AddServer(app, arguments.server, "without it, the private server's version is shown");
  AddJson(app, arguments.json);
  AddTerminal(app, arguments.terminal);
}

namespace {

void PrintServer(const Capabilities& capabilities, const std::string& where) {
  std::cout << "planishd " << capabilities.version << " (" << where << "; "
            << Counted(capabilities.workers, "worker", "workers") << ", queue of " << capabilities.queue_capacity
            << ", meshes up to " << WithCommas(capabilities.max_mesh_bytes / 1000000) << " MB)\n";
}

}  // namespace

int Run(const VersionArguments& arguments, Interrupts& interrupts) {
  std::optional<Capabilities> capabilities;
  std::optional<Error> error;
  std::string where = arguments.server.address;
  try {
    ServerChoice server(arguments.server, interrupts);
    if (server.private_server() != nullptr) where = server.private_server()->executable();
    capabilities = server.client().GetCapabilities();
  } catch (const Error& e) {
    error = e;
  }
  if (arguments.json) {
    Json json = {{"client", {{"version", Version()}}}};
    if (capabilities) {
      json["server"] = ToJson(*capabilities);
      json["server"]["address"] = where;
    }
    std::cout << ToText(json) << std::flush;
  } else {
    std::cout << "planish " << Version() << "\n";
    if (capabilities) PrintServer(*capabilities, where);
    std::cout << std::flush;
  }
  if (!error) return kOk;
  // Who named a server wants to know that it does not answer; a missing private one is no fault of the client.
  if (arguments.server.address.empty()) {
    std::cerr << "planish: no private server: " << error->what() << "\n";
    return kOk;
  }
  std::cerr << ErrorText(*error, "", StderrTerminal());
  return ExitCodeOf(*error);
}

}  // namespace planish::cli
