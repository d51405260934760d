// planishd as a worker: the far end of StartProcessWorker().
#pragma once

#include <optional>

namespace planish {

// If this is the command line of a worker, serves jobs over the descriptor it names until the link closes, and returns
// the exit code. Otherwise nothing. The first call of main().
std::optional<int> RunIfWorker(int argc, char** argv);

}  // namespace planish
