// The service planish.v1.Planish on a JobManager and an UploadStore.
#pragma once

#include <functional>
#include <memory>

#include "grpcpp/impl/service_type.h"
#include "planish/v1/planish.pb.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/upload_store.h"
#include "server/rpc/caller_source.h"
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

// Contracts of the calls: proto/planish/v1/planish.proto. `manager`, `uploads`, `callers` and `streams`, which counts
// the streams of this service, must outlive it, and it must outlive the RpcServer's Shutdown(). The type stays hidden
// because the generated header takes long to compile.
std::unique_ptr<grpc::Service> NewPlanishService(JobManager* manager, UploadStore* uploads, const CallerSource* callers,
                                                 ServiceOptions options, StreamCounter* streams);

}  // namespace planish
