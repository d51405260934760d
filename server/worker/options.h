// Converts planish.v1.UnwrapOptions to the core's options. The same check serves callers, when they submit a job, and
// workers.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/unwrap/unwrap.h"
#include "planish/v1/job.pb.h"
#include "planish/v1/planish.pb.h"

namespace planish {

// Converts the options. INVALID_ARGUMENT with OPTIONS_INVALID and metadata "field" for an enumerator that this server
// does not know, a number out of range, or choices that cannot be combined.
absl::StatusOr<UnwrapOptions> ToCore(const v1::UnwrapOptions& options);

// The status of ToCore().
absl::Status ValidateOptions(const v1::UnwrapOptions& options);

// All seam policies except UNSPECIFIED.
std::vector<v1::Seams> SeamPolicies();

// All combinations of solver options, without UNSPECIFIED, that ValidateOptions() accepts.
std::vector<v1::SolverCombination> SolverCombinations();

// The options of the atlas in effect, with defaults filled in.
v1::Atlas AtlasInEffect(const UnwrapOptions& options, const UnwrapResult& result);

// Values for reports, which are never UNSPECIFIED.
v1::Solver ToProto(SolverType type);
v1::System ToProto(SystemType type);
v1::Preconditioner ToProto(PreconditionerType type);
v1::Hessian ToProto(HessianType type);
v1::Boundary ToProto(BoundaryType type);
v1::Precision ToProto(Precision precision);

}  // namespace planish
