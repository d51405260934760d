#include <iostream>

#include "client/cli/commands.h"
#include "client/cli/inspection.h"
#include "client/cli/text.h"

namespace planish::cli {

int RunInspect(const Arguments& arguments) {
  const MeshInput input({arguments.input}, arguments.texcoord);
  const Inspection inspection = Inspect(input);
  std::cout << (arguments.json ? ToText(InspectionJson(input, inspection))
                               : PrintableLines(InspectionText(input, inspection), true))
            << std::flush;
  return inspection.refusal ? kFailed : kOk;
}

}  // namespace planish::cli
