// The service planish.v1.Planish on a JobManager.
#pragma once

#include <memory>

#include "grpcpp/impl/service_type.h"
#include "planish/v1/planish.pb.h"
#include "server/jobs/job_manager.h"
#include "server/rpc/stream_counter.h"

namespace planish {

// Contracts of the calls: proto/planish/v1/planish.proto. `manager` and `streams`, which counts the streams
// of this service, must outlive it.
// The type stays hidden because the generated header takes long to compile.
std::unique_ptr<grpc::Service> NewPlanishService(JobManager* manager, v1::Capabilities capabilities,
                                                 StreamCounter* streams);

}  // namespace planish
