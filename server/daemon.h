// planishd: puts jobs, workers and RPC together and takes them down again in order (server/README.md).
#pragma once

#include "server/stores.h"

namespace planish {

// The whole of main() for planishd and planishd-farm; returns the exit code. If `open_farm` is null and --store is
// given, this process becomes planishd-farm by exec. The two programs are separate because the libraries for PostgreSQL
// and S3 cost each process that loads them 6 ms and 5 MB, also the private server of a command.
int RunDaemon(int argc, char** argv, const FarmOpener& open_farm);

}  // namespace planish
