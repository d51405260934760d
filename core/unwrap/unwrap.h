// The facade of the core: a disc mesh in, verified UV and a report out.
//
//   planish::Mesh mesh = ...;
//   absl::StatusOr<planish::UnwrapResult> result = planish::Unwrap(mesh, {}, {});
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/abf/flatten.h"
#include "core/base/interrupter.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/quality.h"

namespace planish {

// The type of the delivered UV.
enum class Precision {
  kAuto,  // float, unless rounding to float flips or collapses triangles that double keeps
  kFloat,
  kDouble,
};

struct UnwrapOptions {
  FlattenOptions flatten;
  Precision precision = Precision::kAuto;
  // Threads the job may use, the calling one included. In [1, kMaxThreads]. The result is the same bytes for any
  // number.
  int threads = 1;

  // INVALID_ARGUMENT with reason OPTIONS_INVALID naming the field, or OK.
  absl::Status Validate() const;
};
inline constexpr int kMaxThreads = 256;

enum class UnwrapStage { kCharts, kSolve, kLayout, kPack, kVerify };

struct UnwrapProgress {
  UnwrapStage stage = UnwrapStage::kCharts;
  int chart = 0;  // 0-based
  int chart_count = 1;
  FlattenProgress flatten;  // meaningful from kSolve on
};

// What one call may bring along. The callback runs on the calling thread, at the start of every stage, at every
// Newton iteration and every few dozen linear iterations; it must return quickly.
struct UnwrapControl {
  const Interrupter* interrupter = nullptr;
  std::function<void(const UnwrapProgress&)> on_progress;
};

// A promise that was not kept, or something the caller should know; reasons as in planish.v1.Warning.
struct UnwrapWarning {
  std::string reason;
  std::string message;
  std::map<std::string, std::string> metadata;
};

// Wall-clock seconds of each stage.
struct UnwrapSeconds {
  double charts = 0;
  double solve = 0;
  double layout = 0;
  double pack = 0;
  double verify = 0;
};

struct ChartReport {
  std::int64_t triangles = 0;
  FlattenSummary flatten;
};

struct UnwrapResult {
  // (u, v) of every corner, 2 * 3F numbers in [0, 1]: entries 2 (3 f + k) and 2 (3 f + k) + 1 belong to corner
  // k of face f. When precision is kFloat every number is a float exactly.
  std::vector<double> uv;
  Precision precision = Precision::kFloat;  // kFloat or kDouble
  std::vector<ChartReport> charts;
  Quality quality;  // of `uv` as delivered
  UnwrapSeconds seconds;
  std::vector<UnwrapWarning> warnings;
};

// Flattens `mesh`, which must be a disc (core/mesh/disc_check.h); deterministic.
// Errors: INVALID_ARGUMENT with a MESH_* or OPTIONS_INVALID reason; CANCELLED after an interrupt (within a few
// dozen linear iterations or one sparse factorization); INTERNAL with SOLVER_FAILED if no finite map came out.
// A solve that stops early is not an error: see FlattenSummary::converged and the warnings.
// Thread-safe: calls share nothing, each has a team of threads of its own.
absl::StatusOr<UnwrapResult> Unwrap(const Mesh& mesh, const UnwrapOptions& options, const UnwrapControl& control);

}  // namespace planish
