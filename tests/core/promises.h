// What Unwrap() promises of any mesh with SeamPolicy::kAuto, judged on what it delivered.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/unwrap/unwrap.h"

namespace planish::testing {

// A sentence for each promise that was broken; empty: none was. `options` are those of the call. Overlaps are looked
// for between all pairs of triangles, whatever charts the result says there are.
std::vector<std::string> BrokenPromises(const Mesh& mesh, const UnwrapOptions& options,
                                        const absl::StatusOr<UnwrapResult>& result);

}  // namespace planish::testing
