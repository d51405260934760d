// planishd as a worker process, started by StartProcessWorker().
#pragma once

#include <optional>

namespace planish {

// If this is the command line of a worker, serves jobs over the descriptor that it names until the link closes, and
// then ends the process. Otherwise returns nullopt. main() must call it first.
std::optional<int> RunIfWorker(int argc, char** argv);

}  // namespace planish
