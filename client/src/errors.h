// Other people's errors as planish::Error: the one place where they are translated.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "client/src/element_ids.h"
#include "google/rpc/status.pb.h"
#include "planish/error.h"

namespace planish {
inline namespace abi0 {

// `status` must not be OK. Reason and metadata come from an ErrorInfo in the details; without one the reason is the
// name of the code.
Error ErrorFrom(const google::rpc::Status& status);

// From core/base/error.h's statuses.
Error ErrorFrom(const absl::Status& status);

// The same error in the caller's element ids.
Error Renumbered(const Error& error, const ids::Renumbering& renumbering);

}  // namespace abi0
}  // namespace planish
