// What the parts of planishd are given, as its flags say.
#pragma once

#include "planish/v1/planish.pb.h"
#include "server/flags.h"
#include "server/jobs/job_options.h"
#include "server/jobs/worker_pool.h"

namespace planish {

// Of an upload's messages; large enough that messages cost nothing, small enough that a broken connection does not
// either.
inline constexpr std::int64_t kUploadChunkBytes = kMiB;

JobLimits LimitsFrom(const ServerFlags& flags);
// Without what depends on other parts of the server.
JobManagerOptions ManagerOptionsFrom(const ServerFlags& flags);
v1::Capabilities CapabilitiesFrom(const ServerFlags& flags);
WorkerPoolOptions PoolOptionsFrom(const ServerFlags& flags);
// How workers are started. `stderr_fd`: WorkerProcessOptions.
WorkerFactory WorkersFrom(const ServerFlags& flags, int stderr_fd);

}  // namespace planish
