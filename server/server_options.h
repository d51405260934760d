// Derives the options of planishd's parts from its flags.
#pragma once

#include "planish/v1/planish.pb.h"
#include "server/flags.h"
#include "server/jobs/job_options.h"
#include "server/jobs/worker_pool.h"

namespace planish {

// Size of an upload's messages: large enough that the overhead of messages is negligible, and small enough that a
// broken connection costs little.
inline constexpr std::int64_t kUploadChunkBytes = kMiB;

JobLimits LimitsFrom(const ServerFlags& flags);
// The options of the JobManager, except members that depend on other parts of the server.
JobManagerOptions ManagerOptionsFrom(const ServerFlags& flags);
v1::Capabilities CapabilitiesFrom(const ServerFlags& flags);
WorkerPoolOptions PoolOptionsFrom(const ServerFlags& flags);
// The factory of workers. `stderr_fd`: see WorkerProcessOptions.
WorkerFactory WorkersFrom(const ServerFlags& flags, int stderr_fd);

}  // namespace planish
