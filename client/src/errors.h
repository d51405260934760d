// Converts statuses and exceptions to planish::Error.
#pragma once

#include <string>
#include <type_traits>

#include "absl/status/status.h"
#include "core/base/element_ids.h"
#include "google/rpc/status.pb.h"
#include "planish/error.h"

namespace planish {

// An error with code kInvalidArgument, for wrong arguments of the caller.
Error Invalid(const std::string& reason, const std::string& message, const Error::Metadata& metadata = {});

// `status` must not be OK. Reason and metadata come from an ErrorInfo in the details; without one, the reason is the
// name of the code.
Error ErrorFrom(const google::rpc::Status& status);

// Converts a status of core/base/error.h, which must not be OK.
Error ErrorFrom(const absl::Status& status);

// Returns `error` with its element ids converted by `renumbering`, to the caller's ids for example.
Error Renumbered(const Error& error, const ids::Renumbering& renumbering);

// Converts the exception that is being handled. To be called in a catch block.
Error CurrentError();

// Runs `work` and returns its result, or the error of the exception that it threw. Exceptions leave the library only
// through Result::value().
template <typename Work>
Result<std::invoke_result_t<Work>> Caught(const Work& work) {
  try {
    if constexpr (!std::is_void_v<std::invoke_result_t<Work>>) {
      return work();
    } else {
      work();
      return std::monostate();
    }
  } catch (...) {
    return CurrentError();
  }
}

}  // namespace planish
