#include <iostream>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/exit_codes.h"
#include "client/cli/json.h"
#include "client/cli/mesh_input.h"
#include "client/cli/numbers.h"
#include "client/cli/server_choice.h"
#include "client/cli/text_width.h"

namespace planish::cli {
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
    std::cout << "refused  " << Printable(estimate.refusal->what(), true) << " [" << estimate.refusal->reason()
              << "]\n";
  } else {
    std::cout << "accepted if sent now\n";
  }
  std::cout << std::flush;
}

}  // namespace

int RunEstimate(const Arguments& arguments, Interrupts& interrupts) {
  std::optional<MeshInput> input;
  if (!arguments.input.empty()) input.emplace(std::vector<std::string>{arguments.input}, arguments.texcoord);
  ServerChoice server(arguments.server, arguments.server_flags, interrupts);
  const JobEstimate estimate = input ? server.client().Estimate(input->view(), arguments.options)
                                     : server.client().Estimate(arguments.triangles, 0, arguments.options);
  if (arguments.json) {
    std::cout << ToText(ToJson(estimate)) << std::flush;
  } else {
    Print(estimate);
  }
  return estimate.refusal ? kFailed : kOk;
}

}  // namespace planish::cli
