// The service planish.v1.Planish on a JobManager.
#pragma once

#include <memory>

#include "grpcpp/impl/service_type.h"
#include "planish/v1/planish.pb.h"
#include "server/jobs/job_manager.h"

namespace planish {

// Contracts of the calls: proto/planish/v1/planish.proto. `manager` must outlive the service.
// The type stays hidden because the generated header takes long to compile.
std::unique_ptr<grpc::Service> NewPlanishService(JobManager* manager, v1::Capabilities capabilities);

}  // namespace planish
