#include "planish/types.h"

#include <cstddef>

namespace planish::inline abi0 {
namespace {

template <typename Enum, std::size_t kCount>
const char* NameOf(Enum value, const char* const (&names)[kCount]) {
  const auto i = static_cast<std::size_t>(value);
  return i < kCount ? names[i] : "unknown";
}

}  // namespace

const char* ToString(JobState state) {
  return NameOf(state, {"unknown", "QUEUED", "RUNNING", "STOPPING", "SUCCEEDED", "FAILED", "CANCELLED", "EXPIRED"});
}

const char* ToString(Stage stage) {
  return NameOf(stage, {"unknown", "upload", "queue", "decode", "charts", "solve", "layout", "pack", "verify", "encode",
                        "download"});
}

const char* ToString(Seams seams) {
  return NameOf(seams, {"none", "keep", "needed", "auto"});
}

const char* ToString(Solver solver) {
  return NameOf(solver, {"auto", "uzawa", "minres", "direct"});
}

const char* ToString(System system) {
  return NameOf(system, {"auto", "full", "reduced"});
}

const char* ToString(Preconditioner preconditioner) {
  return NameOf(preconditioner, {"auto", "none", "jacobi", "cholesky", "amg"});
}

const char* ToString(Hessian hessian) {
  return NameOf(hessian, {"convex", "exact", "auto"});
}

const char* ToString(Boundary boundary) {
  return NameOf(boundary, {"free", "convex"});
}

const char* ToString(Priority priority) {
  return NameOf(priority, {"low", "normal", "high"});
}

const char* ToString(AtlasLayout layout) {
  return NameOf(layout, {"udim", "stacked"});
}
const char* ToString(Effort effort) {
  return NameOf(effort, {"fast", "normal", "best"});
}

const char* ToString(Precision precision) {
  return NameOf(precision, {"auto", "float", "double"});
}

bool IsTerminal(JobState state) {
  return state == JobState::kSucceeded || state == JobState::kFailed || state == JobState::kCancelled ||
         state == JobState::kExpired;
}

}  // namespace planish::inline abi0
