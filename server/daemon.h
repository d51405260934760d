// planishd: puts jobs, workers and RPC together and takes them down again in order (server/README.md).
#pragma once

#include "server/stores.h"

namespace planish {

// What main() of planishd and planishd-farm does, and its exit code. `open_farm` null: with --store, planishd-farm runs
// in the place of this program. The libraries for PostgreSQL and S3 take 6 ms and 5 MB of each process that loads them,
// which a command with a private server would pay for nothing.
int RunDaemon(int argc, char** argv, const FarmOpener& open_farm);

}  // namespace planish
