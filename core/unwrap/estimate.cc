#include "core/unwrap/estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/abf/step_solver.h"

namespace planish {
namespace {

// Measured by tests/bench/run.sh memory, and by planish_hunt --cases over all families of meshes, of 20 to 100,000
// faces: the estimate is more than was measured for 999 of 1,000 meshes, and at most three times as much for 97 of 100.
constexpr double kFixedBytes = 7e6;        // half of it code and tables, in a process that has not touched them yet
constexpr double kBytesPerThread = 2.5e6;  // for each thread but the first: charts are solved side by side
constexpr double kBytesPerFace = 1000;     // when solved with multigrid
// Additional bytes: of a face in a chart, at most; of a face with vertices of its own.
constexpr double kChartBytesPerFace = 390, kBytesPerPiece = 200;
// With SeamPolicy::kAuto small meshes may fall apart into many charts. The first faces count for kFirstBytesPerFace
// more, up to kFirstBytes in all. Each face adds kSmallBytesPerFace in a small mesh, less in a larger one, and nothing
// from kSmallFaces on. The counts do not tell triangles on random vertices, which take most, from a closed surface. Of
// 12,902 meshes of 36 families with 60 to 6,000 faces, and of 288 with 8,000 to 150,000, none takes more than the
// estimate (0.98 of it at most); 0.5 % and 6 % take less than a third.
constexpr double kFirstBytesPerFace = 2000, kFirstBytes = 0.8e6;
constexpr double kSmallBytesPerFace = 300, kSmallFaces = 30'000;
// PackEffort::kBest rearranges up to PackTuning::most_to_rearrange charts. This takes kBestBytesPerFace per face, at
// most kMostBestBytes. With any effort, the images of each tile beyond the first take kBytesPerTile.
constexpr double kBestBytesPerFace = 60e3, kMostBestBytes = 60e6;
constexpr double kBytesPerTile = 0.25e6;
// With a Cholesky factorization instead of multigrid: bytes per face of meshes of up to kReferenceFaces, and the power
// of the size with which this number grows beyond. Measured: 1,310 bytes a face of 50,000, 1,390 of 200,000.
constexpr double kFactorBytesPerFace = 1650, kFactorBytesPower = 0.1;
constexpr double kBytesPerByte = 2;  // per encoded byte, while the mesh is decoded
// A single triangle has three vertices: this many more than half a vertex per face, as closed surfaces have.
constexpr double kLooseVerticesPerPiece = 2.5;

constexpr double kSecondsPerByte = 1e-8;
constexpr double kSecondsPerPiece = 8e-6;  // additional time for charts and maps
constexpr double kPackUnit = 1e-9;         // of PackTuning's work, in seconds
// Seconds per face in a mesh of kReferenceFaces, for solving and for finding charts. Measured on an AMD EPYC with both
// cores busy: 95 % of 12,181 generated meshes of 60 to 6,000 faces, and of 288 of 8,000 to 150,000, take a third of the
// estimate or more. With SeamPreference::kTexture, no mesh that takes at least 0.05 s takes more than three times the
// estimate.
constexpr double kReferenceFaces = 50'000;
constexpr double kSolve = 5.35e-6, kSolvePower = 0.05;
constexpr double kMerge = 6.55e-6, kMergePower = 0.05;
// With SeamPreference::kSeams charts are glued and seams moved. That takes kSeamSearch times kMerge, and up to
// kSmallSeamSearch more in meshes below kSmallSearchFaces, which have a larger share of their faces at seams and are
// searched twice if they are symmetric. Measured with 646 meshes of 36 families with 60 to 6,000 faces.
constexpr double kSeamSearch = 2, kSmallSeamSearch = 4, kSmallSearchFaces = 8000;
// With SeamPolicy::kNeeded, seconds per face. Pieces are solved as a whole, and again each time they are cut. This is a
// middle value: among the shared meshes of 200 faces or more, discs and spheres took 3e-6 to 9e-6 in all, most closed
// meshes 13e-6 to 60e-6, and nets of many handles and needles up to 600e-6.
constexpr double kNeeded = 10e-6;
constexpr double kFactorization = 4;      // times kSolve
constexpr double kConvexBoundary = 8;     // times kSolve: many active sets
constexpr double kUnpreconditioned = 60;  // times kSolve

bool Factorizes(const FlattenOptions& options) {
  return options.solver == SolverType::kDirect || options.preconditioner == PreconditionerType::kCholesky;
}

// Whether another preconditioner than multigrid or a factorization was asked for, or none.
bool IsSlow(const FlattenOptions& options) {
  return options.system == SystemType::kFull || options.preconditioner == PreconditionerType::kNone ||
         options.preconditioner == PreconditionerType::kJacobi;
}

// Faces with vertices of their own, as far as the counts tell.
double Pieces(double faces, double vertices) {
  return std::clamp((vertices - faces / 2) / kLooseVerticesPerPiece, 0.0, faces);
}

// The minimum time of the packer is estimated for this number of charts, which is typical of small meshes; the number
// of charts is not known.
constexpr double kFewCharts = 4;

// Seconds for packing. `rest`: seconds for charts and their maps. A single chart needs no packing; with kAuto there are
// usually several.
double PackSeconds(double rest, double pieces, const UnwrapOptions& options) {
  const PackTuning& tuning = options.atlas.tuning;
  const double share = ShareOfRest(options.atlas.effort, tuning) * rest;
  if (options.seams.policy != SeamPolicy::kAuto || options.atlas.effort == PackEffort::kFast) return share;
  if (options.atlas.effort == PackEffort::kBest) return std::max(share, kPackUnit * tuning.least_best_work / 2);
  const double of_few = std::min(tuning.least_per_few * kFewCharts, tuning.least_work);
  return std::max({share, kPackUnit * of_few, kPackUnit * tuning.least_per_chart * pieces});
}

// Bytes for packing, beside those of the charts.
double PackBytes(double faces, const PackOptions& options) {
  const double best = options.effort == PackEffort::kBest ? std::min(kMostBestBytes, kBestBytesPerFace * faces) : 0;
  return best + kBytesPerTile * (options.tiles - 1);
}

double Seconds(double faces, double pieces, double mesh_bytes, const UnwrapOptions& options) {
  const SeamPolicy policy = options.seams.policy;
  const double size = std::max(1.0, faces / kReferenceFaces);
  double solve = kSolve * faces * std::pow(size, kSolvePower);
  if (Factorizes(options.flatten)) solve *= kFactorization;
  if (IsSlow(options.flatten)) solve *= kUnpreconditioned;
  if (options.flatten.boundary == BoundaryType::kConvex) solve *= kConvexBoundary;
  double seconds = solve + kSecondsPerByte * mesh_bytes;
  if (policy == SeamPolicy::kNone) return seconds;
  const double search = kSeamSearch + kSmallSeamSearch * std::max(0.0, 1 - faces / kSmallSearchFaces);
  const double merge = kMerge * (options.seams.prefer == SeamPreference::kSeams ? search : 1);
  if (policy == SeamPolicy::kAuto) seconds += merge * faces * std::pow(size, kMergePower);
  if (policy == SeamPolicy::kNeeded) seconds += kNeeded * faces;
  seconds += kSecondsPerPiece * pieces;
  return options.pack ? seconds + PackSeconds(seconds, pieces, options) : seconds;
}

}  // namespace

Estimate EstimateUnwrap(std::int64_t faces, std::int64_t vertices, std::int64_t mesh_bytes,
                        const UnwrapOptions& options) {
  const auto f = static_cast<double>(faces), v = static_cast<double>(vertices), b = static_cast<double>(mesh_bytes);
  // A disc has no pieces, and many vertices only if there are many faces.
  const double pieces = options.seams.policy == SeamPolicy::kNone ? 0 : Pieces(f, v);
  const double factor_per_face = kFactorBytesPerFace * std::pow(std::max(1.0, f / kReferenceFaces), kFactorBytesPower);
  const double per_face = Factorizes(options.flatten) ? factor_per_face : kBytesPerFace;
  // Where multigrid fails on a chart, a factorization takes its place: one for each thread at a time. With kAuto that
  // is rare, and few charts are as large as the mesh, so no memory is reserved: such a job is run again with more.
  const bool may_fall_back =
      options.seams.policy != SeamPolicy::kAuto && !Factorizes(options.flatten) && !IsSlow(options.flatten);
  const double fallback = may_fall_back ? (kFactorBytesPerFace - kBytesPerFace) *
                                              std::min(f, static_cast<double>(kMostFallbackFaces) * options.threads)
                                        : 0;
  double charts = options.seams.policy == SeamPolicy::kNone ? 0 : kChartBytesPerFace * f;
  if (options.seams.policy == SeamPolicy::kAuto) {
    charts += std::min(kFirstBytes, kFirstBytesPerFace * f);
    charts += kSmallBytesPerFace * f * std::max(0.0, 1 - f / kSmallFaces);
  }
  const bool packs = options.pack && options.seams.policy != SeamPolicy::kNone;
  const double bytes = kFixedBytes + kBytesPerThread * (options.threads - 1) + per_face * f + charts + fallback +
                       (packs ? PackBytes(f, options.atlas) : 0) + kBytesPerPiece * pieces + kBytesPerByte * b;
  Estimate estimate;
  constexpr auto kLargest = std::numeric_limits<std::int64_t>::max();
  estimate.peak_bytes = bytes < static_cast<double>(kLargest) ? static_cast<std::int64_t>(bytes) : kLargest;
  estimate.seconds = Seconds(f, pieces, b, options);
  return estimate;
}

}  // namespace planish
