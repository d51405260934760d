// The page that `unwrap --report` writes.
#pragma once

#include <string>

#include "client/cli/arguments.h"
#include "client/cli/mesh_input.h"
#include "client/cli/report_page.h"

namespace planish::cli {

// The map of `result`, whose warnings have the file's ids, and beside it the UV that `input` had, if all of it has
// some.
std::string UnwrapReport(const MeshInput& input, const UnwrapResult& result, const NewtonLog& newton,
                         const Arguments& arguments);

}  // namespace planish::cli
