// Other people's errors as planish::Error: the one place where they are translated.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <type_traits>

#include "absl/status/status.h"
#include "google/rpc/status.pb.h"
#include "planish/error.h"

// Element ids in errors and warnings, moved from the numbering of the mesh as sent to somebody else's.
namespace planish::ids {

// New id of an old one. An empty function keeps ids; a negative answer keeps that id.
using IdMap = std::function<std::int64_t(std::int64_t)>;

struct Renumbering {
  IdMap vertex;
  IdMap face;
};

// Metadata values under "vertex", "vertices", "edge", "edges" (as in "3-7,7-9") and "face", "faces"; others stay.
std::map<std::string, std::string> RenumberMetadata(const std::map<std::string, std::string>& metadata,
                                                    const Renumbering& renumbering);

}  // namespace planish::ids

namespace planish {

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
