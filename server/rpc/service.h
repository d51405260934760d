// The service planish.v1.Planish, on top of a JobManager and an UploadStore.
#pragma once

#include <functional>
#include <memory>

#include "planish/v1/planish.pb.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/upload_store.h"
#include "server/rpc/call.h"
#include "server/rpc/stream_counter.h"

namespace planish {

struct ServiceOptions {
  v1::Capabilities capabilities;
  // For tests: a call's metadata "planish-failpoint" becomes JobRequest::failpoint.
  bool failpoints = false;
  double progress_per_second = 1000;  // as in StreamSurroundings
  // Updates the capabilities before they are sent to a caller, since limits may change while the server runs, and
  // tenants may have their own. Thread-safe. May be null.
  std::function<void(const Caller&, v1::Capabilities*)> update_capabilities;
};

// proto/planish/v1/planish.proto has the contracts of the calls, methods.h their limits. `streams` counts the streams
// of this service. `manager`, `uploads` and `streams` must outlive it.
std::unique_ptr<RpcService> NewPlanishService(JobManager* manager, UploadStore* uploads, ServiceOptions options,
                                              StreamCounter* streams);

}  // namespace planish
