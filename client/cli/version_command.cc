#include <iostream>
#include <optional>

#include "client/cli/commands.h"
#include "client/cli/exit_codes.h"
#include "client/cli/json.h"
#include "client/cli/numbers.h"
#include "client/cli/server_choice.h"
#include "client/cli/summary.h"

namespace planish::cli {
namespace {

void PrintServer(const Capabilities& capabilities, const std::string& where) {
  std::cout << "planishd " << capabilities.version << " (" << where << "; "
            << Counted(capabilities.workers, "worker", "workers") << ", queue of " << capabilities.queue_capacity
            << ", meshes up to " << WithCommas(capabilities.max_mesh_bytes / 1000000) << " MB)\n";
}

}  // namespace

int RunVersion(const Arguments& arguments, Interrupts& interrupts) {
  std::optional<Capabilities> capabilities;
  std::optional<Error> error;
  std::string where = arguments.server;
  try {
    ServerChoice server(arguments.server, arguments.server_flags, interrupts);
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
  if (arguments.server.empty()) {
    std::cerr << "planish: no private server: " << error->what() << "\n";
    return kOk;
  }
  std::cerr << ErrorText(*error, "", StderrTerminal());
  return ExitCodeOf(*error);
}

}  // namespace planish::cli
