// The service planish.v1.Planish on a JobManager and an UploadStore.
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
  double progress_per_second = 1000;  // StreamSurroundings
  // Brings capabilities up to date before they are sent to a caller: limits may change while the server runs, and some
  // are a tenant's own. Thread-safe; null: nothing changes.
  std::function<void(const Caller&, v1::Capabilities*)> update_capabilities;
};

// Contracts of the calls: proto/planish/v1/planish.proto; what they take: methods.h. `manager`, `uploads` and
// `streams`, which counts the streams of this service, must outlive it.
std::unique_ptr<RpcService> NewPlanishService(JobManager* manager, UploadStore* uploads, ServiceOptions options,
                                              StreamCounter* streams);

}  // namespace planish
