// Other people's errors as planish::Error: the one place where they are translated.
#pragma once

#include <string>
#include <type_traits>

#include "absl/status/status.h"
#include "core/base/element_ids.h"
#include "google/rpc/status.pb.h"
#include "planish/error.h"

namespace planish {

// kInvalidArgument, of what the caller gave.
Error Invalid(const std::string& reason, const std::string& message, const Error::Metadata& metadata = {});

// `status` must not be OK. Reason and metadata come from an ErrorInfo in the details; without one the reason is the
// name of the code.
Error ErrorFrom(const google::rpc::Status& status);

// From core/base/error.h's statuses.
Error ErrorFrom(const absl::Status& status);

// The same error in the caller's element ids.
Error Renumbered(const Error& error, const ids::Renumbering& renumbering);

// The exception that is being handled.
Error CurrentError();

// What `work` returns, or throws: exceptions do not leave the library but through Result::value().
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
