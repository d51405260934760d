// Messages to and from the library's own types.
#pragma once

#include "client/src/element_ids.h"
#include "planish/types.h"
#include "planish/v1/job.pb.h"
#include "planish/v1/planish.pb.h"

namespace planish {
inline namespace abi0 {

double SecondsFrom(const google::protobuf::Duration& duration);
void SetSeconds(double seconds, google::protobuf::Duration* duration);

v1::UnwrapOptions ToProto(const UnwrapOptions& options);
v1::Scheduling ToProto(const Scheduling& scheduling);

// Element ids in a job's error and warnings pass through `renumbering`.
Job FromProto(const v1::Job& job, const ids::Renumbering& renumbering = {});
Progress FromProto(const v1::Progress& progress);
Report FromProto(const v1::Report& report, const ids::Renumbering& renumbering = {});
Event FromProto(const v1::JobEvent& event, const ids::Renumbering& renumbering = {});
JobEstimate FromProto(const v1::JobEstimate& estimate);
Capabilities FromProto(const v1::Capabilities& capabilities);

}  // namespace abi0
}  // namespace planish
