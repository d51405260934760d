// Converts messages to and from the library's types.
#pragma once

#include <string>

#include "client/src/errors.h"
#include "client/src/mesh_packer.h"
#include "planish/types.h"
#include "planish/v1/job.pb.h"
#include "planish/v1/planish.pb.h"

namespace planish {

Seconds SecondsFrom(const google::protobuf::Duration& duration);
google::protobuf::Duration ToProto(Seconds seconds);
Job::Time TimeFrom(const google::protobuf::Timestamp& time);

v1::UnwrapOptions ToProto(const UnwrapOptions& options);
v1::Scheduling ToProto(const Scheduling& scheduling);

// `renumbering` maps the element ids in errors and warnings to the caller's.
Job FromProto(const v1::Job& job, const ids::Renumbering& renumbering = {});
Report FromProto(const v1::Report& report, const ids::Renumbering& renumbering = {});
Event FromProto(const v1::JobEvent& event, const ids::Renumbering& renumbering = {});
JobEstimate FromProto(const v1::JobEstimate& estimate);
Capabilities FromProto(const v1::Capabilities& capabilities);

// Converts the bytes of a result to UV. Throws MESH_MISMATCH if they belong to another mesh, UV_CORRUPT if their size
// or SHA-256 is wrong.
Uv ParseUv(const v1::UvDescription& description, const std::string& bytes, const PackedMesh& mesh);

}  // namespace planish
